"""Methods: everything that dresses a body or moves a sheet, in one visible tuple.

Nothing of the implementations is imported until a cell needs it.

>>> len({method.name for method in METHODS}) == len(METHODS)
True
"""

from __future__ import annotations

from benchmarks.declarations import by_name
from benchmarks.method import MethodEntry
from benchmarks.methods.declared_networks import NETWORKS
from benchmarks.methods.declared_solvers import SOLVERS
from benchmarks.methods.own_energies import OWN_REFERENCES

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
    *NETWORKS,
    *SOLVERS,
    *OWN_REFERENCES,
)


def find_method(name: str) -> MethodEntry:
    """Return the entry of that name. Raises KeyError.

    >>> find_method("newton-4").level
    4
    """
    return by_name("method", METHODS)[name]
