"""Errors against the number of vertices, of the same motion on meshes of several sizes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from reports.figures.figure import Drawing, Figure
from reports.figures.method_styles import style
from reports.figures.plotting import PAGE_WIDTH, grid, legend_above, new_figure
from reports.run.finished_run import Run

METRICS, VERTICES, STEPS = ("curvature/error", "curvature/mean"), "mesh/vertices", "mesh/steps"


class AgainstVertices(Figure[tuple[pd.DataFrame, pd.Series]]):
    """Errors of a garment's scenes against the number of vertices that these declare."""

    name = "against_vertices"

    def needs(self, run: Run) -> tuple[pd.DataFrame, pd.Series] | None:
        """Return rows of scenes that declare their number of vertices, and scene -> that number."""
        rows = run.frame[run.frame["usable"] & (run.frame["garment"] != "")]
        several_steps = rows[(rows["metric"] == STEPS) & (rows["value"] > 1.0)]["scene"]
        rows = rows[~rows["scene"].isin(several_steps)]
        sizes = rows[rows["metric"] == VERTICES].drop_duplicates("scene").set_index("scene")["value"]
        rows = rows[rows["scene"].isin(sizes.index) & (rows["method"] != "")]
        return (rows, sizes) if sizes.nunique() > 1 and rows["metric"].isin(METRICS).any() else None

    def draw(self, run: Run, data: tuple[pd.DataFrame, pd.Series]) -> Iterator[Drawing]:
        """Draw a panel for each metric, a line for each method."""
        rows, sizes = data
        metrics = [name for name in METRICS if len(rows[rows["metric"] == name])]
        figure = new_figure(PAGE_WIDTH / 2, 2.5)
        drawn: set[str] = set()
        for axes, name in zip(np.atleast_1d(figure.subplots(1, len(metrics))), metrics):
            of_metric = rows[rows["metric"] == name].assign(size=lambda r: r["scene"].map(sizes))
            for method, line in of_metric.groupby("method"):
                curve = line.groupby("size")["value"].mean()
                look = style(run, str(method))
                axes.plot(curve.index, curve.to_numpy(), color=look.colour, marker=look.marker, markersize=4)
                drawn.add(str(method))
            axes.set(xlabel="vertices", ylim=(0.0, None))
            axes.set_ylabel(run.metrics[name].heading)
            grid(axes)
        legend_above(figure, [style(run, method) for method in run.ordered(drawn)], lines=False)
        caption = "The same motion on meshes of several sizes, each against the simulation on its own mesh."
        yield Drawing(figure, self.name, caption)
