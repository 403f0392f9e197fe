"""Comparison of two runs: changes of means beyond the noise of both, and what is gone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEVEL, one_protocol
from benchmarks.results.row import USABLE, ResultsError
from benchmarks.results.run_folder import OF_SCENES
from reports.finished_run import Run
from reports.scene_changes import (
    BETTER,
    GONE,
    OTHER,
    SPREADS,
    TIME_TOLERANCE,
    WORSE,
    Change,
    compare_scenes,
    is_negligible,
    side,
    size_of,
)
from reports.statistics.effects import DIFFERENCE, RATIO, Effect, effect
from reports.statistics.means_and_spreads import Mean, means, value_of
from reports.statistics.pareto import NETWORK, REPEATS, TIME, WHOLE, select_timed
from reports.statistics.relative_excess import RELATIVE_EXCESS, add_excess, excess_of, relative_metric
from reports.statistics.verdicts import effect_of, holm
from reports.tables.table import DASH, number

# Factor of a time that was taken once: below it another load of the machine may be the cause.
ONCE = 2.0
# The time of one frame, which anything else on the machine may have delayed.
WORST = "cost/frame_worst"
CELL = ["scene", "method", "seed", "metric"]


def _intersect(frames: Sequence[pd.DataFrame], *columns: str) -> list[pd.DataFrame]:
    """Return the rows of both frames whose values in these columns the other has too."""
    keys = [frame.set_index(list(columns)).index for frame in frames]
    return [frame[key.isin(rest)] for frame, key, rest in zip(frames, keys, reversed(keys))]


def find_losses(one: pd.DataFrame, other: pd.DataFrame) -> list[Change]:
    """Return a line for each method or metric that the later run lacks somewhere."""
    keys = [frame.set_index(CELL).index for frame in (one, other)]
    losses = one[one["usable"] & ~keys[0].isin(keys[1])].astype({"method": str, "metric": str})
    cells = losses.set_index(CELL[:3]).index
    present = cells.isin(other.set_index(CELL[:3]).index)
    losses["metric"] = losses["metric"].where(present, "all metrics")
    # `endings` reports cells that were ok and failed.
    failed = other[~other["status"].isin(USABLE)].set_index(CELL[:3]).index
    losses = losses[~cells.isin(failed) | (losses["status"] != "ok")]
    changes = []
    for (method, metric), rows in losses.groupby(["method", "metric"], sort=False):
        places, seeds = (", ".join(map(str, rows[name].unique())) for name in ("place", "seed"))
        size = f"not in the later run: {rows['scene'].nunique()} scenes, seeds {seeds}"
        changes.append(Change(GONE, places, method, metric, size))
    return changes


def endings(one: pd.DataFrame, other: pd.DataFrame) -> list[Change]:
    """Return cells, checks and stress tests that ended well in one run alone; each cell once."""
    pairs = one.merge(other, on=CELL, suffixes=("", "_other"))
    # Whatever the later run says; an engine that was off before violates a law, which is a result.
    off, was_off = (
        ((pairs[f"value{end}"] - pairs["expected"]).abs() > pairs["tolerance"])
        & (pairs[f"status{end}"] == "ok")
        for end in ("_other", "")
    )
    pairs.loc[off & ~was_off, ["status_other", "reason_other"]] = "failed", "off"
    # A cell that failed has one row, of a metric that it need not have where it ends well.
    cells = _pick_worst(one).merge(_pick_worst(other), on=CELL[:3], suffixes=("", "_other"))
    rows = pd.concat([pairs, cells], ignore_index=True)
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


def _find_fallen(run: Run, frames: Sequence[pd.DataFrame], basis: pd.DataFrame) -> list[Change]:
    """Return roll-outs that are worn in one run alone: those that fell off have no excess."""
    ends = []
    for frame in frames:
        rows = add_excess(run, frame, basis=basis)
        rows = rows[rows["metric"] == RELATIVE_EXCESS.name]
        status = rows["usable"].map({True: "ok", False: "failed"})
        ends.append(rows.assign(status=status, reason="fell off the body"))
    return endings(*ends)


def _pick_worst(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a row of each cell: one that is not ok, where there is one."""
    ordered = frame.iloc[(frame["status"] == "ok").argsort(kind="stable")]
    return ordered.drop_duplicates(CELL[:3])


GROUP = ["place", "method", "metric"]
# Values of a preset that change no scene.
NOT_OF_SCENES = ("name", "description", "steps", "simulated_mixed", "clips_by", "turns")


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison of two runs.

    Attributes:
        changes: what is gone and worse first.
        compared: number of means that were judged.
        headline: method -> for each metric of HEADLINE both means with the verdict, SNUG first.
    """

    changes: tuple[Change, ...]
    compared: int
    headline: dict[str, list[str]]


def compare(
    one: Run,
    other: Run,
    metrics: str = "*",
    methods: str = "*",
    *,
    times: bool = True,
    shared: bool = False,
) -> Comparison:
    """Compare the earlier run with the other.

    metrics, methods: patterns joined by commas. times: compare run times and memory too. shared: leave out
    what the later run lacks; otherwise it is a change for the worse.

    Raises:
        ResultsError: where protocols differ, of the runs or of a cell, or presets, sizes, body or
            garment, nothing is shared, or a results.csv is not of its digest.
    """
    for name, run in (("A", one), ("B", other)):
        if "results.csv" in run.changed:
            raise ResultsError(
                f"results.csv of {name} is not as its run wrote it: run.json has its digest"
            )
    one_protocol((one.protocol, other.protocol), "A and B")
    _check_scenes(one, other)
    cells = [_cells(run) for run in (one, other)]
    frames = [frame[_match(frame["method"], methods)] for frame in cells]
    of_cells = [*endings(*frames), *_find_fallen(one, frames, cells[0])]
    names = metrics.replace("relative_excess/", "energy/")  # of which changes of those are made
    of_metrics = [frame[_match(frame["metric"], names)] for frame in frames]
    if not times or set(one.frame["hardware"]) != set(other.frame["hardware"]):
        machines = [m.name for run in (one, other) for m in run.metrics.values() if m.of == "machine"]
        of_metrics = [frame[~frame["metric"].isin(machines)] for frame in of_metrics]
    losses = [] if shared else find_losses(of_metrics[0], frames[1])
    pair = _intersect(of_metrics, *CELL)
    if pair[0].empty:
        raise ResultsError(
            "the two runs share no such scene, method, seed and metric: nothing to compare"
        )
    before, after = (frame.set_index(CELL)["protocol"] for frame in pair)
    clashes = before[before != after.reindex(before.index)]
    if len(clashes):
        place = " x ".join(map(str, clashes.index[0][:2]))
        protocol = after[clashes.index[0]]
        raise ResultsError(
            f"{place}: of protocol {clashes.iloc[0]} in A, {protocol} in B: another reference or scene"
        )
    places = pair[0].set_index(CELL)["place"]
    pair[1] = pair[1].assign(place=places.reindex(pair[1].set_index(CELL).index).to_numpy())
    lone_seeds = _find_lone_seeds(*of_metrics)
    networks = set(lone_seeds[1]["method"])
    pair = [frame[~(frame["seeded"] & frame["method"].isin(networks))] for frame in pair]
    of_means, count = _means(one, *_cap_noise(*pair), basis=cells[0])
    excesses = _replace_energies(one, *lone_seeds, basis=cells[0])
    earlier, later = _intersect([f[f["usable"]] for f in excesses], "scene", "method", "metric")
    of_one_seed = compare_scenes(earlier, later, _metrics(one))
    order = (GONE, WORSE, BETTER, OTHER)
    changes = sorted([*losses, *of_cells, *of_means, *of_one_seed], key=lambda c: order.index(c.verdict))
    return Comparison(tuple(changes), count, _headline(one, of_metrics, changes))


HEADLINE = (
    RELATIVE_EXCESS.name, "dynamics/correlation", "penetration/surface", "curvature/histogram", WHOLE,
)  # fmt: skip


def _headline(
    run: Run, frames: Sequence[pd.DataFrame], changes: Sequence[Change]
) -> dict[str, list[str]]:
    """Return the rows of Comparison.headline, on the scenes of the first garment that both runs have.

    Run times are of the scenes that page one has them of.
    """
    garment, (_, clips) = run.first_garment, select_timed(run, run.frame)
    usable = [f[f["usable"] & (f["case"] == "")] for f in frames]
    rows, clip_rows = (
        _intersect([f[f[column].isin(names)] for f in usable], "scene", "method", "metric")
        for column, names in (("place", [garment]), ("scene", clips))
    )
    names = run.order(set(rows[0]["method"]) - run.twins - set(run.with_role("reference-variant")))
    headline = {}
    for method in sorted(names, key=lambda name: name != NETWORK):
        seeds = [set(f[(f["method"] == method) & f["seeded"]]["seed"]) for f in rows]
        judged = not seeds[0] or len(seeds[0] & seeds[1]) > 1 or len(seeds[0]) > len(seeds[1]) == 1
        verdict = "same" if judged else "one seed" if len(seeds[0]) == 1 else "other seeds"
        cells = []
        for metric in HEADLINE:
            pair = clip_rows if metric == WHOLE and clips else rows
            before, after = (_value(run, frame, method, metric) for frame in pair)
            verdicts = {c.place: c.verdict for c in changes if (c.method, c.metric) == (method, metric)}
            scenes = " and ".join(sorted({f"{change} in a scene" for change in verdicts.values()}))
            note = verdicts.get(garment) or scenes or verdict
            has_entry = before is not None and (after is not None or bool(verdicts))
            cells.append(f"{number(before)} → {number(after)} {note}" if has_entry else DASH)
        if set(cells) != {DASH}:
            headline[method] = cells
    return headline


def _value(run: Run, rows: pd.DataFrame, method: str, metric: str) -> float | None:
    """Return a mean as page one has it: of relative excess the typical one."""
    if metric != RELATIVE_EXCESS.name:
        return value_of(rows, method, metric)
    excess = excess_of(run, rows, method) if method != run.reference else None
    return excess.typical if excess else None


def _find_lone_seeds(one: pd.DataFrame, other: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the usable rows, in scenes of both, of networks of which the later run alone has one seed.

    That seed is judged by the prediction interval of those of the earlier run.
    """
    rows = [frame[frame["seeded"] & frame["usable"] & (frame["case"] == "")] for frame in (one, other)]
    before, after = (frame.groupby("method", observed=True)["seed"].nunique() for frame in rows)
    networks = [name for name in after.index[after == 1] if before.get(name, 0) > 1]
    rows = [frame[frame["method"].isin(networks)] for frame in rows]
    return _intersect(rows, "scene", "method", "metric")


def _cap_noise(one: pd.DataFrame, other: pd.DataFrame) -> list[pd.DataFrame]:
    """Return both; no later answer is less certain than the earlier, which would hide changes."""
    cap = one.set_index(CELL)["uncertainty"].reindex(other.set_index(CELL).index).fillna(0.0).to_numpy()
    timed = other["unit"].isin(("s", "ms"))
    noise = other["uncertainty"]
    return [one, other.assign(uncertainty=noise.where(timed | (noise <= cap), cap))]


def _check_scenes(one: Run, other: Run) -> None:
    """Raise ResultsError where an entry of both that makes their scenes differs."""
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
    is_garment = (frame["suite"] == "garments") & (frame["garment"] != "")
    frame = frame.assign(place=frame["garment"].where(is_garment, frame["scene"]))
    inference, repeats = (
        frame[frame["metric"] == name].set_index(CELL[:3])["value"] for name in (TIME, REPEATS)
    )
    timed = frame["metric"].isin((TIME, WHOLE))  # inference alone is repeated, its inputs are not
    places = pd.MultiIndex.from_frame(frame.loc[timed, CELL[:3]])
    ranges = (inference * repeats / 100.0).reindex(places)
    frame.loc[timed, "uncertainty"] = ranges.to_numpy()
    # Another run has another reference: uncertainties add up.
    return frame[frame["metric"] != REPEATS].drop(columns="moved")


def _match(names: pd.Series, patterns: str) -> pd.Series:
    hits = [n for n in names.unique() if any(fnmatchcase(n, p.strip()) for p in patterns.split(","))]
    return names.isin(hits)


def _means(
    run: Run, one: pd.DataFrame, other: pd.DataFrame, *, basis: pd.DataFrame
) -> tuple[list[Change], int]:
    """Return changes, and the number of means that were judged.

    basis: all rows of the earlier run, whatever methods and metrics are compared.
    """
    rows = _select_common(*_replace_energies(run, one, other, basis=basis))
    first, second = (means(frame, *GROUP).to_dict() for frame in rows)
    earlier_means = {
        key: mean for key, mean in first.items()
        if key[-1] != WORST and (not mean.seeded or mean.seeds > 1)
    }  # fmt: skip
    metrics = _metrics(run)
    sizes = rows[0]["value"].abs().groupby([rows[0]["place"], rows[0]["metric"]])
    scales = sizes.median().to_dict()
    candidates = [
        (place, method, metric := metrics[name], mean, new_mean, _effect(metric, new_mean, mean))
        for (place, method, name), mean in earlier_means.items()
        if mean.cells != (new_mean := second[place, method, name]).cells
    ]
    p_values = [shift.p_value() for *_, shift in candidates]
    corrected = iter(holm([p for p in p_values if p is not None]))
    changes = []
    for (place, method, metric, mean, new_mean, shift), raw_p in zip(candidates, p_values):
        p = None if raw_p is None else next(corrected)
        if is_negligible(metric, mean, new_mean, shift, float(scales[place, metric.name])):
            continue
        if metric.of == "machine" and mean.uncertainty is None and mean.seeds < 2:
            if shift.scale == RATIO and max(shift.shown, 1.0 / shift.shown) < ONCE:
                continue
        elif not _exceeds_noise(metric, shift, p):
            continue
        size = size_of(metric, mean, new_mean, shift, p)
        verdict = side(metric, mean.value, new_mean.value, shift.value)
        changes.append(Change(verdict, place, method, metric.name, size))
    reported = {(c.place, c.method, c.metric) for c in changes}
    pairs = rows[0][rows[0]["place"] != rows[0]["scene"]]
    garments = dict(zip(pairs["scene"], pairs["place"]))
    before, after = (frame[frame["scene"].isin(garments)] for frame in rows)
    of_scenes = compare_scenes(before, after, metrics)
    changes += [c for c in of_scenes if (garments[c.place], c.method, c.metric) not in reported]
    return changes, len(earlier_means)


def _replace_energies(run: Run, *frames: pd.DataFrame, basis: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the frames with relative excesses by the references of the basis in place of energies.

    Of energies whose zero is a choice, in scenes whose reference and skinning the basis has.
    """
    shares = []
    names = [metric.name for metric in run.metrics.values() if metric.arbitrary_zero]
    energies = {relative_metric(name).name: name for name in names}
    for frame in frames:
        for energy in energies.values():
            frame = add_excess(run, frame, energy, basis=basis)
        excess = frame[frame["metric"].isin(energies)]
        covered = excess.assign(metric=excess["metric"].map(energies)).set_index(CELL).index
        shares.append(frame[~frame.set_index(CELL).index.isin(covered)])
    return shares


def _metrics(run: Run) -> dict[str, Metric]:
    """Return the metrics of the run by name, those of relative excess among them."""
    relative = (relative_metric(m.name) for m in run.metrics.values() if m.arbitrary_zero)
    return {**{m.name: m for m in relative}, **run.metrics}


def _effect(metric: Metric, now: Mean, before: Mean) -> Effect:
    """Compute the effect of a change; of relative excess in points."""
    if metric.name.startswith("relative_excess/"):
        return effect(now, before, DIFFERENCE, unit=100.0)
    return effect(now, before, DIFFERENCE) if metric.arbitrary_zero else effect_of(metric, now, before)


def _exceeds_noise(metric: Metric, shift: Effect, p: float | None) -> bool:
    """Return whether a change is more than what another draw of seeds, or of times, would do."""
    if metric.of == "machine":
        low, high = shift.ends or (shift.value - shift.uncertainty, shift.value + shift.uncertainty)
        return shift.scale != RATIO or max(low, -high) > math.log1p(TIME_TOLERANCE)  # from 0, or to 0
    if p is None:
        return abs(shift.value) > SPREADS * shift.uncertainty
    return abs(shift.value) > shift.uncertainty and p < LEVEL


def _select_common(one: pd.DataFrame, other: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the usable rows of both, without cases, of scenes that have all seeds of their group."""

    def count_seeds(frame: pd.DataFrame, *keys: str) -> pd.Series:
        return frame.groupby([*keys])["seed"].transform("nunique")

    rows = _intersect([f[f["usable"] & (f["case"] == "")] for f in (one, other)], *CELL)
    return [f[count_seeds(f, *GROUP, "scene") == count_seeds(f, *GROUP)] for f in rows]
