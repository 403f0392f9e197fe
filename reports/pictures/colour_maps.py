"""Pictures of page one's frame again, coloured by each further scale."""

from __future__ import annotations

from collections.abc import Iterator

from reports.figures.chosen_roll_outs import PageOne, page_one_roll_outs
from reports.figures.figure import Drawing, Figure
from reports.figures.plotting import PAGE_WIDTH
from reports.pictures.colour_scales import scales
from reports.pictures.sheets import BACK, BAR, FRONT, heads_of, sheet, shots
from reports.run.finished_run import Run


class ColourMaps(Figure[PageOne]):
    """A row of pictures for each scale of colours, but that of page one."""

    name, files = "map", ("map_*",)

    def needs(self, run: Run) -> PageOne | None:
        """Return roll-outs of a compared scene that kept them and its body."""
        return page_one_roll_outs(run)

    def draw(self, run: Run, data: PageOne) -> Iterator[Drawing]:
        """Draw the rows, from the front and from behind in turn."""
        roll_outs, methods = data
        frame, _ = roll_outs.chosen_frame(methods, run.reference)
        further = list(scales(roll_outs, methods, frame, run.reference).items())[1:]
        wide = min((PAGE_WIDTH - BAR) / len(methods), 1.52)
        tile = (wide, 0.86 * wide)
        heads = heads_of(run, methods, wide)
        for turn, (name, scale) in zip((FRONT, BACK, FRONT, BACK), further):
            figure = sheet([shots(roll_outs, methods, frame, turn, tile, scale)], tile, heads, bar=scale)
            heads = []  # the next row stands below
            side = "front" if turn == FRONT else "back"
            caption = f"{roll_outs.scene}, the frame of page one, {side}: {scale.title}."
            yield Drawing(figure, f"{self.name}_{name}", caption, vector=False)
