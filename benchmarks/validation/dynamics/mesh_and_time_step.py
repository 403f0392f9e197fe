"""Dependence of headline numbers on mesh and time step: the hanging sheet at two of each."""

from __future__ import annotations

from functools import cache

import numpy as np

from benchmarks.metrics.surface.curvature import curvature_series
from benchmarks.scenes import hanging_sheet
from benchmarks.validation.convergence import demand_converged
from benchmarks.validation.dynamics.discrete_laws import HANGING
from reference_sim.time_loop import simulate

CELLS, FRAMES = 10, 45
FINER = 2  # times as many cells along each side
SHORTER = 4  # times as many steps


def mesh_dependence(quantity: str) -> float:
    """Return the mean over frames on cells half as wide, over that on the others."""
    return _means(CELLS * FINER, 1)[quantity] / _means(CELLS, 1)[quantity]


def time_step_dependence(quantity: str) -> float:
    """Return the mean over the same instants with a quarter of the time step, over that at 1/30 s."""
    return _means(CELLS, SHORTER)[quantity] / _means(CELLS, 1)[quantity]


@cache
def _means(cells: int, substeps: int) -> dict[str, float]:
    scene = hanging_sheet.build(HANGING, sheet_cells=cells, sheet_frames=FRAMES)
    trajectory = simulate(
        scene.cloth, scene.energies, dt=scene.dt, frames=FRAMES, start=scene.start, substeps=substeps
    )
    demand_converged(trajectory, "the simulation")
    fields = trajectory.frame_fields
    curvature = curvature_series(trajectory.positions[1:], trajectory.faces).means()
    return {
        "strain": float(np.mean(fields["energy/strain"][1:])),
        "bending": float(np.mean(fields["energy/bending"][1:])),
        "curvature": float(curvature.mean()),
    }
