"""Pictures of page one: its methods side by side at one frame, coloured by error."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from reports.figures.chosen_roll_outs import PageOne, page_one_roll_outs
from reports.figures.figure import Drawing, Figure
from reports.figures.plotting import PAGE_WIDTH
from reports.pictures.colour_scales import scales
from reports.pictures.sheets import BAR, FRONT, heads_of, sheet, shots
from reports.run.finished_run import Run
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.pareto import compared_cells
from reports.tables.number_texts import number, with_spread

BELOW = ("step/distance", "distance/rms")  # the number below a picture: the first that is known


class LeadRow(Figure[PageOne]):
    """Methods of page one, coloured by one-step error where it is known; their error below each."""

    name = "lead"

    def needs(self, run: Run) -> PageOne | None:
        """Return roll-outs of a compared scene that kept them and its body."""
        return page_one_roll_outs(run)

    def draw(self, run: Run, data: PageOne) -> Iterator[Drawing]:
        """Draw the row."""
        roll_outs, methods = data
        frame, _ = roll_outs.chosen_frame(methods, run.reference)
        name, scale = next(iter(scales(roll_outs, methods, frame, run.reference).items()), ("", None))
        wide = (PAGE_WIDTH - BAR) / max(len(methods), 3)
        tile = (wide, 1.55)
        cells, _ = compared_cells(run)
        rows = cells[cells["scene"] == roll_outs.scene]
        figure = sheet(
            [shots(roll_outs, methods, frame, FRONT, tile, scale)], tile, heads_of(run, methods, wide),
            below=[[error_below(run, rows, method) for method in methods]], bar=scale,
        )  # fmt: skip
        colour = {
            "step": "distance from the minimum of the frame's own time step; below: mean over frames",
            "distance": "distance from the simulation's vertex; below: mean over frames",
        }.get(name, scale.title if scale else "none")
        time = float(roll_outs.series[methods[0]].times[frame])
        caption = f"{roll_outs.scene} at {number(time)} s. Colour: {colour}."
        yield Drawing(figure, self.name, caption, vector=False)


def error_below(run: Run, rows: pd.DataFrame, method: str) -> str:
    """Return the method's number for the first metric of BELOW that any method has."""
    for metric in BELOW:
        if metric in set(rows[rows["usable"]]["metric"]):
            mean = mean_of(rows, method, metric)
            text = with_spread(mean.value, mean.spread or None) if mean else ""
            return f"{text} {run.metrics[metric].unit}" if text else ""
    return ""
