"""A figure of the report: declared once as a class, drawn where the run holds what it needs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from reports.figures.plotting import PAGE_WIDTH, save
from reports.run.finished_run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

Data = TypeVar("Data")


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


class Figure(ABC, Generic[Data]):
    """A figure: a subclass in a file of its own, and one line in FIGURES or PICTURES.

    name: for the list of report blocks, and of its file. files: patterns of all its files.
    """

    name: ClassVar[str]
    files: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def patterns(cls) -> tuple[str, ...]:
        """Return the patterns of its files in the folder of figures."""
        return cls.files or (f"{cls.name}.*",)

    @abstractmethod
    def needs(self, run: Run) -> Data | None:
        """Return the data that the figure is drawn from, nothing where the run lacks them."""

    @abstractmethod
    def draw(self, run: Run, data: Data) -> Iterable[Drawing]:
        """Draw the figure from its data, in one part or several."""

    def drawings(self, run: Run) -> list[Drawing]:
        """Draw the figure where the run holds what it needs."""
        data = self.needs(run)
        return list(self.draw(run, data)) if data else []


def draw_figures(run: Run, folder: Path, figures: Iterable[Figure]) -> Mapping[str, list[Picture]]:
    """Draw into the folder all that the run has the data for; return name of the figure -> its pictures."""
    return {
        figure.name: [save_drawing(folder, drawing) for drawing in figure.drawings(run)] for figure in figures
    }


def save_drawing(folder: Path, drawing: Drawing) -> Picture:
    """Write <name>.png and, unless it is a photograph, <name>.svg, which the PDF then takes."""
    path = save(drawing.canvas, folder, drawing.name, vector=drawing.vector)
    return Picture(path, drawing.caption, min(1.0, float(drawing.canvas.get_figwidth()) / PAGE_WIDTH))


def remove_figures(folder: Path, figures: Iterable[Figure]) -> None:
    """Remove the files of these figures."""
    for figure in figures:
        for pattern in figure.patterns():
            for path in folder.glob(pattern):
                path.unlink()
