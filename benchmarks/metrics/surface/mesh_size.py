"""Metrics mesh/*: how fine the mesh and the time step of a scene are; in the reference's rows alone."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut

_metric = partial(Metric, table="dependence")

METRICS = (
    _metric(name="mesh/vertices", unit="1", title="Vertices", definition="vertices of the garment"),
    _metric(name="mesh/edge", unit="mm", title="Edge", definition="mean length of its edges at rest"),
    _metric(name="mesh/steps", unit="1", title="Steps of a frame",
            definition="time steps that a frame is simulated in"),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return vertices, mean edge [mm] and steps of a frame; of the reference alone."""
    cloth = roll_out.scene.cloth
    if roll_out.entry.role != "reference":
        return {}
    return {
        "mesh/vertices": float(cloth.vertex_count),
        "mesh/edge": 1e3 * float(cloth.edge_lengths.mean()),
        "mesh/steps": float(roll_out.scene.substeps),
    }
