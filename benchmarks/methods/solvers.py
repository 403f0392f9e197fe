"""Solvers: the reference at other tolerances and time steps, and everything that stops before the minimum."""

from __future__ import annotations

from ..method import MethodEntry

MOVED = "simulation-moved"
_SIMULATION = "benchmarks.methods.simulation"
_LBFGS = "benchmarks.methods.truncated_lbfgs"


def _cut(name: str, unit: str, description: str, module: str, cuts: tuple[int, ...], **options) -> tuple:
    """One entry for each number of iterations; cheap to list, as all of this file."""
    return tuple(
        MethodEntry(
            name=f"{name}-{cut}",
            description=description.format(f"{cut} {unit}{'s' * (cut > 1)}"),
            module=module,
            options={"iterations": cut, **options},
            cut_short=True,
        )
        for cut in cuts
    )


def hybrids(guess: str, solver: str, trained: str | None) -> tuple[MethodEntry, ...]:
    """A network or skinning, and some iterations from there."""
    return tuple(
        MethodEntry(
            name=f"{guess}+{solver}-{cut}",
            description=f"each step from {guess}'s frame by {cut} iteration{'s' * (cut > 1)} of {solver}",
            module="benchmarks.methods.hybrids",
            options={"guess": guess, "solver": solver, "iterations": cut},
            needs_body=True,
            trained=trained,
            seeded=trained is not None,
            cut_short=True,
        )
        for cut in (1, 2, 4, 8)
    )


SOLVERS = (
    *(
        MethodEntry(
            name=f"simulation-{tolerance:.0e}".replace("e-0", "e-"),
            description=f"the reference, minimised to tolerance {tolerance:.0e}",
            module=_SIMULATION,
            options={"tolerance": tolerance},
        )
        for tolerance in (1e-2, 1e-4, 1e-8)
    ),
    *(
        MethodEntry(
            name=f"simulation-dt/{substeps}",
            description=f"the reference with {substeps} time steps a frame",
            module=_SIMULATION,
            options={"substeps": substeps},
        )
        for substeps in (2, 4, 8)
    ),
    MethodEntry(
        name=MOVED,
        description="the reference again, its start moved by 1e-9 m: the floor of vertex distances",
        module="benchmarks.methods.restart",
    ),
    *_cut(
        "newton", "iteration", "Newton's method on the true Hessian, cut after {} a step",
        "benchmarks.methods.truncated_newton", (1, 2, 4, 8),
    ),
    *_cut("lbfgs", "iteration", "L-BFGS, factored preconditioner, cut after {}", _LBFGS, (5, 10, 20, 40)),
    *_cut(
        "gradient-descent", "iteration", "preconditioned gradient descent, cut after {}", _LBFGS, (10, 40),
        memory=0,
    ),
    *_cut(
        "vbd", "sweep", "vertex block descent on our energies, {} a step",
        "benchmarks.methods.vertex_block_descent", (5, 20, 80),
    ),
    *_cut(
        "xpbd", "sweep", "position-based dynamics with our energies, {} a step",
        "benchmarks.methods.xpbd", (10, 40, 160),
    ),
    *(
        MethodEntry(
            name=f"newton-{solver.lower()}",
            description=f"newton's {solver} on its own energies, {iterations} x {substeps} a frame",
            module="benchmarks.methods.peers",
            options={"solver": solver, "iterations": iterations, "substeps": substeps},
            dtype="float32",
            needs_no_obstacle=True,
            package="newton",
        )
        for solver, iterations, substeps in (("VBD", 10, 20), ("XPBD", 1, 128))
    ),
    *hybrids("skinning", "lbfgs", None),
    *hybrids("skinning", "newton", None),
    *hybrids("snug", "lbfgs", "snug"),
    *hybrids("snug", "newton", "snug"),
)  # fmt: skip
