"""Which roll-outs the PDF shows: those of page one, one motion at length, and the worst failures."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reports.document.verdict import overstretched
from reports.figures import figures, hem
from reports.figures.plotting import Picture
from reports.figures.styles import leading
from reports.figures.work_precision import compared_cells
from reports.page.roll_outs import rest_areas
from reports.pictures import sheets as pictures
from reports.pictures.sheets import Failure, Filmed
from reports.run.rows import Run, shown_seeds
from reports.statistics.means import mean_of
from reports.tables.numbers import number, with_spread
from reports.tables.overview import leads

if TYPE_CHECKING:
    from reference_sim.trajectory.trajectory import Trajectory

Reader = Callable[[Path], "Trajectory | None"]
BELOW = ("step/distance", "distance/rms")  # the number below a picture of page one: the first that is known
WORST, OF_ONE = 4, 2  # failures that are shown, and how many of them by one method
MOST, FEW = 6, 3  # methods side by side, and at many frames
SPARE = 2  # further motions that may fill the last page
STRAIN = "energy/strain"


def draw_roll_outs(folder: RunFolder, run: Run, read: Reader) -> list[Picture]:
    """Every picture of what lies in trajectories/; read: the roll-out of a file, None where there is none."""
    found: list[Picture] = []
    shown: list[str] = []
    cells, scenes = compared_cells(run)
    for scene in scenes:
        rows = cells[cells["scene"] == scene]
        filmed = film(folder, run, rows, leads(run, rows), read)
        shown = leads(run, rows, filmed.series)
        if filmed.series and filmed.body:
            said = {method: said_below(run, rows, method) for method in shown}
            found.append(pictures.lead_row(folder.figures, run, filmed, shown, said))
            found += pictures.maps(folder.figures, run, filmed, shown)
            break
    worn, motions = run.worn[run.worn["metric"] == "energy/total"], 0
    for scene in [scene for own in run.garments(worn).values() for scene in own]:
        rows = worn[worn["scene"] == scene]
        filmed = film(folder, run, rows, leading(run, rows["method"]), read)
        few = [method for method in shown if method in filmed.series] or leads(run, rows, filmed.series)
        if filmed.series and motions == 0:
            found += _of_motion(folder.figures, run, filmed, few)
        elif few and motions <= SPARE:
            found.append(pictures.strip(folder.figures, run, filmed, few[:FEW], spare=True))
        motions += bool(filmed.series)
    return found + _failures(folder, run, read)


def film(folder: RunFolder, run: Run, rows: pd.DataFrame, methods: Iterable[str], read: Reader) -> Filmed:
    """The first good seed of each method, of the one scene of these rows; the first where none is good."""
    scene = str(rows["scene"].iloc[0])
    seeds = shown_seeds(rows).loc[scene]
    asked = {method: read(folder.trajectory_path(scene, method, int(seeds[method]))) for method in methods}
    series = {method: cloth for method, cloth in asked.items() if cloth is not None}
    body = read(folder.trajectory_path(scene, "body")) if series else None
    return Filmed(scene, series, body, rest_areas(folder.rest_areas_path(scene)))


def said_below(run: Run, rows: pd.DataFrame, method: str) -> str:
    """The first of BELOW that any method has, of this one."""
    for metric in BELOW:
        if metric in set(rows[rows["usable"]]["metric"]):
            mean = mean_of(rows, method, metric)
            words = with_spread(mean.value, mean.spread or None) if mean else ""
            return f"{words} {run.metrics[metric].unit}" if words else ""
    return ""


def _of_motion(folder: Path, run: Run, filmed: Filmed, few: list[str]) -> list[Picture]:
    """A motion at length: all methods at one frame, a few at many, and their curves."""
    last = max(cloth.frames for cloth in filmed.series.values())
    whole = [method for method in filmed.series if filmed.series[method].frames == last]
    few = [method for method in few if method in whole][:FEW]
    found = [
        pictures.side_by_side(folder, run, filmed, run.ordered(whole)[:MOST]),
        pictures.strip(folder, run, filmed, few) if few else None,
        figures.energy_series(folder, run, filmed.scene, filmed.series),
        hem.hem_curves(folder, run, filmed.scene, filmed.series, filmed.body),
        figures.histograms(folder, run, filmed.scene, {m: filmed.series[m] for m in whole}, filmed.rest),
    ]
    return [picture for picture in found if picture is not None]


def _failures(folder: RunFolder, run: Run, read: Reader) -> list[Picture]:
    """The networks with most strain over the simulation's, where their roll-outs are on disk."""
    found: list[Failure] = []
    for method, scene, _, strain, ratio in overstretched(run):
        if len(found) == WORST or sum(failure.method == method for failure in found) == OF_ONE:
            continue
        rows = run.frame[run.frame["scene"] == scene]
        filmed = film(folder, run, rows, [method], read)
        if method in filmed.series:
            cloth = filmed.series[method]
            curve = cloth.frame_fields.get(STRAIN)
            frame = (
                cloth.frames - 1 if curve is None else int(np.argmax(np.nan_to_num(curve[: cloth.frames])))
            )
            words = f"{number(strain)} J of strain,\n{number(ratio)} × the simulation's"
            found.append(Failure(filmed, method, frame, words))
    return pictures.gallery(folder.figures, run, found)
