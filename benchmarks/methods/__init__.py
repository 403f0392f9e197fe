"""The visible tuple of methods: one line each. Nothing is imported until a cell needs it."""

from __future__ import annotations

from ..method import MethodEntry
from .learned import LEARNED
from .solvers import SOLVERS

_SIMULATION = "benchmarks.methods.simulation"
_NETWORKS = "benchmarks.methods.networks"

METHODS = (
    MethodEntry(
        name="simulation",
        description="the reference: backward Euler minimised to tolerance 1e-6",
        module=_SIMULATION,
    ),
    MethodEntry(
        name="skinning",
        description="the garment follows the body's joints, nothing else: the free baseline",
        module="benchmarks.methods.skinning",
        needs_body=True,
        dtype="float32",
    ),
    MethodEntry(
        name="untrained",
        description="the SNUG network with a random last layer (SNUG itself starts as skinning)",
        module=_NETWORKS,
        options={"kind": "untrained"},
        needs_body=True,
        dtype="float32",
        trained="untrained",
        seeded=True,
    ),
    MethodEntry(
        name="snug",
        description="recurrent network trained on the energies alone (Santesteban et al. 2022)",
        module=_NETWORKS,
        options={"kind": "snug"},
        needs_body=True,
        dtype="float32",
        trained="snug",
        seeded=True,
    ),
    MethodEntry(
        name="supervised",
        description="the SNUG network trained on simulated vertices instead",
        module=_NETWORKS,
        options={"kind": "supervised"},
        needs_body=True,
        dtype="float32",
        trained="supervised",
        seeded=True,
    ),
    MethodEntry(
        name="pbns",
        description="static pose-space deformation trained on the energies (Bertiche et al. 2021)",
        module=_NETWORKS,
        options={"kind": "pbns"},
        needs_body=True,
        dtype="float32",
        trained="pbns",
        seeded=True,
    ),
    *LEARNED,
    *SOLVERS,
)


def find_method(name: str) -> MethodEntry:
    """The entry of that name. Raises KeyError."""
    return {entry.name: entry for entry in METHODS}[name]
