"""Means of rows over scenes and seeds, and ±, the spread over seeds or the uncertainty of the reference.

Only finite values of cells that ended ok, or stalled at some frames, enter a mean. It is first taken over
the segments of a recording, then over the recordings of one seed, which are independent sources of motion,
then over seeds; the spread is the standard deviation over seeds (n - 1).
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from operator import itemgetter
from statistics import fmean
from typing import Any

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import SECOND_STARTS
from reports.finished_run import Run


@dataclass(frozen=True)
class Mean:
    """Mean of a metric, its spread over seeds, and the cells it was taken over.

    seeds: how many have the metric. full_count: number of cells that should have it, every seed in every
    scene in which any method has the metric; where fewer have, the mean is not `complete`. stalled: a
    solver left some frames of some cell unconverged. seeded: another seed would give another value.
    cells: value of each (scene, seed). pairing_group: means of one group are compared seed by seed; empty
    for none. uncertainty: how far an equally valid reference would move the mean, in the metric's unit;
    None if unknown. moved: change of a cell's value by each of those references, where it is known.
    """

    value: float
    spread: float | None
    seeds: int
    full_count: int
    stalled: bool = False
    seeded: bool = True
    cells: Mapping[tuple[str, int], float] = field(default_factory=dict, compare=False)
    pairing_group: str = field(default="", compare=False)
    uncertainty: float | None = None
    moved: Mapping[tuple[str, int], Mapping[str, float]] = field(default_factory=dict, compare=False)

    @property
    def spread_or_uncertainty(self) -> float | None:
        """Number printed behind ±: the larger of spread and uncertainty, None where there is neither."""
        return max((x for x in (self.spread, self.uncertainty) if x is not None), default=None)

    @property
    def missing(self) -> int:
        """Number of cells without the metric: they failed, or belong to a network that diverged."""
        return max(self.full_count - len(self.cells), 0)

    @property
    def complete(self) -> bool:
        """True if every cell that should have the metric has it."""
        return self.missing == 0

    @property
    def fewer(self) -> str:
        """Remark behind a number on how many roll-outs it is over; empty where these are all."""
        return "" if self.complete else f" ({len(self.cells)} of {self.full_count} roll-outs)"


SEGMENT = re.compile(r"(?<=/)(\d+_\d+)_[a-z](?=@|$)")


def recording_of(scene: str) -> str:
    """Return the name of a scene, for a segment of a recording that of the whole: without its letter.

    >>> recording_of("tshirt/01_01_a@clip"), recording_of("tshirt/06_15"), recording_of("tshirt/kick")
    ('tshirt/01_01@clip', 'tshirt/06_15', 'tshirt/kick')
    """
    return SEGMENT.sub(r"\1", scene)


def mean_by_recording(cells: Mapping[tuple[str, int], float]) -> dict[tuple[str, int], float]:
    """Return (recording, seed) -> mean over the segments of the recording."""
    values: dict[tuple[str, int], list[float]] = {}
    for (scene, seed), value in cells.items():
        values.setdefault((recording_of(scene), seed), []).append(value)
    # Where all are one number their mean is it, to the bit: what every motion repeats is certain.
    return {
        cell: of_segments[0] if len(set(of_segments)) == 1 else fmean(of_segments)
        for cell, of_segments in values.items()
    }


# Columns that means are made of; a frame may lack the last two.
READ = ["scene", "seed", "status", "usable", "value", "seeded", "pairing_group", "uncertainty", "moved"]


def means(frame: pd.DataFrame, *keys: str) -> pd.Series:
    """Compute a Mean for each group of the usable rows, in the order of the rows.

    Args:
        frame: rows as Run.frame has them.
        keys: columns that make a group, such as "garment", "method", "metric"; the last two are among
            them.
    """
    names = list(keys)
    place, end = (
        itemgetter(*(names.index(key) for key in names if key != name)) for name in ("method", "metric")
    )
    scenes: dict[Any, set[str]] = defaultdict(set)
    failed: dict[Any, set[int]] = defaultdict(set)
    groups: dict[tuple, list[Any]] = defaultdict(list)
    rows = frame.reindex(columns=READ)
    for key, line in zip(zip(*(frame[name].tolist() for name in names)), rows.itertuples(index=False)):
        if line.status == "skipped":
            continue
        scenes[place(key)].add(line.scene)
        if line.usable:
            groups[key].append(line)
        else:
            failed[end(key)].add(line.seed)
    values = [_mean(lines, len(scenes[place(key)]), failed[end(key)]) for key, lines in groups.items()]
    index = pd.MultiIndex.from_arrays(
        [list(column) for column in zip(*groups)] or [[]] * len(names), names=names
    )
    return pd.Series(values, index=index, dtype=object)


def _mean(lines: Sequence[Any], scenes: int, failed: Set[int]) -> Mean:
    """Return the mean of usable rows; scenes: how many should have it, failed: seeds with a failed cell."""
    cells = {(line.scene, line.seed): line.value for line in lines}
    by_seed: dict[int, list[float]] = {}
    for (_, seed), of_recording in mean_by_recording(cells).items():
        by_seed.setdefault(seed, []).append(of_recording)
    of_seeds = [fmean(values) for values in by_seed.values()]
    value, freedom = fmean(of_seeds), len(of_seeds) - 1
    # As statistics.stdev, which sums fractions: that took a third of the time of all means.
    middle = value if len(set(of_seeds)) > 1 else of_seeds[0]  # the mean of equal numbers may be rounded
    spread = math.dist(of_seeds, [middle] * len(of_seeds)) / math.sqrt(freedom) if freedom else None
    noise = {(x.scene, x.seed): x.uncertainty for x in lines if not math.isnan(x.uncertainty)}
    return Mean(
        value=value,
        spread=spread,
        seeds=len(of_seeds),
        full_count=scenes * len(by_seed.keys() | failed),
        stalled=any(line.status == "stalled" for line in lines),
        seeded=any(line.seeded for line in lines),
        cells=cells,
        pairing_group=lines[0].pairing_group,
        uncertainty=fmean(mean_by_recording(noise).values()) if noise else None,
        moved={
            (line.scene, line.seed): dict(line.moved)
            for line in lines
            if isinstance(line.moved, tuple) and line.moved
        },
    )


def mean_of(frame: pd.DataFrame, method: str, metric: str) -> Mean | None:
    """Return the mean over the recordings and seeds that have the metric, None without any."""
    rows = frame[(frame["metric"] == metric) | ~frame["usable"]]
    return means(rows, "method", "metric").get((method, metric))


def value_of(frame: pd.DataFrame, method: str, metric: str) -> float | None:
    """Return the value of `mean_of`, or None."""
    mean = mean_of(frame, method, metric)
    return None if mean is None else mean.value


def match_scenes(frame: pd.DataFrame, methods: Iterable[str], metric: str) -> list[str]:
    """Return the scenes in which each of the methods has the metric with all of its seeds."""
    rows = frame[frame["usable"] & (frame["metric"] == metric)]
    scenes = list(dict.fromkeys(frame["scene"]))
    for method in methods:
        of_method = rows[rows["method"] == method]
        seeds = of_method.groupby("scene")["seed"].nunique()
        full = set(seeds[seeds == of_method["seed"].nunique()].index)
        scenes = [scene for scene in scenes if scene in full]
    return scenes


def pair(frame: pd.DataFrame, one: str, other: str, metric: str) -> tuple[Mean | None, Mean | None]:
    """Return both means over the scenes that the two methods share, None where they share none.

    Where one of them was not measured at all, the other's mean is over its own scenes.
    """
    rows = frame[frame["method"].isin((one, other)) & ((frame["metric"] == metric) | ~frame["usable"])]
    names = match_scenes(rows, (one, other), metric)
    by_method = means(rows[rows["scene"].isin(names)] if names else rows, "method", "metric")
    first, second = (by_method.get((method, metric)) for method in (one, other))
    if first is None or second is None:
        return first, second
    if not names:
        return None, None
    count = frame[(frame["metric"] == metric) & (frame["status"] != "skipped")]["scene"].nunique()
    first, second = (replace(m, full_count=count * (m.full_count // len(names))) for m in (first, second))
    return first, second


# Metric -> its value where a roll-out equals the reference.
AT_REFERENCE = {
    "distance/rms": 0.0, "curvature/histogram": 0.0, "curvature/error": 0.0, "dynamics/correlation": 1.0,
    "dynamics/amplitude": 1.0,
}  # fmt: skip


def error_of_twin(rows: pd.DataFrame, metric: str) -> pd.Series:
    """Return scene -> error against the reference of its twin from another start, where that converged."""
    errors = rows[(rows["metric"] == metric) & rows["usable"] & (rows["status"] == "ok")]
    twin = errors[errors["method"] == SECOND_STARTS[0]]
    distances = (twin["value"] - AT_REFERENCE.get(metric, 0.0)).abs()
    return distances.groupby(twin["scene"], observed=True).mean()


def count_spreads(run: Run, rows: pd.DataFrame, method: str, metric: str) -> float | None:
    """Return how far a method is from the reference, in errors of its twin from another start.

    In each scene the spread is `error_of_twin`, and the method's error the root mean square over its
    seeds. The result is the mean error of the scenes over their mean spread; None where no scene has a
    spread.
    """
    errors = rows[(rows["metric"] == metric) & rows["usable"] & (rows["method"] == method)]
    squares = (errors["value"] - AT_REFERENCE[metric]) ** 2
    spread = error_of_twin(rows, metric)
    error = squares.groupby(errors["scene"], observed=True).mean() ** 0.5
    scenes = spread.index.intersection(error.index)
    total = float(spread[scenes].sum())
    return float(error[scenes].sum()) / total if total > 0.0 else None


FRAME = ["scene", "seed", "seconds"]


def share_of_frames(term: str) -> Metric:
    """Declare the metric of the rows that `add_shares` adds."""
    title = f"Frames with more {term}"
    return Metric(name=f"frames/{term}", unit="%", title=title, definition="", lower_is_better=True)


def add_shares(rows: pd.DataFrame, frames: pd.DataFrame, term: str, one: str, other: str) -> pd.DataFrame:
    """Return the rows and, for either method, the share of frames in which it has more energy [%].

    Args:
        rows: of the run.
        frames: energies of evaluated frames, as Run.frame_energies.
        term: of the energy, as "strain".
        one: a method.
        other: a second method; they are compared in each scene and seed that both have.
    """
    if frames.empty or term not in frames:
        return rows
    first, second = (frames[frames["method"] == name].dropna(subset=term) for name in (one, other))
    pairs = first.merge(second, on=FRAME, suffixes=("", "_other"))
    masks = {one: pairs[term] > pairs[f"{term}_other"], other: pairs[term] < pairs[f"{term}_other"]}
    parts = [rows]
    for method, mask in masks.items():
        cells = (100.0 * mask).groupby([pairs["scene"], pairs["seed"]])
        shares = cells.mean().rename("share")
        terms = rows[(rows["method"] == method) & (rows["metric"] == f"energy/{term}") & rows["usable"]]
        shared = terms.merge(shares.reset_index())
        metric = share_of_frames(term)
        shared = shared.assign(
            metric=metric.name, unit=metric.unit, value=shared["share"], uncertainty=float("nan"),
            moved=[()] * len(shared),
        )  # fmt: skip
        parts.append(shared[rows.columns])
    return pd.concat(parts, ignore_index=True)
