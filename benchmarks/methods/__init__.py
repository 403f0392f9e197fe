"""Methods: everything that dresses a body or moves a sheet, in one visible tuple.

| module | what lies there |
| --- | --- |
| declared_networks, declared_solvers | declarations, and trainings of networks |
| simulation, reference_variants, warm_started, sweeps | solvers of the time step |
| networks | trained networks, collision post-processing, skinning |
| lower_bounds | vertices of a clip optimised directly, steps within what a network can express |
| outside | stored roll-outs and programs |

Nothing of the implementations is imported until a cell needs it.

>>> len({method.name for method in METHODS}) == len(METHODS)
True
"""

from __future__ import annotations

from benchmarks.declarations import by_name
from benchmarks.method import MethodEntry
from benchmarks.methods import declared_networks
from benchmarks.methods.declared_networks import EQUAL_DATA, network
from benchmarks.methods.declared_solvers import SOLVERS

# They run when they are named: further baselines, ablations of SNUG, post-processing, the bound.
FURTHER_METHODS = (
    *declared_networks.NETWORKS,
    *declared_networks.HANDLES,
    *declared_networks.FLOORS,
    *declared_networks.RECIPES,
    *declared_networks.POST_PROCESSED,
    MethodEntry(
        name="direct-optimisation",
        label="Vertices optimised directly",
        description="no network: the vertices of a whole clip optimised directly, the least energy found",
        module="benchmarks.methods.lower_bounds:make_direct_optimisation",
        needs_body=True,
        gives_first_frame=True,
        role="bound",
    ),
)  # fmt: skip

METHODS = (
    MethodEntry(
        name="simulation",
        label="Simulation",
        description="the reference: backward Euler minimised to tolerance 1e-6",
        module="benchmarks.methods.simulation:make_simulation",
        role="reference",
    ),
    MethodEntry(
        name="skinning",
        label="Skinning alone",
        description="the garment follows the body's joints, nothing else: the free baseline",
        module="benchmarks.methods.networks:make_skinning",
        needs_body=True,
        dtype="float32",
        gives_first_frame=True,
    ),
    network("untrained", "SNUG, untrained",
            "the SNUG network with a random last layer (SNUG itself starts as skinning)",
            role="baseline", timed=False),  # a frame of it costs what one of SNUG does
    network("snug", "", "recurrent network trained on the energies alone (Santesteban et al. 2022)"),
    network("supervised", "", "the SNUG network trained on simulated vertices instead"),
    network("pbns", "", "static pose-space deformation trained on the energies (Bertiche et al. 2021)"),
    *FURTHER_METHODS,
    *EQUAL_DATA,
    *SOLVERS,
)  # fmt: skip


def find_method(name: str) -> MethodEntry:
    """Return the entry of that name. Raises KeyError.

    >>> find_method("newton-4").reporting.level
    4
    """
    return by_name("method", METHODS)[name]
