"""Values behind the means: a dot for each motion and seed, a bar at the mean."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from reports.figures.figure import Drawing, Figure
from reports.figures.method_styles import leading, style
from reports.figures.plotting import PAGE_WIDTH, grid, log_axis, new_figure, wrapped
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import means

METRICS = ("energy/total", "curvature/error", "penetration/vertices")
MOST_METHODS = 24  # methods that have room below each other


class Dots(Figure[tuple[pd.DataFrame, list[str]]]):
    """Cells behind the means of the first garment."""

    name = "dots"

    def needs(self, run: Run) -> tuple[pd.DataFrame, list[str]] | None:
        """Return rows of the first garment with one of METRICS, and their methods."""
        rows = run.garment_rows
        rows = rows[(rows["garment"] == run.first_garment) & rows["usable"] & rows["metric"].isin(METRICS)]
        methods = leading(run, set(rows["method"]))[:MOST_METHODS]
        return (rows, methods) if run.first_garment and methods else None

    def draw(self, run: Run, data: tuple[pd.DataFrame, list[str]]) -> Iterator[Drawing]:
        """Draw a panel for each metric, a line for each method."""
        rows, methods = data
        metrics = [name for name in METRICS if name in set(rows["metric"])]
        by_method = means(rows, "method", "metric")
        labels = [wrapped(run.label(method), 28) for method in methods]
        lines = max(label.count("\n") + 1 for label in labels)
        figure = new_figure(PAGE_WIDTH, 0.65 + (0.04 + 0.13 * lines) * len(methods))
        panels = np.atleast_1d(figure.subplots(1, len(metrics), sharey=True))
        for axes, name in zip(panels, metrics):
            shown: list[float] = []
            for place, method in enumerate(methods):
                mean = by_method.get((method, name))
                if mean is None:
                    continue
                look, values = style(run, method), np.array(list(mean.cells.values()))
                shown += values.tolist()
                axes.plot(
                    values, np.full(len(values), place), look.marker, color=look.colour, alpha=0.55,
                    markersize=4, linestyle="none",
                )  # fmt: skip
                axes.plot([mean.value] * 2, [place - 0.36, place + 0.36], color="#111111", linewidth=1.4)
            if min(shown) > 0.0 and max(shown) > 20.0 * min(shown):
                axes.set_xlim(min(shown) / 1.3, max(shown) * 1.3)
                log_axis(axes, "x")
            axes.set_xlabel(run.metrics[name].heading)
            grid(axes, "x")
        panels[0].set_yticks(range(len(methods)), labels)
        panels[0].set_ylim(len(methods) - 0.4, -0.6)
        caption = f"{run.first_garment}: each motion and seed behind the means; the bar is the mean."
        yield Drawing(figure, self.name, caption)
