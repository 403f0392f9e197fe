"""Comparison of two runs: changes beyond the noise of both, by garment and by scene, and what is gone.

A network is tested in each scene over its seeds. Three seeds say little of their scatter, so the scatter
is pooled over the scenes of the method. A scene that scatters more has its own; one that scatters far more
stays out of the pool. The test is Student's with the pooled degrees of freedom, by Bonferroni for all these
tests. A method without seeds is compared with the noise of the reference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEVEL, one_protocol
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import OF_SCENES
from reports.finished_run import Run
from reports.statistics.effects import DIFFERENCE, RATIO, Effect, effect
from reports.statistics.means_and_spreads import AT_REFERENCE, Mean, means
from reports.statistics.pareto import REPEATS, TIME, WHOLE
from reports.statistics.relative_excess import relative_metric, with_relative_excess
from reports.statistics.verdicts import effect_of, holm
from reports.tables.table import number, with_spread

GONE, WORSE, BETTER, OTHER = "gone", "worse", "better", "changed"  # verdicts, the first two fail
FAILING = (GONE, WORSE)
ENERGY_TOLERANCE = 0.02  # share of an energy
TOLERANCE = 0.05  # share of any other answer
TIME_TOLERANCE = 0.15  # share of a time or memory that was repeated
ONCE = 2.0  # factor of a time that was taken once: below it another load of the machine may be the cause
# share of the median method's value; a smaller difference is none, whatever it is a share of
FLOOR = 1e-4
WORST = "cost/frame_worst"  # the time of one frame, which anything else on the machine may have delayed
SPREADS = 3.0  # times the reference's noise, beyond which an answer that nothing repeats has changed


@dataclass(frozen=True)
class Change:
    """One line of a comparison.

    Attributes:
        verdict: GONE, WORSE, BETTER or OTHER.
        place: garment or scene.
        method: name of the method.
        metric: name of the metric.
        size: the change in words.
    """

    verdict: str
    place: str
    method: str
    metric: str
    size: str


def tolerance_of(metric: Metric) -> float:
    """Return the share of a number up to which another one counts as equal.

    >>> tolerance_of(Metric(name="energy/strain", unit="J", title="Strain", definition=""))
    0.02
    """
    if metric.of == "machine":
        return TIME_TOLERANCE
    of_energy = metric.name.startswith(("energy/", "relative_excess/"))
    return ENERGY_TOLERANCE if of_energy else TOLERANCE


def side(metric: Metric, before: float, after: float, difference: float) -> str:
    """Return whether a difference of that sign is worse or better, or just another number.

    What neither side of is better is worse farther from the value that the reference itself has.
    """
    if metric.lower_is_better is not None:
        return WORSE if bool(difference > 0.0) is metric.lower_is_better else BETTER
    known = 1.0 if metric.name.endswith("correlation") else None
    best = AT_REFERENCE.get(metric.name.replace("/common_", "/"), known)
    if best is None:
        return OTHER
    return WORSE if abs(after - best) > abs(before - best) else BETTER


def size_of(metric: Metric, mean: Mean, new: Mean, far: Effect, p: float | None) -> str:
    """Return a change as "0.21 ± 0.010 -> 0.26 ± 0.010 J, × 1.24 (1.20 to 1.28), p 0.0030"."""
    before, after = (with_spread(m.value, m.spread_or_uncertainty) for m in (mean, new))
    text = (
        f"{before} -> {after}{_unit(metric)}, {'×' if far.scale == RATIO else 'by'} {number(far.shown)}"
    )
    if far.interval:
        text += f" ({' to '.join(number(end) for end in far.interval)})"
    return text + ("" if p is None else f", p {number(p, 2)}")


def _unit(metric: Metric) -> str:
    return "" if metric.unit == "1" else f" {metric.unit}"


def within_tolerance(metric: Metric, mean: Mean, new: Mean, far: Effect, scale: float) -> bool:
    """Return whether a change of means is too small to be one.

    Args:
        metric: of the means.
        mean: the earlier one.
        new: the later one.
        far: the effect of the later against the earlier one.
        scale: the median method's value there; unit of a difference whose unit is unknown.
    """
    if abs(new.value - mean.value) <= FLOOR * scale:
        return True
    share = tolerance_of(metric)
    if far.scale == DIFFERENCE:
        return abs(far.value) <= share * (far.unit or scale)
    return max(far.shown, 1.0 / far.shown) <= 1.0 + share if far.shown > 0.0 else False


ODD = 3.0  # times the median scatter of scenes, beyond which a scene is left out of the pooled scatter
NETWORK_METRIC = ["method", "metric"]


def changed_scenes(one: pd.DataFrame, other: pd.DataFrame, metrics: dict[str, Metric]) -> list[Change]:
    """Return the changes of single scenes.

    Args:
        one: rows of the earlier run: scene, method, seed, metric, value, uncertainty, seeded.
        other: rows of the later run, of the same cells.
        metrics: by name. Times and memory are left out.
    """
    from scipy import stats

    answers = [name for name, metric in metrics.items() if metric.of != "machine"]
    frame = pd.concat([one.assign(run=0), other.assign(run=1)], ignore_index=True)
    frame = frame[frame["metric"].isin(answers)].astype(dict.fromkeys((*NETWORK_METRIC, "scene"), str))
    # One seed says nothing of how seeds scatter.
    seeds = frame.groupby(NETWORK_METRIC)["seed"].transform("nunique")
    frame = frame[~frame["seeded"] | (seeds > 1)]
    if frame.empty:
        return []
    groups = frame.groupby(NETWORK_METRIC, sort=False)
    rows = pd.concat([_differences(metrics[name], of_group) for (_, name), of_group in groups])
    tests = max(int((rows["error"] > 0.0).sum()), 1)
    beyond = rows["error"] * stats.t.isf(LEVEL / 2.0 / tests, rows["freedom"])
    rows = rows[rows["far"].abs() > np.maximum(rows["least"], beyond)]
    return [
        Change(
            side(metrics[row.metric], row.before, row.after, row.far), row.scene, row.method, row.metric,
            f"{number(row.before)} -> {number(row.after)}{_unit(metrics[row.metric])}",
        )
        for row in rows.itertuples()
    ]  # fmt: skip


def _differences(metric: Metric, rows: pd.DataFrame) -> pd.DataFrame:
    """Return for each scene of one method the difference of the later run from the earlier.

    before, after: means over seeds. far: the difference on the scale, of logarithms where all values are
    positive, else plain. least: the largest one on that scale that is no change. error: its standard
    error, 0 without seeds. freedom: degrees of freedom of the error.
    """
    values, run = rows["value"].to_numpy(), rows["run"].to_numpy()
    relative = metric.name.startswith("relative_excess/")
    signed = relative or metric.arbitrary_zero or metric.name.endswith("correlation")
    positive = not signed and values.min() > 0.0
    scaled = np.log(values) if positive else values
    places, scenes = pd.factorize(rows["scene"], sort=True)
    cells = 2 * places + run
    counts = np.bincount(cells)

    def means_of(numbers: np.ndarray) -> np.ndarray:
        """Return (2,scenes): mean over the seeds of either run."""
        return (np.bincount(cells, numbers) / counts).reshape(-1, 2).T

    (old, new), (before, after) = means_of(values), means_of(scaled)
    draws = pd.factorize(rows["seed"] * 2 + run)[0]
    scatter, freedom = _scatter(scaled - np.stack([before, after])[run, places], places, draws)
    median = float(np.median(np.abs(old)))
    moved = SPREADS * np.hypot(*means_of(rows["uncertainty"].fillna(0.0).to_numpy()))
    share = tolerance_of(metric)
    if positive:
        least = np.maximum(math.log1p(share), np.log1p((FLOOR * median + moved) / old))
    else:
        unit = 100.0 if relative else np.maximum(np.abs(old), median)
        least = np.maximum(np.maximum(share * unit, FLOOR * median), moved)
    error = scatter * np.sqrt((1.0 / counts).reshape(-1, 2).sum(axis=1))
    return pd.DataFrame({
        "scene": scenes, "method": rows["method"].iloc[0], "metric": metric.name, "before": old, "after": new,
        "far": after - before, "least": least, "error": error, "freedom": freedom,
    })  # fmt: skip


def _scatter(residuals: np.ndarray, places: np.ndarray, draws: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the standard deviation over seeds in each scene, at least the pooled one, and its freedom.

    Args:
        residuals: (N,) values less the mean over the seeds of their scene and run.
        places: (N,) numbers of their scenes.
        draws: (N,) numbers of their trainings, each a seed of a run.

    A seed may move all scenes alike. With correlation rho between S scenes, the pooled variance has
    1 + (S - 1) rho^2 times fewer degrees of freedom than with independent scenes.
    """
    squares, freedom = np.bincount(places, residuals**2), np.bincount(places) - 2
    if not freedom.any() or not squares.any():
        return squares * 0.0, math.inf
    spread = np.sqrt(squares / np.maximum(freedom, 1))
    pool = (freedom > 0) & (spread <= ODD * np.median(spread[freedom > 0]))
    if not squares[pool].any():
        pool = freedom > 0
    total = float(freedom[pool].sum())
    pooled = float(squares[pool].sum()) / total
    scenes, kept = int(pool.sum()), pool[places]
    of_draws = np.bincount(draws[kept], residuals[kept]) / np.maximum(np.bincount(draws[kept]), 1)
    common = float((of_draws**2).sum()) / (draws.max() - 1)
    rho = (scenes * common / pooled - 1.0) / (scenes - 1) if scenes > 1 else 0.0
    total /= 1.0 + (scenes - 1) * min(max(rho, 0.0), 1.0) ** 2
    return np.maximum(spread, math.sqrt(pooled)), total


CELL = ["scene", "method", "seed", "metric"]


def gone(one: pd.DataFrame, other: pd.DataFrame) -> list[Change]:
    """Return a line for each method, and each metric of one, that the later run lacks somewhere.

    Args:
        one: rows of the earlier run, with the columns of CELL and `place`.
        other: rows of the later run.
    """
    keys = [frame.set_index(CELL).index for frame in (one, other)]
    missing = one[~keys[0].isin(keys[1])].astype({"method": str, "metric": str})
    lacking = missing.set_index(CELL[:3]).index.isin(other.set_index(CELL[:3]).index)
    missing["metric"] = missing["metric"].where(lacking, "all metrics")
    changes = []
    for (method, metric), rows in missing.groupby(["method", "metric"], sort=False):
        places, seeds = (", ".join(map(str, rows[name].unique())) for name in ("place", "seed"))
        size = f"not in the later run: {rows['scene'].nunique()} scenes, seeds {seeds}"
        changes.append(Change(GONE, places, method, metric, size))
    return changes


def endings(one: pd.DataFrame, other: pd.DataFrame) -> list[Change]:
    """Return cells, checks and stress tests that ended well in one run alone; each cell once."""
    both = one.merge(other, on=CELL, suffixes=("", "_other"))
    # Whatever the later run says.
    off = (both["value_other"] - both["expected"]).abs() > both["tolerance"]
    both.loc[off & (both["status_other"] == "ok"), ["status_other", "reason_other"]] = "failed", "off"
    # A cell that failed has one row, of a metric that it need not have where it ends well.
    cells = _worst(one).merge(_worst(other), on=CELL[:3], suffixes=("", "_other"))
    rows = pd.concat([both, cells], ignore_index=True)
    good, good_other = rows["status"] == "ok", rows["status_other"] == "ok"
    moved = rows[good != good_other].drop_duplicates([*CELL[:3], "status", "status_other"])
    return [
        Change(
            WORSE if row.status == "ok" else BETTER, row.scene, row.method, row.metric,
            f"{row.status} -> {row.status_other}, seed {row.seed}"
            + (f": {reason}" if (reason := row.reason_other or row.reason) else ""),
        )
        for row in moved.itertuples()
    ]  # fmt: skip


def _worst(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a row of each cell: one that is not ok, where there is one."""
    ordered = frame.iloc[(frame["status"] == "ok").argsort(kind="stable")]
    return ordered.drop_duplicates(CELL[:3])


GROUP = ["place", "method", "metric"]
NOT_OF_SCENES = ("name", "description", "steps")  # values of a preset that change no scene


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison of two runs.

    Attributes:
        changes: what is gone and worse first.
        compared: number of means.
        not_judged: number of means that differ and have one seed, or are times that were taken once.
    """

    changes: tuple[Change, ...]
    compared: int
    not_judged: int


def compare(
    one: Run,
    other: Run,
    metrics: str = "*",
    methods: str = "*",
    *,
    times: bool = True,
    shared: bool = False,
) -> Comparison:
    """Compare two runs.

    Args:
        one: the earlier run.
        other: the later run.
        metrics: patterns joined by commas.
        methods: likewise.
        times: compare run times and memory too.
        shared: leave out what the later run lacks; otherwise it is a change for the worse.

    Raises:
        ResultsError: where protocols differ, of the runs or of a cell, or presets, sizes, body or
            garment, nothing is shared, or a results.csv is not of its digest.
    """
    for run in (one, other):
        if "results.csv" in run.changed:
            raise ResultsError(
                "results.csv of A or B is not as its run wrote it: run.json has its digest"
            )
    one_protocol((one.protocol, other.protocol), "A and B")
    _demand_same_scenes(one, other)
    cells = [_cells(run) for run in (one, other)]
    frames = [frame[_matching(frame["method"], methods)] for frame in cells]
    ended = endings(*frames)
    of_metrics = [frame[_matching(frame["metric"], metrics)] for frame in frames]
    if not times or set(one.frame["hardware"]) != set(other.frame["hardware"]):
        machines = [m.name for run in (one, other) for m in run.metrics.values() if m.of == "machine"]
        of_metrics = [frame[~frame["metric"].isin(machines)] for frame in of_metrics]
    lost = [] if shared else gone(*of_metrics)
    keys = [frame.set_index(CELL).index for frame in of_metrics]
    kept = [frame[key.isin(rest)] for frame, key, rest in zip(of_metrics, keys, reversed(keys))]
    if kept[0].empty:
        raise ResultsError(
            "the two runs share no such scene, method, seed and metric: nothing to compare"
        )
    before, after = (frame.set_index(CELL)["protocol"] for frame in kept)
    differ = before[before != after.reindex(before.index)]
    if len(differ):
        place = " x ".join(map(str, differ.index[0][:2]))
        now = after[differ.index[0]]
        raise ResultsError(
            f"{place}: of protocol {differ.iloc[0]} in A, {now} in B: another reference or scene"
        )
    drawn = _of_one_seed(*of_metrics)
    alone = set(drawn[1]["method"])
    kept = [frame[~(frame["seeded"] & frame["method"].isin(alone))] for frame in kept]
    judged, compared, not_judged = _means(one, *_without_more_noise(*kept), basis=cells[0])
    earlier, later = _with_known_zero(one, *drawn, basis=cells[0])
    of_one_seed = changed_scenes(earlier, later, _metrics(one))
    order = (GONE, WORSE, BETTER, OTHER)
    changes = sorted(
        [*lost, *ended, *judged, *of_one_seed], key=lambda change: order.index(change.verdict)
    )
    return Comparison(tuple(changes), compared, not_judged)


def _of_one_seed(one: pd.DataFrame, other: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the usable rows, in scenes of both, of networks of which the later run alone has one seed.

    That seed is judged by the prediction interval of those of the earlier run.
    """
    rows = [frame[frame["seeded"] & frame["usable"] & (frame["case"] == "")] for frame in (one, other)]
    before, after = (frame.groupby("method", observed=True)["seed"].nunique() for frame in rows)
    alone = [name for name in after.index[after == 1] if before.get(name, 0) > 1]
    rows = [frame[frame["method"].isin(alone)] for frame in rows]
    keys = [frame.set_index(["scene", "method", "metric"]).index for frame in rows]
    return [frame[key.isin(rest)] for frame, key, rest in zip(rows, keys, reversed(keys))]


def _without_more_noise(one: pd.DataFrame, other: pd.DataFrame) -> list[pd.DataFrame]:
    """Return both; no answer of the later run is less certain than in the earlier: it would hide changes."""
    least = one.set_index(CELL)["uncertainty"].reindex(other.set_index(CELL).index).fillna(0.0).to_numpy()
    timed = other["unit"].isin(("s", "ms"))
    now = other["uncertainty"]
    return [one, other.assign(uncertainty=now.where(timed | (now <= least), least))]


def _demand_same_scenes(one: Run, other: Run) -> None:
    """Raise ResultsError where the runs differ in what makes their scenes, of entries that both have."""
    before, after = (_entries_of_scenes(run) for run in (one, other))
    for name in before:
        if name in after and before[name] != after[name]:
            values = f"{name.replace('_', ' ')} {before[name]} in A, {after[name]} in B"
            raise ResultsError(f"{values}: their numbers differ by design")


def _entries_of_scenes(run: Run) -> dict[str, Any]:
    """Return the entries OF_SCENES of a run, and the values of its preset each by its own name."""
    entries = {name: value for name in OF_SCENES if (value := run.config.get(name)) is not None}
    values = entries.pop("preset_values", {})
    return entries | {name: value for name, value in values.items() if name not in NOT_OF_SCENES}


def _cells(run: Run) -> pd.DataFrame:
    """Return each cell once, with its garment or scene, and the range of repeats as a time's uncertainty."""
    cases = run.frame[run.frame["case"] != ""].drop_duplicates(CELL)
    frame = pd.concat([run.cells(), cases], ignore_index=True)
    frame = frame[frame["status"] != "skipped"]
    worn = (frame["suite"] == "garments") & (frame["garment"] != "")
    frame = frame.assign(place=frame["garment"].where(worn, frame["scene"]))
    cell = ["scene", "method", "seed"]
    inference, repeats = (
        frame[frame["metric"] == name].set_index(cell)["value"] for name in (TIME, REPEATS)
    )
    timed = frame["metric"].isin((TIME, WHOLE))  # inference alone is repeated, its inputs are not
    apart = (inference * repeats / 100.0).reindex(pd.MultiIndex.from_frame(frame.loc[timed, cell]))
    frame.loc[timed, "uncertainty"] = apart.to_numpy()
    # Another run has another reference: uncertainties add up.
    return frame[frame["metric"] != REPEATS].drop(columns="moved")


def _matching(names: pd.Series, patterns: str) -> pd.Series:
    chosen = [n for n in names.unique() if any(fnmatchcase(n, p.strip()) for p in patterns.split(","))]
    return names.isin(chosen)


def _means(
    run: Run, one: pd.DataFrame, other: pd.DataFrame, *, basis: pd.DataFrame
) -> tuple[list[Change], int, int]:
    """Return changes, number of means, and number of those that differ and cannot be judged.

    basis: all rows of the earlier run, whatever methods and metrics are compared.
    """
    rows = _over_the_same(*_with_known_zero(run, one, other, basis=basis))
    first, second = (means(frame, *GROUP).to_dict() for frame in rows)
    differ = {key: (mean, second[key]) for key, mean in first.items() if mean.cells != second[key].cells}
    known = _metrics(run)
    scales = (
        rows[0].groupby(["place", "metric"])["value"].agg(lambda values: values.abs().median()).to_dict()
    )
    judged = [
        (place, method, metric := known[name], mean, new, _effect(metric, new, mean))
        for (place, method, name), (mean, new) in differ.items()
        if name != WORST and (not mean.seeded or mean.seeds > 1)
    ]
    p_values = [far.p_value() for *_, far in judged]
    corrected = iter(holm([p for p in p_values if p is not None]))
    changes, not_judged = [], len(differ) - len(judged)
    for (place, method, metric, mean, new, far), alone in zip(judged, p_values):
        p = None if alone is None else next(corrected)
        if within_tolerance(metric, mean, new, far, float(scales[place, metric.name])):
            continue
        if metric.of == "machine" and mean.uncertainty is None and mean.seeds < 2:
            if far.scale == RATIO and max(far.shown, 1.0 / far.shown) < ONCE:
                not_judged += 1
                continue
        elif not _beyond_noise(metric, far, p):
            continue
        size = size_of(metric, mean, new, far, p)
        changes.append(
            Change(side(metric, mean.value, new.value, far.value), place, method, metric.name, size)
        )
    reported = {(change.place, change.method, change.metric) for change in changes}
    worn = rows[0][rows[0]["place"] != rows[0]["scene"]]
    garments = dict(zip(worn["scene"], worn["place"]))
    before, after = (frame[frame["scene"].isin(garments)] for frame in rows)
    of_scenes = changed_scenes(before, after, known)
    changes += [c for c in of_scenes if (garments[c.place], c.method, c.metric) not in reported]
    return changes, len(first), not_judged


def _with_known_zero(run: Run, *frames: pd.DataFrame, basis: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the frames with relative excesses by the references of the basis in place of energies.

    Of energies whose zero is a choice, in scenes whose reference and skinning the basis has.
    """
    shares = []
    for frame in frames:
        for metric in (metric for metric in run.metrics.values() if metric.arbitrary_zero):
            frame = with_relative_excess(run, frame, metric.name, basis=basis)
            excess = frame[frame["metric"] == relative_metric(metric.name).name]
            covered = frame.set_index(CELL[:3]).index.isin(excess.set_index(CELL[:3]).index)
            frame = frame[~(covered & (frame["metric"] == metric.name))]
        shares.append(frame)
    return shares


def _metrics(run: Run) -> dict[str, Metric]:
    """Return the metrics of the run by name, with that of each energy's relative excess among them."""
    relative = (relative_metric(metric.name) for metric in run.metrics.values() if metric.arbitrary_zero)
    return {**{metric.name: metric for metric in relative}, **run.metrics}


def _effect(metric: Metric, new: Mean, before: Mean) -> Effect:
    """Compute the effect of a change; of relative excess in points, of which 100 are skinning's excess."""
    if metric.name.startswith("relative_excess/"):
        return effect(new, before, DIFFERENCE, unit=100.0)
    return effect(new, before, DIFFERENCE) if metric.arbitrary_zero else effect_of(metric, new, before)


def _beyond_noise(metric: Metric, far: Effect, p: float | None) -> bool:
    """Return whether a change is more than what another draw of seeds, or of times, would do."""
    if metric.of == "machine":
        low, high = far.ends or (far.value - far.uncertainty, far.value + far.uncertainty)
        return far.scale != RATIO or max(low, -high) > math.log1p(TIME_TOLERANCE)  # from 0, or to 0
    if p is None:
        return abs(far.above()) > SPREADS * far.uncertainty
    return abs(far.above()) > far.uncertainty and p < LEVEL


def _over_the_same(one: pd.DataFrame, other: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the usable rows of both, without cases, of scenes that have all seeds of their group."""
    rows = [frame[frame["usable"] & (frame["case"] == "")] for frame in (one, other)]
    keys = [frame.set_index(CELL).index for frame in rows]
    rows = [frame[key.isin(rest)] for frame, key, rest in zip(rows, keys, reversed(keys))]
    whole = [
        frame.groupby([*GROUP, "scene"])["seed"].transform("nunique")
        == frame.groupby(GROUP)["seed"].transform("nunique")
        for frame in rows
    ]
    return [frame[full] for frame, full in zip(rows, whole)]
