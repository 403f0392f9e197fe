"""python -m reports.compare A B: changes from run A to run B beyond the noise of both; fails if worse.

Only cells that both runs have are compared: the same scene, method and seed. Suite garments is compared by
garment, over its motions and seeds; every other scene by itself, over its seeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import pandas as pd

from benchmarks.results.json_file import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command.command_line import Parser, command
from reports.run.finished_run import SUITES, Metric, Run
from reports.run.reading import read_run
from reports.statistics.effects import DIFFERENCE, LEVEL, RATIO, Effect, effect
from reports.statistics.means_and_spreads import Mean, means
from reports.statistics.pareto import MOST_SLACK, REPEATS, TIME, WHOLE
from reports.statistics.relative_excess import relative_metric, with_relative_excess
from reports.statistics.verdicts import effect_of, holm
from reports.tables.number_texts import number, with_spread

CELL = ["scene", "method", "seed", "metric"]
GROUP = ["place", "method", "metric"]
WORSE, BETTER, OTHER = "worse", "better", "changed"
EXAMPLES = """examples:
  python -m reports.compare before after
  python -m reports.compare before after --metrics 'energy/*,curvature/*' --methods snug
  python -m reports.compare before after --without-times         beside other work on the machine

What counts as a change:
  a mean   p below 0.05, corrected by Holm for all means compared, the 95 % interval not within 5 % of
           equality, and more than the uncertainties of both runs together (column uncertainty; of run
           times, the range of repeats). Where nothing was repeated, 5 % decide in place of p. Of total and
           gravity, whose zero is a choice, 5 % are of what skinning has more than the simulation.
  a time   so, and all of the interval beyond 20 %, on the same hardware, and only where it was repeated;
           memory likewise.
  a check  one that passed fails, or the other way round; so with stress tests, whatever --metrics says.
  a cell   one that came to its end no longer does, or the other way round; likewise.
A network with one seed in common is not judged: how far another seed moves it is unknown. A metric's
declaration says which side is worse; a metric without a better side is at most changed.
exit status: 0 nothing got worse; 1 something did; 2 a folder is no run, or the two share nothing."""


@dataclass(frozen=True)
class Change:
    """One line of the comparison: verdict, garment or scene, method, metric, and size of the change."""

    verdict: str
    place: str
    method: str
    metric: str
    size: str


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison of two runs.

    changes: worse ones first. compared: number of means. one_seed: number of means that differ and cannot be
    judged, for they have one seed. only_one, only_other: cells that the other run lacks.
    """

    changes: tuple[Change, ...]
    compared: int
    one_seed: int
    only_one: int
    only_other: int


def compare(
    one: Run, other: Run, metrics: str = "*", methods: str = "*", *, times: bool = True
) -> Comparison:
    """Compare all that both runs have.

    Args:
        one: the earlier run.
        other: the later run.
        metrics: patterns joined by commas.
        methods: likewise.
        times: compare run times and memory too.

    Raises:
        ResultsError: where the presets differ or nothing is shared.
    """
    presets = [run.config.get("preset") for run in (one, other)]
    if presets[0] != presets[1]:
        raise ResultsError(f"A is of preset {presets[0]}, B of {presets[1]}: their numbers differ by design")
    frames = [_chosen(run, methods) for run in (one, other)]
    endings = _endings(*frames)
    keys = [frame.set_index(CELL).index for frame in frames]
    frames = [frame[key.isin(rest)] for frame, key, rest in zip(frames, keys, reversed(keys))]
    same = set(one.frame["hardware"]) == set(other.frame["hardware"])
    kept = [frame[_matching(frame["metric"], metrics)] for frame in frames]
    machines = [
        metric.name for run in (one, other) for metric in run.metrics.values() if metric.of == "machine"
    ]
    kept = [frame if times and same else frame[~frame["metric"].isin(machines)] for frame in kept]
    if kept[0].empty:
        raise ResultsError("the two runs share no such scene, method, seed and metric: nothing to compare")
    judged, compared, one_seed = _means(one, *kept)
    order = (WORSE, BETTER, OTHER)
    changes = sorted([*endings, *judged], key=lambda change: order.index(change.verdict))
    unshared = [len(key.difference(rest)) for key, rest in zip(keys, reversed(keys))]
    return Comparison(tuple(changes), compared, one_seed, *unshared)


def _chosen(run: Run, methods: str) -> pd.DataFrame:
    """Return each cell once, with its garment or scene, and the range of repeats as a time's uncertainty."""
    cases = run.frame[run.frame["case"] != ""].drop_duplicates(CELL)
    frame = pd.concat([run.cells(*SUITES), cases], ignore_index=True)
    frame = frame[(frame["status"] != "skipped") & _matching(frame["method"], methods)]
    worn = (frame["suite"] == "garments") & (frame["garment"] != "")
    frame = frame.assign(place=frame["garment"].where(worn, frame["scene"]))
    cell = ["scene", "method", "seed"]
    repeats = frame[frame["metric"] == REPEATS].set_index(cell)["value"] / 100.0
    timed = frame["metric"].isin((TIME, WHOLE))
    apart = repeats.reindex(pd.MultiIndex.from_frame(frame.loc[timed, cell])).to_numpy()
    frame.loc[timed, "uncertainty"] = frame.loc[timed, "value"] * apart
    # Another run has another reference ensemble: uncertainties add up.
    return frame[frame["metric"] != REPEATS].drop(columns="moved")


def _matching(names: pd.Series, patterns: str) -> pd.Series:
    chosen = [n for n in names.unique() if any(fnmatchcase(n, p.strip()) for p in patterns.split(","))]
    return names.isin(chosen)


def _endings(one: pd.DataFrame, other: pd.DataFrame) -> list[Change]:
    """Find cells, checks and stress tests that ended well in one run alone; each cell once."""
    both = one.merge(other, on=CELL, suffixes=("", "_other"))
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


def _means(run: Run, *frames: pd.DataFrame) -> tuple[list[Change], int, int]:
    """Return changes of means beyond noise, how many were compared, and how many of one seed differ."""
    first, second = (means(frame, *GROUP) for frame in _over_the_same(*_with_known_zero(run, *frames)))
    differ = {key: (mean, second[key]) for key, mean in first.items() if mean.cells != second[key].cells}
    known = _metrics(run)
    judged = [
        (place, method, metric := known[name], mean, new, _effect(metric, new, mean))
        for (place, method, name), (mean, new) in differ.items()
        if not mean.seeded or mean.seeds > 1
    ]
    p_values = [far.p_value() for *_, far in judged]
    corrected = iter(holm([p for p in p_values if p is not None]))
    changes = []
    for (place, method, metric, mean, new, far), alone in zip(judged, p_values):
        p = None if alone is None else next(corrected)
        if _beyond_noise(far, p) and not (metric.of == "machine" and _machine(mean, far)):
            verdict = _side(metric, far)
            changes.append(Change(verdict, place, method, metric.name, _size(metric, mean, new, far, p)))
    return changes, len(first), len(differ) - len(judged)


def _with_known_zero(run: Run, *frames: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the frames with relative excesses by the first one's references in place of energies.

    Of energies whose zero is a choice, in scenes whose reference and skinning the first frame has.
    """
    made = []
    for frame in frames:
        for metric in (metric for metric in run.metrics.values() if metric.arbitrary_zero):
            frame = with_relative_excess(run, frame, metric.name, basis=frames[0])
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


def _beyond_noise(far: Effect, p: float | None) -> bool:
    """Return whether a change is neither within the margin nor what another draw of seeds would do."""
    if far.equal() or abs(far.above()) <= (far.margin if p is None else far.uncertainty):
        return False
    return p is None or p < LEVEL


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


def _machine(mean: Mean, far: Effect) -> bool:
    """Return whether a change of time or memory may be the machine's: not repeated, or within MOST_SLACK."""
    if mean.uncertainty is None and mean.seeds < 2:
        return True
    low, high = far.interval or (far.shown, far.shown)
    return far.scale != RATIO or (low < 1.0 + MOST_SLACK and high > 1.0 / (1.0 + MOST_SLACK))


def _side(metric: Metric, far: Effect) -> str:
    if metric.lower_is_better is None:
        return OTHER
    return WORSE if (far.value > 0.0) is metric.lower_is_better else BETTER


def _size(metric: Metric, mean: Mean, new: Mean, far: Effect, p: float | None) -> str:
    """Return a change as "0.21 ± 0.010 -> 0.26 ± 0.010 J, × 1.24 (1.20 to 1.28), p 0.0030"."""
    unit = "" if metric.unit in ("", "1") else f" {metric.unit}"
    before, after = (with_spread(m.value, m.spread_or_uncertainty) for m in (mean, new))
    text = f"{before} -> {after}{unit}, {'×' if far.scale == RATIO else 'by'} {number(far.shown)}"
    if far.interval:
        text += f" ({' to '.join(number(end) for end in far.interval)})"
    return text + ("" if p is None else f", p {number(p, 2)}")


@command("reports.compare")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.compare",
        description="Find changes between two runs beyond the noise of both; fail if results got worse.",
        epilog=EXAMPLES,
    )
    parser.add_argument("one", metavar="A", help="folder of the earlier run")
    parser.add_argument("other", metavar="B", help="folder of the later run")
    for name in ("metrics", "methods"):
        parser.add_argument(f"--{name}", metavar="NAME,...", default="*", help="only these (patterns)")
    parser.add_argument("--without-times", action="store_true", help="neither run times nor memory")
    options = parser.parse_args(arguments)
    runs = [read_run(RunFolder(path)) for path in (options.one, options.other)]
    comparison = compare(runs[0], runs[1], options.metrics, options.methods, times=not options.without_times)
    for change in comparison.changes:
        print(f"{change.verdict:8}{change.place}  {change.method}  {change.metric}  {change.size}")
    print("\n".join(_summary(comparison, runs)))
    return 1 if any(change.verdict == WORSE for change in comparison.changes) else 0


def _summary(comparison: Comparison, runs: Sequence[Run]) -> Iterator[str]:
    counts = [f"{sum(c.verdict == v for c in comparison.changes)} {v}" for v in (WORSE, BETTER, OTHER)]
    yield f"{comparison.compared} means compared: {', '.join(counts)}."
    if count := comparison.one_seed:
        yield f"Not judged: {count} means differ that have one seed; run both with --seeds 0,1,2."
    if comparison.only_one or comparison.only_other:
        yield f"Not compared: {comparison.only_one} numbers of A alone, {comparison.only_other} of B alone."
    machines = [", ".join(sorted(set(run.frame["hardware"]))) for run in runs]
    if machines[0] != machines[1]:
        yield f"No times compared: A ran on {machines[0]}, B on {machines[1]}."


if __name__ == "__main__":
    raise SystemExit(main())
