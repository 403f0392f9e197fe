"""What error against run time comes to, in words from the numbers, whichever way they come out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from benchmarks.results import Row
from reports import palette
from reports.break_even import Cost, compared_scenes, cost_of, crossing, frames_text, rivals
from reports.fronts import TIME, Point, fastest, front, hybrids, points_of, solvers
from reports.numbers import duration, number
from reports.summary import Measurements, dressed_scenes, speed_measurements, wardrobe
from reports.table import Cell, Column, Table

NETWORK = "snug"
ERRORS = (("gap/relative", "energy gap", ""), ("curvature/error", "mean-curvature error", " 1/m"))


def answers(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """(question, sentences): where SNUG wins, what beats it, whether hybrids do, when training pays."""
    measured = speed_measurements(rows)
    garments = wardrobe(measured.only(compared_scenes(measured)))

    def told(say: Callable[[Sequence[str]], str]) -> str:
        """Of each garment by itself; named where there are several."""
        said = {garment: words for garment, scenes in garments.items() if (words := say(scenes))}
        several = len(garments) > 1
        return " ".join(f"{garment}: {words}" if several else words for garment, words in said.items())

    return [
        ("Run time", run_time(measured)),
        ("Where SNUG wins", told(lambda scenes: _per_error(measured, scenes, _unbeaten))),
        ("A few iterations", told(lambda scenes: _per_error(measured, scenes, _cut_solver))),
        ("Network plus solver", told(lambda scenes: _per_error(measured, scenes, _hybrid))),
        ("When training pays", told(lambda scenes: training_pays(measured, scenes))),
    ]


def by_scene(rows: Sequence[Row]) -> Table | None:
    """The same questions on each scene by itself and for each measure of error, as names and numbers."""
    measured = speed_measurements(rows)
    lines: list[tuple[Cell, ...]] = []
    for scene in compared_scenes(measured):
        for metric, words, _ in ERRORS:
            points = points_of(measured, [scene], metric)
            own = next((p for p in points if p.method == NETWORK), None)
            if own is not None:
                lines.append((scene, words, own.error, own.time, *_names(measured, scene, points, own)))
    if not lines:
        return None
    columns = (
        Column("scene", "Scene"),
        Column("measure", "Error"),
        Column("own", "SNUG's"),
        Column("run_time", "Frame", "ms"),
        Column("beaten", "Beaten by"),
        Column("solver", "Fastest solver as good"),
        Column("hybrid", "Fastest hybrid better"),
        Column("pays_reference", "Pays", "frames"),
        Column("pays_solver", "Against solver", "frames"),
    )
    return Table("answers", columns, tuple(lines))


def _names(measured: Measurements, scene: str, points: Sequence[Point], own: Point) -> tuple[Cell, ...]:
    better, solver = beaten_by(points, own), fastest(cut_solvers(points), own.error)
    mixed = [p for p in hybrids(points) if p.error < own.error and not overtaken(p, solvers(points))]
    hybrid = min(mixed, key=lambda p: p.time) if mixed else None
    network = cost_of(measured, NETWORK, [scene])
    pays: list[Cell] = []
    for rival in (palette.REFERENCE, solver.method if solver else ""):
        cost = cost_of(measured, rival, [scene])
        frames = crossing(network, cost) if network and network.before and cost else None
        pays.append(None if frames is None else float(f"{frames:.1e}"))
    return (*(_named(point) for point in (better, solver, hybrid)), *pays)


def _named(point: Point | None) -> str:
    return f"{palette.label(point.method)}, {number(point.time)}\u00a0ms" if point else "none"


def run_time(measured: Measurements) -> str:
    """SNUG's time a frame against the simulation's."""
    scenes = dressed_scenes(measured)
    means = measured.pair(NETWORK, palette.REFERENCE, TIME, scenes)
    own, reference = (mean.value if mean else 0.0 for mean in means)
    if not own or not reference:
        return ""
    fewer = means[0].fewer if means[0] else ""
    pace = f"{number(reference / own, 2)} times faster"
    if reference <= own:
        pace = f"{number(own / reference, 2)} times slower"
    text = f"SNUG takes {number(own)} ms per frame, the converged simulation {number(reference)} ms"
    return f"{text}: {pace}{fewer}."


def _per_error(measured: Measurements, scenes: Sequence[str], say) -> str:
    """One sentence for each measure of error, over the means of the scenes compared."""
    sentences = []
    for metric, words, unit in ERRORS:
        points = points_of(measured, scenes, metric) if scenes else []
        own = next((p for p in points if p.method == NETWORK), None)
        if own is not None and (sentence := say(points, own, words, unit)):
            sentences.append(sentence)
    if not sentences:
        return ""
    where = scenes[0] if len(scenes) == 1 else f"mean of {len(scenes)} scenes"
    return f"{' '.join(sentences)} ({where}.)"


def beaten_by(points: Sequence[Point], own: Point) -> Point | None:
    """The most accurate of those that are no slower and no less accurate, None where there is none."""
    faster = [p for p in points if overtaken(own, [p]) and p is not own]
    return min(faster, key=lambda p: p.error) if faster else None


def overtaken(point: Point, others: Sequence[Point]) -> bool:
    """Whether one of the others is no less accurate, and no slower by more than run times scatter."""
    return any(p.error <= point.error and p.time <= point.time + _scatter(p, point) for p in others)


def _scatter(one: Point, other: Point) -> float:
    """How far apart the run times of two equals may be measured: networks of one size take one time.

    The range of three repeats is 1.7 standard deviations on average, so this is near two of the difference.
    """
    return math.hypot(one.time_spread, other.time_spread)


def cut_solvers(points: Sequence[Point]) -> list[Point]:
    return [p for p in solvers(points) if palette.cut_of(p.method)]


def _unbeaten(points: Sequence[Point], own: Point, words: str, unit: str) -> str:
    """Whether anything as fast is more accurate than SNUG, and what the next faster and slower ones are."""
    best = beaten_by(points, own)
    if best is not None:
        text = f"By {words} SNUG ({number(own.error)}{unit} in {number(own.time)} ms) is not on the front: "
        return text + f"{palette.label(best.method)} has {number(best.error)} in {number(best.time)} ms."
    following = [p for p in front(points) if p.time > own.time]
    text = f"By {words} nothing as fast as SNUG ({number(own.time)} ms) comes nearer than its "
    text += f"{number(own.error)}{unit}"
    if not following:
        return text + ", and nothing slower does."
    after = following[0]
    pace = number(after.time / own.time, 2)
    return text + (
        f"; the next on the front, {palette.label(after.method)}, has {number(after.error)} in "
        f"{number(after.time)} ms, {pace} times its time."
    )


def _cut_solver(points: Sequence[Point], own: Point, words: str, unit: str) -> str:
    """The fastest solver with no larger an error than SNUG's."""
    cuts = cut_solvers(points)
    best = fastest(cuts, own.error)
    if not cuts:
        return ""
    if best is None:
        return f"No cut solver reaches SNUG's {words}."
    pace = f"{number(best.time / own.time, 2)} times SNUG's time"
    if best.time <= own.time:
        pace = "no more than SNUG's time"
    return (
        f"The fastest solver with at most SNUG's {words} ({number(own.error)}{unit}) is "
        f"{palette.label(best.method)}: {number(best.error)}{unit} in {number(best.time)} ms, {pace}."
    )


def _hybrid(points: Sequence[Point], own: Point, words: str, unit: str) -> str:
    """Hybrids that neither SNUG nor a solver alone beats in both time and error, and what the fastest has."""
    mixed = [p for p in hybrids(points) if p.method.startswith(f"{NETWORK}+")]
    alone = [*solvers(points), own]
    if not mixed:
        return ""
    winning = [p for p in mixed if not overtaken(p, alone)]
    if not winning:
        beaten = "is beaten by SNUG itself or by a solver alone that is no slower"
        return f"By {words} every SNUG-started solver {beaten}."
    first = min(winning, key=lambda p: p.time)
    names = ", ".join(palette.label(p.method) for p in sorted(winning, key=lambda p: p.time))
    return (
        f"By {words} {len(winning)} of {len(mixed)} SNUG-started solvers are beaten neither by SNUG itself "
        f"nor by a solver alone ({names}); the fastest has {number(first.error)}{unit} in "
        f"{number(first.time)} ms."
    )


def training_pays(measured: Measurements, scenes: Sequence[str]) -> str:
    """After how many frames SNUG has cost less than the solvers it competes with."""
    own = cost_of(measured, NETWORK, scenes) if scenes else None
    if own is None or own.before <= 0.0:
        return ""
    sentences = []
    for method, why in rivals(measured, scenes, NETWORK).items():
        rival = cost_of(measured, method, scenes)
        if rival is not None:
            sentences.append(_pays(own, rival, why))
    return " ".join(sentences)


def _pays(own: Cost, rival: Cost, why: str) -> str:
    name = "the converged simulation"
    if rival.method != palette.REFERENCE:
        name = f"{palette.label(rival.method)}, the fastest solver with at most SNUG's {why}"
    frames = crossing(own, rival)
    if frames is None:
        return f"Against {name}, SNUG never pays: its frames cost no less."
    return (
        f"SNUG's training of {duration(own.before)} pays against {name}, after {frames_text(frames)} frames "
        f"({duration(frames / 30.0)} of motion at 30 frames a second)."
    )
