"""Methods as points in the plane of run time and error: which are beaten by none, who first reaches what."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from reports import palette
from reports.summary import Measurements

TIME = "cost/frame"


@dataclass(frozen=True)
class Point:
    """A method's run time [ms per frame] and error.

    time_spread: how far runs lie apart [ms]: largest less smallest repeat where it was repeated, else two
    standard deviations over seeds. error_spread: one standard deviation over seeds. Both 0 where unknown.
    """

    method: str
    time: float
    error: float
    time_spread: float = 0.0
    error_spread: float = 0.0


def points_of(measured: Measurements, scenes: Sequence[str], metric: str, x: str = TIME) -> list[Point]:
    """Every method that has both numbers in all the scenes, as means over them."""
    found = []
    for method in measured.methods:
        time, error = measured.mean(method, x, scenes), measured.mean(method, metric, scenes)
        if time is None or error is None or min(time.scenes, error.scenes) < len(scenes):
            continue
        repeats = measured.value(method, "cost/spread", scenes) if x == TIME else None
        spread = time.value * repeats / 100.0 if repeats is not None else 2.0 * (time.spread or 0.0)
        found.append(Point(method, time.value, error.value, spread, error.spread or 0.0))
    return found


def front(points: Iterable[Point]) -> list[Point]:
    """Those to which no other is at once at least as fast and as accurate, from fast to accurate."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.time, p.error, p.method)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def fastest(points: Iterable[Point], error: float) -> Point | None:
    """The fastest with at most that error, or None."""
    reached = [point for point in points if point.error <= error]
    return min(reached, key=lambda p: (p.time, p.error, p.method)) if reached else None


def solvers(points: Iterable[Point]) -> list[Point]:
    """Solvers alone, cut or to a tolerance, with nothing learned; smaller time steps are another problem."""
    return [p for p in points if _is_solver(p.method)]


def hybrids(points: Iterable[Point]) -> list[Point]:
    """Solvers that start each step from another method's guess."""
    return [p for p in points if palette.is_hybrid(p.method)]


def _is_solver(method: str) -> bool:
    cut = palette.cut_of(method)
    if cut is None:
        return method == palette.REFERENCE
    return not palette.is_hybrid(method) and cut.family != "simulation-dt"
