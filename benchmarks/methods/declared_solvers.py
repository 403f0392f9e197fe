"""Solvers as methods: variants of the reference, and solvers that stop before the minimum."""

from __future__ import annotations

from typing import Any

from benchmarks.method import MethodEntry

SHIFTS = (1e-9, 3e-9, 1e-8, 1e-7, 1e-6, 1e-5, 3e-5, 1e-4)  # [m]
PERTURBED = "benchmarks.methods.reference_variants:make_perturbed_start"
FAST = "reference_sim.minimise.compiled_lbfgs:CompiledLBFGS"


def _declare_variant(
    name: str, label: str, description: str, family: str, level: float | None = None, *, timed: bool = False,
    module: str = "benchmarks.methods.simulation:make_simulation", **options: Any,
) -> MethodEntry:  # fmt: skip
    return MethodEntry(
        name=f"simulation-{name}", label=f"Simulation{label}", description=f"the reference{description}",
        module=module, options=options, role="reference-variant", timed=timed,
        family=f"simulation-{family}", level=level,
    )  # fmt: skip


def _truncate(
    family: str, label: str, unit: str, description: str, counts: tuple[int, ...], *,
    dtype: str = "float64", **options: Any,
) -> tuple[MethodEntry, ...]:  # fmt: skip
    """Declare one entry for each number of iterations."""
    return tuple(
        MethodEntry(
            name=f"{family}-{count}",
            label=f"{label}, {_spell(count, unit)}",
            description=description.format(_spell(count, unit)),
            module="benchmarks.methods.simulation:make_simulation",
            options={"max_iterations": count, **options},
            dtype=dtype,
            truncated=True,
            role="solver",
            family=family,
            level=count,
        )
        for count in counts
    )


def _warm_started(base: str, label: str, solver: str) -> tuple[MethodEntry, ...]:
    """Declare steps from skinning or SNUG: "newton", "lbfgs" or "fast-lbfgs" goes on."""
    trained = None if base == "skinning" else base
    return tuple(
        MethodEntry(
            name=f"{base}+{solver}-{count}",
            label=f"{label} + {_LABELS[solver]}, {_spell(count, 'iteration')}",
            description=f"each step from {base}'s frame by {_spell(count, 'iteration')} of {solver}",
            module="benchmarks.methods.warm_started:make_warm_started",
            options={"guess": base, "solver": solver, "iterations": count},
            needs_body=True,
            trained=trained,
            seeded=trained is not None,
            truncated=True,
            role="warm-started",
            family=f"{base}+{solver}",
            level=count,
            base=base,
            pairing_group=trained or "",
        )
        for count in (1, 2, 4, 8)
    )


def _spell(count: int, unit: str) -> str:
    return f"{count} {unit}{'s' * (count > 1)}"


_LABELS = {"newton": "Newton", "lbfgs": "L-BFGS", "fast-lbfgs": "fast L-BFGS"}

SOLVERS = (
    *(
        _declare_variant(
            f"1e-{power}", f" to 1e-{power}", f", minimised to tolerance 1e-0{power}", "tolerance",
            tolerance := float(f"1e-{power}"), tolerance=tolerance,
            timed=power < 8,  # at its tightest it is another reference
        )
        for power in (2, 4, 8)
    ),
    *(
        _declare_variant(f"dt/{substeps}", f", step dt/{substeps}", f" with {substeps} time steps a frame",
                           "dt", substeps, timed=True, substeps=substeps)
        for substeps in (2, 4, 8)
    ),
    *(
        _declare_variant(
            f"perturbed-{shift:.0e}".replace("e-0", "e-"), f", perturbed by {shift * 1e3:g} mm",
            f" from a start perturbed by {shift:g} m: how far apart both end", "perturbed", shift,
            module=PERTURBED, shift=shift,
        )
        for shift in SHIFTS
    ),
    *(
        _declare_variant(
            f"dt/{substeps}-perturbed-1e-4", f", step dt/{substeps}, perturbed by 0.1 mm",
            f" with {substeps} time steps a frame, from a start perturbed by 1e-4 m", "dt-perturbed",
            substeps, module=PERTURBED, shift=1e-4, substeps=substeps,
        )
        for substeps in (2, 4, 8)
    ),
    _declare_variant(
        "refrozen", ", planes searched twice",
        ", each step solved again with contact planes searched at its end", "refrozen", refreeze=1,
    ),
    # All negative curvature is taken out at once: nearly every first iteration of moving cloth has some.
    *_truncate(
        "newton", "Newton", "iteration", "Newton's method on the true Hessian, stopped after {} a step",
        (1, 2, 4, 8), method="newton", start_projected=True,
    ),
    # Without memory L-BFGS is gradient descent, as projective dynamics: a constant matrix, a line search.
    *_truncate(
        "lbfgs", "L-BFGS", "iteration", "L-BFGS, factored preconditioner, stopped after {}",
        (5, 10, 20, 40), method="lbfgs", finish=False, memory=10,
    ),
    *_truncate(
        "fast-lbfgs", "Fast L-BFGS", "iteration",
        "L-BFGS compiled as a whole, float32, stopped after {}", (5, 10, 20, 40),
        dtype="float32", method=FAST,
    ),
    *_truncate(
        "gradient-descent", "Gradient descent", "iteration",
        "preconditioned gradient descent, stopped after {}", (10, 40),
        method="lbfgs", finish=False, memory=0,
    ),
    *_truncate(
        "vbd", "Vertex block descent", "sweep", "vertex block descent on our energies, {} a step",
        (5, 20, 80), method="benchmarks.methods.sweeps:VertexBlockDescent",
    ),
    *_truncate(
        "xpbd", "XPBD", "sweep", "position-based dynamics with our energies, {} a step",
        (10, 40, 160), method="benchmarks.methods.sweeps:XPBD",
    ),
    *_warm_started("skinning", "Skinning", "lbfgs"),
    *_warm_started("skinning", "Skinning", "newton"),
    *_warm_started("snug", "SNUG", "lbfgs"),
    *_warm_started("snug", "SNUG", "newton"),
    *_warm_started("snug", "SNUG", "fast-lbfgs"),
)  # fmt: skip
