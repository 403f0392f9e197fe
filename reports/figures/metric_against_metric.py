"""Any metric against any other, as `python -m reports.build --axes X Y` draws it."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.results.json_file import ResultsError
from reports.figures.error_against_time import hollow_remark, missing_remark
from reports.figures.figure import Drawing
from reports.figures.plane.curves import families
from reports.figures.plane.labels import lay_out
from reports.figures.plane.points import draw_points, write_labels
from reports.figures.plotting import PAGE_WIDTH, file_name, grid, new_figure
from reports.run.finished_run import SUITES, Run
from reports.statistics.pareto import points_of


def metric_against_metric(run: Run, x: str, y: str, scenes: Sequence[str] = ()) -> Drawing:
    """Draw metric y against metric x, a marker per method, means over the scenes.

    Both axes are logarithmic: points at x = 0 are left out.

    Args:
        run: the run.
        x: a metric, as results.csv names it.
        y: another.
        scenes: by default those in which most methods have both.

    Raises:
        ResultsError: for a name that no row has, a negative number, or fewer than two methods with both.
    """
    for column, names in (("metric", (x, y)), ("scene", scenes)):
        for name in names:
            if name not in set(run.frame[column]):
                raise ResultsError(f"no row has the {column} '{name}'")
    scenes = scenes or most_shared_scenes(run, x, y)
    all_points = points_of(run, run.cells(*SUITES), scenes, y, x)
    points = [point for point in all_points if point.time != 0.0]
    if len(points) < 2:
        where = ", ".join(scenes) or "every scene"
        raise ResultsError(f"fewer than two methods have both {x} and {y} on {where}")
    for point in points:
        if min(point.time, point.error) < 0.0:
            metric, value = (x, point.time) if point.time < 0.0 else (y, point.error)
            raise ResultsError(
                f"{metric} of {point.method} is {value:.4g}: it has no place on a logarithmic axis; "
                "name another metric"
            )
    figure = new_figure(PAGE_WIDTH, 3.6)
    axes = figure.subplots()
    drawn = draw_points(axes, run, families(run, points), None, 0.0)
    axes.set(xlabel=f"{x} [{run.metrics[x].unit}]", ylabel=f"{y} [{run.metrics[y].unit}]")
    grid(axes)
    lay_out(figure)
    write_labels(axes, drawn)
    caption = f"{y} against {x}, means over {', '.join(scenes)}."
    caption += hollow_remark(run, drawn.below) + missing_remark(run, points)
    zero = ", ".join(run.label(point.method) for point in all_points if point not in points)
    caption += f" Left out, for {x} is zero: {zero}." if zero else ""
    return Drawing(figure, file_name(f"{y}_against_{x}"), caption)


def most_shared_scenes(run: Run, x: str, y: str) -> list[str]:
    """Return the scenes in which most methods have both metrics, the same methods in each."""
    rows = run.cells(*SUITES)
    rows = rows[rows["usable"] & rows["metric"].isin((x, y))]
    count = rows.groupby(["scene", "method"])["metric"].nunique()
    both = count[count == len({x, y})].reset_index().groupby("scene")["method"].agg(frozenset)
    most: frozenset[str] = max(both, key=len, default=frozenset())
    return sorted(str(scene) for scene, methods in both.items() if methods == most)
