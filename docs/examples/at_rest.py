"""A sheet without weight stays where it is."""

import reference_sim as sim
from benchmarks import known_answer
from benchmarks.meshes import lying, rectangle
from reference_sim.energies import StretchStVK


@known_answer(
    {"sheet_at_rest": {"cells": 4}}, unit="m", expected=0.0, tolerance=1e-12, reason="round-off"
)
def sheet_at_rest(cells: int) -> float:
    """Return the largest distance of a vertex from its start, after five frames."""
    points, faces = rectangle("right", cells, cells, 1.0, 1.0)
    cloth = sim.Cloth(lying(points), faces, sim.Material())
    positions = sim.simulate(cloth, [StretchStVK(cloth)], dt=1 / 30, frames=5).positions
    return float(abs(positions - positions[0]).max())
