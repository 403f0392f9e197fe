"""Pictures of page one's frame again, coloured by each further scale."""

from __future__ import annotations

from collections.abc import Iterator

from reports.figures.chosen_roll_outs import page_one_roll_outs
from reports.figures.figure import Drawing
from reports.figures.plotting import PAGE_WIDTH
from reports.pictures.colour_scales import scales
from reports.pictures.sheets import BACK, BAR, FRONT, heads_of, sheet, shots
from reports.run.finished_run import Run


def colour_maps(run: Run) -> Iterator[Drawing]:
    """Draw a row of pictures for each scale of colours but that of page one, front and back in turn."""
    page_one = page_one_roll_outs(run)
    if not page_one:
        return
    roll_outs, methods = page_one
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
        yield Drawing(figure, f"map_{name}", caption, vector=False)
