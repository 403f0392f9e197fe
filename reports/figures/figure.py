"""A figure of the report: its name and the function that draws it where the run holds what it needs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from reference_sim.files.atomic_files import replacing
from reports.figures.plotting import DOTS, PAGE_WIDTH
from reports.run.finished_run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


@dataclass(frozen=True)
class Drawing:
    """A drawn figure, the name of its files and its caption; a photograph has no vector graphic."""

    canvas: Canvas
    name: str
    caption: str
    vector: bool = True


@dataclass(frozen=True)
class Picture:
    """A figure as it lies on disk: its file for the PDF, caption and share of the page's width."""

    path: Path
    caption: str
    width: float


@dataclass(frozen=True)
class Figure:
    """A figure: its name, what draws it, in no part, in one or in several, and its files.

    files: patterns of them in the folder of figures, where they are not <name>.*.
    """

    name: str
    drawings: Callable[[Run], Iterable[Drawing]]
    files: tuple[str, ...] = ()

    @property
    def patterns(self) -> tuple[str, ...]:
        """Patterns of its files in the folder of figures."""
        return self.files or (f"{self.name}.*",)


def draw_figures(run: Run, folder: Path, figures: Iterable[Figure]) -> Mapping[str, list[Picture]]:
    """Draw into the folder all that the run has the data for; return name of the figure -> its pictures."""
    return {
        figure.name: [save_drawing(folder, drawing) for drawing in figure.drawings(run)] for figure in figures
    }


def save_drawing(folder: Path, drawing: Drawing) -> Picture:
    """Write <name>.png and, unless it is a photograph, <name>.svg, which the PDF then takes."""
    canvas, path = drawing.canvas, folder / f"{drawing.name}.png"
    with replacing(path) as temporary:
        canvas.savefig(temporary, dpi=DOTS, metadata={"Software": None})
    if drawing.vector:
        canvas.set_layout_engine("none")  # it has done its work, which is half of the time of a figure
        path = folder / f"{drawing.name}.svg"
        with replacing(path) as temporary:
            canvas.savefig(temporary, metadata={"Date": None})
    return Picture(path, drawing.caption, min(1.0, float(canvas.get_figwidth()) / PAGE_WIDTH))


def remove_figures(folder: Path, figures: Iterable[Figure]) -> None:
    """Remove the files of these figures."""
    for figure in figures:
        for pattern in figure.patterns:
            for path in folder.glob(pattern):
                path.unlink()
