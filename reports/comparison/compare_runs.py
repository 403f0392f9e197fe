"""Comparison of two runs: means of garments, single scenes, times, what is gone, what ended otherwise."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import pandas as pd

from benchmarks.metric import Metric
from benchmarks.results.protocol import LEVEL, one_protocol
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import OF_SCENES
from reports.comparison.change import (
    BETTER,
    GONE,
    ONCE,
    OTHER,
    SPREADS,
    TIME_TOLERANCE,
    WORSE,
    Change,
    side,
    size_of_means,
    within_tolerance,
)
from reports.comparison.gone import CELL, endings, gone
from reports.comparison.scenes import changed_scenes
from reports.run.finished_run import Run
from reports.statistics.effects import DIFFERENCE, RATIO, Effect, effect
from reports.statistics.means_and_spreads import Mean, means
from reports.statistics.pareto import REPEATS, TIME, WHOLE
from reports.statistics.relative_excess import relative_metric, with_relative_excess
from reports.statistics.verdicts import effect_of, holm

GROUP = ["place", "method", "metric"]
NOT_OF_SCENES = ("name", "description", "steps")  # values of a preset that change no scene


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison of two runs.

    Attributes:
        changes: what is gone and worse first.
        compared: number of means.
        one_seed: number of means that differ and cannot be judged, for they have one seed.
        taken_once: method -> number of its times that differ and cannot be judged, for they were taken once.
        added: number of values of the later run alone.
    """

    changes: tuple[Change, ...]
    compared: int
    one_seed: int
    taken_once: dict[str, int]
    added: int


def compare(
    one: Run, other: Run, metrics: str = "*", methods: str = "*", *, times: bool = True, shared: bool = False
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
        ResultsError: where protocols differ, of the runs or of a cell, or presets, sizes, body or garment, or
            nothing is shared.
    """
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
    added = len(keys[1].difference(keys[0]))
    kept = [frame[key.isin(rest)] for frame, key, rest in zip(of_metrics, keys, reversed(keys))]
    if kept[0].empty:
        raise ResultsError("the two runs share no such scene, method, seed and metric: nothing to compare")
    before, after = (frame.set_index(CELL)["protocol"] for frame in kept)
    differ = before[before != after.reindex(before.index)]
    if len(differ):
        place = " x ".join(map(str, differ.index[0][:2]))
        now = after[differ.index[0]]
        raise ResultsError(
            f"{place}: of protocol {differ.iloc[0]} in A, {now} in B: another reference or scene"
        )
    judged, compared, one_seed, once = _means(one, *kept, basis=cells[0])
    order = (GONE, WORSE, BETTER, OTHER)
    changes = sorted([*lost, *ended, *judged], key=lambda change: order.index(change.verdict))
    return Comparison(tuple(changes), compared, one_seed, once, added)


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
    inference, repeats = (frame[frame["metric"] == name].set_index(cell)["value"] for name in (TIME, REPEATS))
    timed = frame["metric"].isin((TIME, WHOLE))  # inference alone is repeated, its inputs are not
    apart = (inference * repeats / 100.0).reindex(pd.MultiIndex.from_frame(frame.loc[timed, cell]))
    frame.loc[timed, "uncertainty"] = apart.to_numpy()
    # Another run has another reference ensemble: uncertainties add up.
    return frame[frame["metric"] != REPEATS].drop(columns="moved")


def _matching(names: pd.Series, patterns: str) -> pd.Series:
    chosen = [n for n in names.unique() if any(fnmatchcase(n, p.strip()) for p in patterns.split(","))]
    return names.isin(chosen)


def _means(
    run: Run, one: pd.DataFrame, other: pd.DataFrame, *, basis: pd.DataFrame
) -> tuple[list[Change], int, int, dict[str, int]]:
    """Return changes, number of means, of those of one seed that differ, and times taken once by method.

    basis: all rows of the earlier run, whatever methods and metrics are compared.
    """
    rows = _over_the_same(*_with_known_zero(run, one, other, basis=basis))
    first, second = (means(frame, *GROUP).to_dict() for frame in rows)
    differ = {key: (mean, second[key]) for key, mean in first.items() if mean.cells != second[key].cells}
    known = _metrics(run)
    scales = rows[0].groupby(["place", "metric"])["value"].agg(lambda values: values.abs().median()).to_dict()
    judged = [
        (place, method, metric := known[name], mean, new, _effect(metric, new, mean))
        for (place, method, name), (mean, new) in differ.items()
        if not mean.seeded or mean.seeds > 1
    ]
    p_values = [far.p_value() for *_, far in judged]
    corrected = iter(holm([p for p in p_values if p is not None]))
    changes, once = [], Counter[str]()
    for (place, method, metric, mean, new, far), alone in zip(judged, p_values):
        p = None if alone is None else next(corrected)
        if within_tolerance(metric, mean, new, far, float(scales[place, metric.name])):
            continue
        if metric.of == "machine" and mean.uncertainty is None and mean.seeds < 2:
            if far.scale == RATIO and max(far.shown, 1.0 / far.shown) < ONCE:
                once[method] += 1
                continue
        elif not _beyond_noise(metric, far, p):
            continue
        size = size_of_means(metric, mean, new, far, p)
        changes.append(Change(side(metric, far.value), place, method, metric.name, size))
    reported = {(change.place, change.method, change.metric) for change in changes}
    worn = rows[0][rows[0]["place"] != rows[0]["scene"]]
    garments = dict(zip(worn["scene"], worn["place"]))
    before, after = (frame[frame["scene"].isin(garments)] for frame in rows)
    of_scenes = changed_scenes(before, after, known)
    changes += [c for c in of_scenes if (garments[c.place], c.method, c.metric) not in reported]
    return changes, len(first), len(differ) - len(judged), dict(once)


def _with_known_zero(run: Run, *frames: pd.DataFrame, basis: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the frames with relative excesses by the references of the basis in place of energies.

    Of energies whose zero is a choice, in scenes whose reference and skinning the basis has.
    """
    made = []
    for frame in frames:
        for metric in (metric for metric in run.metrics.values() if metric.arbitrary_zero):
            frame = with_relative_excess(run, frame, metric.name, basis=basis)
            excess = frame[frame["metric"] == relative_metric(metric.name).name]
            covered = frame.set_index(CELL[:3]).index.isin(excess.set_index(CELL[:3]).index)
            frame = frame[~(covered & (frame["metric"] == metric.name))]
        made.append(frame)
    return made


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
