"""Pictures of the worst failures: overstretched networks, each at its worst frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from reports.figures.chosen_roll_outs import SceneRollOuts, read_scene
from reports.figures.figure import Drawing
from reports.figures.plotting import PAGE_WIDTH, wrapped
from reports.pictures.sheets import FRONT, sheet, shots
from reports.run.finished_run import Run
from reports.statistics.outcomes import overstretched
from reports.tables.number_texts import number

MOST, OF_ONE = 4, 2  # failures that are shown, and how many of them by one method
STRAIN = "energy/strain"


@dataclass(frozen=True)
class Failure:
    """A roll-out that went far wrong: its method, the frame to look at, and a text for below it."""

    roll_outs: SceneRollOuts
    method: str
    frame: int
    text: str


def failures(run: Run) -> Iterator[Drawing]:
    """Draw trained networks with most strain over the simulation's, where their roll-outs are on disk."""
    worst = worst_failures(run)
    if not worst:
        return
    wide = PAGE_WIDTH / max(len(worst), 4)
    tile = (wide, 1.1 * wide)
    images = [shots(f.roll_outs, [f.method], f.frame, FRONT, tile)[0] for f in worst]
    names = [f"{run.label(f.method)}: {f.roll_outs.scene.rpartition('/')[2]}" for f in worst]
    heads = [wrapped(name, round(14 * wide)) for name in names]
    figure = sheet([images], tile, heads, below=[[f.text for f in worst]])
    caption = "The worst of trained networks by strain over the simulation's: each at its worst frame."
    yield Drawing(figure, "failures", caption, vector=False)


def worst_failures(run: Run) -> list[Failure]:
    """Return the failures that are shown."""
    failures: list[Failure] = []
    shown: Counter[str] = Counter()
    for method, scene, _, strain, ratio in overstretched(run):
        if len(failures) == MOST or shown[method] == OF_ONE:
            continue
        roll_outs = read_scene(run, run.frame[run.frame["scene"] == scene], [method])
        if method in roll_outs.series:
            cloth = roll_outs.series[method]
            curve = cloth.frame_fields.get(STRAIN)
            last = cloth.frames - 1
            frame = last if curve is None else int(np.argmax(np.nan_to_num(curve[: cloth.frames])))
            text = f"{number(strain)} J of strain,\n{number(ratio)} × the simulation's"
            failures.append(Failure(roll_outs, method, frame, text))
            shown[method] += 1
    return failures
