"""Roll-outs that figures and pictures show: those of page one, a motion at length, the worst failures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd

from reference_sim.trajectory import Trajectory
from reports.figures.plotting import leading
from reports.run.finished_run import Run, shown_seeds
from reports.run.stored_files import STEP
from reports.statistics.outcomes import leads
from reports.statistics.pareto import compared_cells

INERTIA = "energy/inertia"


@dataclass(frozen=True)
class SceneRollOuts:
    """Roll-outs of one scene: method -> cloth, the body, and areas (F,) [m^2] of faces at rest."""

    scene: str
    series: Mapping[str, Trajectory]
    body: Trajectory | None = None
    rest: np.ndarray | None = None

    def chosen_frame(self, methods: Sequence[str], reference: str) -> tuple[int, str]:
        """Choose a frame that these methods have, and say why.

        It is where the reference's inertia is largest, else the middle. The first fifth is left out, in which
        a method may still be settling; so is a frame without one-step errors where others have them.
        """
        frames = min(self.series[method].frames for method in methods)
        inertia = self.series[reference].frame_fields.get(INERTIA) if reference in self.series else None
        if inertia is None:
            return frames // 2, "the middle"
        lively = np.nan_to_num(inertia[:frames])
        steps = [self.series[m].frame_fields[STEP][:frames] for m in methods if self.has_steps([m])]
        for errors in steps:
            lively = np.where(np.isfinite(errors).all(axis=1), lively, -1.0)
        first = frames // 5
        return first + int(np.argmax(lively[first:])), "where the simulation's inertia term is largest"

    @property
    def whole(self) -> list[str]:
        """Methods that came to the last frame that any has."""
        most = max(cloth.frames for cloth in self.series.values())
        return [method for method, cloth in self.series.items() if cloth.frames == most]

    def has_steps(self, methods: Sequence[str]) -> bool:
        """Return whether the one-step error of every vertex is known of all of these methods."""
        return all(STEP in self.series[method].frame_fields for method in methods)


@lru_cache(maxsize=1)
def page_one_roll_outs(run: Run) -> tuple[SceneRollOuts, tuple[str, ...]] | None:
    """Return roll-outs of the first compared scene that kept them and a body, and the methods shown."""
    cells, scenes = compared_cells(run)
    for scene in scenes:
        rows = cells[cells["scene"] == scene]
        roll_outs = read_scene(run, rows, leads(run, rows))
        if roll_outs.series and roll_outs.body:
            return roll_outs, tuple(leads(run, rows, roll_outs.series))
    return None


@lru_cache(maxsize=1)
def long_motion(run: Run) -> SceneRollOuts | None:
    """Return the first whole motion that kept roll-outs, shown at length; None where the run kept none."""
    rows = run.garment_rows[run.garment_rows["metric"] == "energy/total"]
    for scene in [scene for scenes in run.garments(rows).values() for scene in scenes]:
        of_scene = rows[rows["scene"] == scene]
        roll_outs = read_scene(run, of_scene, leading(run, of_scene["method"]))
        if roll_outs.series:
            return roll_outs
    return None


def read_scene(run: Run, rows: pd.DataFrame, methods: Iterable[str]) -> SceneRollOuts:
    """Read the first good seed of each method, or else its first, in the one scene of these rows."""
    scene = str(rows["scene"].iloc[0])
    seeds = shown_seeds(rows).loc[scene]
    cloths = {method: run.roll_outs.cloth(scene, method, int(seeds[method])) for method in methods}
    series = {method: cloth for method, cloth in cloths.items() if cloth is not None}
    body = run.roll_outs.body(scene) if series else None
    return SceneRollOuts(scene, series, body, run.roll_outs.rest_areas(scene))
