"""A figure of the report: its name and the function that draws it where the run holds what it needs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from reference_sim.files.atomic_files import replacing
from reports.figures.plotting import DOTS, PAGE_WIDTH
from reports.finished_run import Run

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
    """A figure: its name, with which its files begin, and what draws it, in no part, in one or in several."""

    name: str
    drawings: Callable[[Run], Iterable[Drawing]]

    def files_in(self, folder: Path) -> list[Path]:
        """Return its files in the folder of figures."""
        return sorted(path for path in folder.glob(f"{self.name}*") if path.suffix in (".png", ".svg"))


def draw_figures(run: Run, folder: Path, figures: Iterable[Figure]) -> Mapping[str, list[Picture]]:
    """Draw into the folder all that the run has the data for; return name of the figure -> its pictures.

    What cannot be drawn is taken from the folder if it lies there.
    """
    return {
        figure.name: [save_drawing(folder, drawing) for drawing in figure.drawings(run)]
        or [kept_picture(path) for path in figure.files_in(folder) if path.suffix == ".png"]
        for figure in figures
    }


def save_drawing(folder: Path, drawing: Drawing) -> Picture:
    """Write <name>.png, which holds its caption, and, unless it is a photograph, <name>.svg for the PDF."""
    canvas, path = drawing.canvas, folder / f"{drawing.name}.png"
    with replacing(path) as temporary:
        canvas.savefig(temporary, dpi=DOTS, metadata={"Software": None, "Description": drawing.caption})
    if drawing.vector:
        canvas.set_layout_engine("none")  # it has done its work, which is half of the time of a figure
        with replacing(path.with_suffix(".svg")) as temporary:
            canvas.savefig(temporary, metadata={"Date": None})
    return kept_picture(path)


def kept_picture(path: Path) -> Picture:
    """Return the picture that `save_drawing` wrote as this PNG, as vector graphic where it has one."""
    from PIL import Image

    with Image.open(path) as image:
        caption, width = image.info.get("Description", ""), image.width / DOTS / PAGE_WIDTH
    vector = path.with_suffix(".svg")
    return Picture(vector if vector.is_file() else path, caption, min(1.0, width))
