"""Curves of the plane of run time and error: methods that are joined by a line and named at its ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from reports.figures.method_styles import Style, family_style, style
from reports.figures.plotting import power_text
from reports.run.finished_run import ReportedMethod, Run
from reports.statistics.pareto import Point, front

SOLVERS = Style("Solvers stopped early", "#A3324B", "X")
STARTED = ("warm-started",)  # role of solvers that start from another method
OF_REFERENCE = (
    "reference-variant",
)  # role of methods that only say how the reference depends on its options


@dataclass(frozen=True)
class Curve:
    """Points that a line joins in their order, a method alone where there is one.

    ends: label of its first and of its last point. look: of its line, and of its markers unless the marker is
    each method's own. aside: points of its kind that lie off the line.
    """

    points: Sequence[Point]
    ends: tuple[str, str]
    look: Style
    aside: Sequence[Point] = ()


def families(run: Run, points: Iterable[Point]) -> list[Curve]:
    """Return a curve for each family, in order of its level, and one for each method that has no level."""
    curves = []
    for members in _grouped(run, points, lambda method: method.family):
        method = run.methods[members[0].method]
        if method.level is None:
            curves.append(Curve(members, (run.label(method.name), ""), style(run, method.name)))
            continue
        members.sort(key=lambda point: run.methods[point.method].level or 0.0)
        look = family_style(run, method)
        first, last = (power_text(run.methods[members[end].method].level or 0.0) for end in (0, -1))
        ends = (f"{look.label}, {first}", last if len(members) > 1 else "")
        curves.append(Curve(members, ends, look))
    return curves


def of_page_one(run: Run, points: Iterable[Point]) -> list[Curve]:
    """Return the curves of page one: each network and baseline, and solvers stopped early as one curve.

    A curve of solvers joins the best at each run time; the others lie aside. So do those that start from one
    and the same method. Variants of the reference are left out.
    """
    points = list(points)
    shown = [p for p in points if run.methods[p.method].role not in OF_REFERENCE] or points
    solvers = [point for point in shown if _solver(run.methods[point.method])]
    curves = families(run, [point for point in shown if point not in solvers])
    for members in _grouped(run, solvers, lambda method: method.base):
        best = front(members)
        base = run.methods[members[0].method].base
        look = replace(family_style(run, run.methods[best[0].method]), line=":") if base else SOLVERS
        first, last = (run.label(best[end].method) for end in (0, -1))
        first = first if base or len(best) == 1 else f"{SOLVERS.label}: {first}"
        aside = [point for point in members if point not in best]
        curves.append(Curve(best, (first, last if len(best) > 1 else ""), look, aside))
    return curves


def _solver(method: ReportedMethod) -> bool:
    return method.level is not None and method.role in ("solver", *STARTED)


def _grouped(
    run: Run, points: Iterable[Point], key: Callable[[ReportedMethod], str]
) -> Iterator[list[Point]]:
    """Yield the points of methods that share a key, in the order of their first."""
    groups: dict[str, list[Point]] = {}
    for point in points:
        groups.setdefault(key(run.methods[point.method]), []).append(point)
    yield from groups.values()
