"""Independent check of a stress step's end, without the solver's kernels.

Energies, gradient and Hessian come from automatic differentiation of each term's torch definition; the
curvature from all eigenvalues of the dense Hessian. A claim that does not hold is a failure, whatever
else.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

import reference_sim as sim
from benchmarks.validation.case import Measurement
from reference_sim import energies
from reference_sim.geometry.topology import corner_areas

RELATIVE_RESIDUAL = 1e-6  # largest gradient component over a vertex's mean weight
ROUND_OFF = 1e-2  # relative residual that round-off may at most excuse
EVALUATION_ROUND_OFF = 1e-6  # of the sum of the terms' sizes: by more the energy may not rise
TIMEOUT = 20.0  # [s] that the solver gives itself
COLLAPSED = 1e-3  # share of its area below which a triangle has collapsed
STATUS = {"converged": "ok", "max_iterations": "stalled"}


def solve_and_check(potential: sim.Potential, guess: np.ndarray) -> Measurement:
    """Minimise a prepared potential from `guess` (V, 3) [m] as the simulator does; check the end."""
    result = sim.minimise(potential, guess, method="lbfgs", tolerance=RELATIVE_RESIDUAL, timeout=TIMEOUT)
    return check_result(potential, guess, result)


def check_result(potential: sim.Potential, guess: np.ndarray, result: sim.Result) -> Measurement:
    """Check the solver's claim; the value of the row is the relative residual, computed independently."""
    measure = partial(Measurement, terms="+".join(energy.name for energy in potential.energies))
    status, x = STATUS.get(result.status, result.status), result.positions
    if not np.isfinite(x).all():
        return measure(reason=f"positions that are not finite are called {result.status}")
    if not np.array_equal(x[potential.cloth.pins], guess[potential.cloth.pins]):
        return measure(reason="pinned vertices moved")
    if status == "diverged" and not np.isfinite(energy_of(potential, guess)[0]):
        return measure(status=status, reason=result.reason)
    optimum = optimality_of(potential, x)
    if not np.isfinite(optimum.residual):
        return measure(reason=f"a gradient that is not finite is called {result.status}")
    measure = partial(measure, value=optimum.residual)
    (before, size), (after, _) = energy_of(potential, guess), energy_of(potential, x)
    if not after <= before + EVALUATION_ROUND_OFF * size:
        return measure(reason=f"the energy rose from {before:.17g} to {after:.17g} J")
    if status != "ok":
        areas = corner_areas(x[potential.cloth.faces])
        count = int((areas < COLLAPSED * potential.cloth.areas).sum())
        collapse = f"; {count} triangles collapsed, where a hinge's energy jumps: no minimum need exist"
        reason = f"{result.reason} ({result.iterations} iterations){collapse if count else ''}"
        return measure(status=status, reason=reason)
    if optimum.residual > max(RELATIVE_RESIDUAL, optimum.round_off):
        return measure(reason=f"claims convergence at a relative residual of {optimum.residual:.3g}")
    if optimum.lowest_curvature < -optimum.zero_curvature:
        return measure(
            reason=f"claims convergence on a saddle: curvature {optimum.lowest_curvature:.3g} N/m"
        )
    excused = "; tolerance at round-off" if optimum.residual > RELATIVE_RESIDUAL else ""
    return measure(status="ok", reason=f"{result.iterations} iterations{excused}")


def energy_of(potential: sim.Potential, x: np.ndarray) -> tuple[float, float]:
    """Return the energy [J] at x (V, 3) and the sum of its terms' sizes, from the definitions."""
    import torch

    with torch.no_grad():
        parts = [float(energy.energy(torch.as_tensor(x)).sum()) for energy in potential.energies]
    return sum(parts), sum(map(abs, parts))


class OptimalityCheck(NamedTuple):
    """Residual and curvature at a point."""

    residual: float  # [1], relative
    round_off: float  # [1], what it does to the residual
    lowest_curvature: float  # [N/m], smallest eigenvalue of the Hessian over free vertices
    zero_curvature: float  # [N/m], size below which one counts as zero


def optimality_of(potential: sim.Potential, x: np.ndarray) -> OptimalityCheck:
    """Compute gradient and curvature at x (V, 3) over the free vertices."""
    import torch

    cloth = potential.cloth
    weight = float(cloth.masses.mean() * sim.GRAVITY)  # [N] of a vertex on Earth, whatever the step's own
    free = np.setdiff1d(np.arange(len(x)), np.asarray(cloth.pins))
    variable = torch.as_tensor(x).clone().requires_grad_(True)
    total = torch.stack([energy.energy(variable).sum() for energy in potential.energies]).sum()
    (gradient,) = torch.autograd.grad(total, variable)
    residual = float(gradient[torch.as_tensor(free)].abs().max()) / weight
    hessian = dense_hessian(potential.energies, x)
    places = (3 * free[:, None] + np.arange(3)).ravel()
    hessian = hessian[np.ix_(places, places)]
    if not np.isfinite(hessian).all():
        return OptimalityCheck(residual, 0.0, float("-inf"), 0.0)
    values = np.linalg.eigvalsh(hessian)
    stiffest = float(np.abs(np.diagonal(hessian)).max())
    round_off = 8 * np.finfo(float).eps * stiffest * float(np.abs(x).max()) / weight
    width = float(np.sqrt(cloth.areas.sum()))
    # Round-off of the eigenvalues, or a curvature that gains less than the tolerance over the width.
    zero = max(2e-13 * float(np.abs(values).max()), 2 * RELATIVE_RESIDUAL * weight / width)
    return OptimalityCheck(residual, min(round_off, ROUND_OFF), float(values[0]), zero)


def dense_hessian(terms: Sequence[energies.Energy], x: np.ndarray) -> np.ndarray:
    """Return the Hessian (3V, 3V) [N/m] from the second derivatives of each element's definition."""
    total = np.zeros((x.size, x.size))
    for energy in terms:
        if energy.name == "gravity":  # linear
            continue
        places = (3 * energy.stencils[:, :, None] + np.arange(3)).reshape(len(energy.stencils), -1)
        rows, columns = np.broadcast_arrays(places[:, :, None], places[:, None, :])
        np.add.at(total, (rows, columns), energies.Energy.hessian_blocks(energy, x))
    return total
