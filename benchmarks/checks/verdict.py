"""What is true of the end of a hard step, found without the solver's kernels.

Energies, gradient and Hessian come from automatic differentiation of each term's torch definition; the
curvature from all eigenvalues of the dense Hessian. A claim that does not hold is a failure, whatever else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch

from reference_sim import Potential, Result, minimise
from reference_sim.energies import BendHinge, Energy

from .hard_steps import HardStep, sheet

TOLERANCE = 1e-6  # largest gradient component over the mean weight of a vertex
ROUND_OFF = 1e-2  # [vertex weights] what round-off may at most excuse
RISE = 1e-12  # of the sum of the terms' sizes, within the step
BLUR = 1e-6  # of the same: what two evaluations may differ by before the larger one is a rise
BLIND = 1e-9  # share of its area below which round-off alone decides at what angle a triangle stands
TIMEOUT = 20.0  # [s] that the solver gives itself
COLLAPSED = 1e-3  # share of its area below which a triangle has collapsed
STATUS = {"converged": "ok", "max_iterations": "stalled"}


@dataclass(frozen=True)
class Verdict:
    """Independent gradient norm [vertex weights], status and reason of the row, and iterations claimed."""

    value: float | None
    status: str
    reason: str
    iterations: int = 0
    terms: str = ""


def attempt(step: HardStep, solve: Callable[..., Result] = minimise) -> Verdict:
    """Minimise, watched, and judge what came out."""
    kept: list[np.ndarray] = []
    result = solve(step.potential, step.guess, tolerance=TOLERANCE, timeout=TIMEOUT, observe=kept.append)
    return judge(step, result, kept)


def as_simulated(potential: Potential, x0: np.ndarray, **options: Any) -> Result:
    """The simulator's own way through a step: L-BFGS, finished by Newton's method."""
    return minimise(potential, x0, method="lbfgs", **options)


def judge(step: HardStep, result: Result, kept: Sequence[np.ndarray] = ()) -> Verdict:
    """The claim of the solver, and the points it kept on the way, held against what is found here."""
    terms = "+".join(energy.name for energy in step.potential.energies)
    status = STATUS.get(result.status, result.status)

    def verdict(value: float | None, status: str, reason: str) -> Verdict:
        return Verdict(value, status, reason, result.iterations, terms)

    x = result.positions
    if not np.isfinite(x).all():
        return verdict(None, "failed", f"positions that are not finite are called {result.status}")
    if not np.array_equal(x[step.pins], step.guess[step.pins]):
        return verdict(None, "failed", "pinned vertices moved")
    if status == "diverged" and not np.isfinite(energy_of(step.potential, step.guess)[0]):
        return verdict(None, status, result.reason)
    truth = examine(step, x)
    if not np.isfinite(truth.gradient_norm):
        return verdict(None, "failed", f"a gradient that is not finite is called {result.status}")
    rise = first_rise(step.potential, [step.guess, *kept, x])
    if rise:
        return verdict(truth.gradient_norm, "failed", rise)
    if status != "ok":
        reason = f"{result.reason} ({result.iterations} iterations){collapse(step.potential, x)}"
        return verdict(truth.gradient_norm, status, reason)
    if truth.gradient_norm > max(TOLERANCE, truth.floor):
        claim = f"claims convergence at a gradient of {truth.gradient_norm:.3g} vertex weights"
        return verdict(truth.gradient_norm, "failed", claim)
    if truth.lowest < -truth.flat:
        claim = f"claims convergence on a saddle: curvature {truth.lowest:.3g} N/m"
        return verdict(truth.gradient_norm, "failed", claim)
    excused = "; tolerance at round-off" if truth.gradient_norm > TOLERANCE else ""
    return verdict(truth.gradient_norm, "ok", f"{result.iterations} iterations{excused}")


def energy_of(potential: Potential, x: np.ndarray) -> tuple[float, float]:
    """Energy [J] at x (V, 3), and the sum of its terms' sizes, from the definitions."""
    with torch.no_grad():
        parts = [float(energy.energy(torch.as_tensor(x)).sum()) for energy in potential.energies]
    return sum(parts), sum(map(abs, parts))


def first_rise(potential: Potential, points: Sequence[np.ndarray]) -> str:
    """Where the energy rose from one of the points (V, 3) to the next, in words; "" if it never did.

    Beside a collapsed triangle the angle of a hinge is known to a few digits only, and in the end to none:
    there the definition and the solver's kernels differ, and a rise within that difference is none that
    anybody could tell.
    """
    found = [(*energy_of(potential, x), potential.value(x), unknown_energy(potential, x)) for x in points]
    for k, ((before, size, value, here), (after, _, next_value, there)) in enumerate(pairwise(found)):
        blur = min(abs(before - value) + abs(after - next_value), BLUR * size + here + there)
        if not after <= before + RISE * size + blur:
            return f"the energy rose from {before:.17g} to {after:.17g} J at step {k}"
    return ""


def unknown_energy(potential: Potential, x: np.ndarray) -> float:
    """What the hinges of triangles that round-off turns about may hold [J]: all that nobody can tell."""
    if not (blind := areas(potential, x) < BLIND * potential.cloth.areas).any():
        return 0.0
    return float(price_of_collapse(potential)[1][blind].sum())


def areas(potential: Potential, x: np.ndarray) -> np.ndarray:
    """(F,) [m^2] of the triangles at x (V, 3)."""
    corner = x[potential.cloth.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return 0.5 * np.linalg.norm(normal, axis=1)


def collapse(potential: Potential, x: np.ndarray) -> str:
    """How many triangles collapsed, and whether they may: what a stall of these energies comes from.

    A triangle without area has no normal, so that its hinges turn to any angle at no way at all: the energy
    jumps there and takes no minimum. What keeps a triangle from it is its membrane alone.
    """
    names = [energy.name for energy in potential.energies]
    if "bending" not in names:
        return ""
    lost = int((areas(potential, x) < COLLAPSED * potential.cloth.areas).sum())
    words = ""
    if lost:
        plural = "s have" if lost > 1 else " has"
        words = (
            f"; {lost} triangle{plural} collapsed, where a hinge's energy jumps: no minimum need exist, "
            "and the area barrier prevents it"
        )
    cost, gain = price_of_collapse(potential)
    if "area_barrier" not in names and (gain > cost).any():
        face = int(np.argmax(gain - cost))
        words += (
            f"; collapse pays: it costs a triangle at most (lambda + mu)/2 A = {cost[face]:.2g} J and frees "
            f"its hinges of up to sum k pi^2/2 = {gain[face]:.2g} J"
        )
    return words


def price_of_collapse(potential: Potential) -> tuple[np.ndarray, np.ndarray]:
    """Of each face (F,) [J]: at most what its membrane pays for collapsing and its hinges hold."""
    cloth = potential.cloth
    terms = {energy.name: energy for energy in potential.energies}
    m = cloth.material
    cost = 0.5 * (m.lame_lambda + m.lame_mu) * cloth.areas * ("strain" in terms)
    faces = {tuple(sorted(face)): place for place, face in enumerate(cloth.faces.tolist())}
    gain = np.zeros(len(cloth.faces))
    bending = terms.get("bending")
    if isinstance(bending, BendHinge):
        for (a, b, c, d), stiffness in zip(bending.stencils.tolist(), bending.stiffness):
            for corners in ((a, b, c), (a, b, d)):
                gain[faces[tuple(sorted(corners))]] += 0.5 * stiffness * np.pi**2
    return cost, gain


@dataclass(frozen=True)
class Truth:
    """What holds at a point: gradient norm and what round-off does to it [vertex weights]; the smallest
    eigenvalue of the Hessian over free vertices, and the size below which one counts as zero [N/m]."""

    gradient_norm: float
    floor: float
    lowest: float
    flat: float


def examine(step: HardStep, x: np.ndarray) -> Truth:
    """Gradient and curvature at x (V, 3) over the free vertices."""
    potential = step.potential
    free = np.setdiff1d(np.arange(len(x)), step.pins)
    variable = torch.as_tensor(x).clone().requires_grad_(True)
    total = torch.stack([energy.energy(variable).sum() for energy in potential.energies]).sum()
    (gradient,) = torch.autograd.grad(total, variable)
    norm = float(gradient[torch.as_tensor(free)].abs().max()) / step.weight
    hessian = dense_hessian(potential.energies, x)
    places = (3 * free[:, None] + np.arange(3)).ravel()
    hessian = hessian[np.ix_(places, places)]
    if not np.isfinite(hessian).all():
        return Truth(norm, 0.0, float("-inf"), 0.0)
    values = np.linalg.eigvalsh(hessian)
    stiffest = float(np.abs(np.diagonal(hessian)).max())
    floor = 8 * np.finfo(float).eps * stiffest * float(np.abs(x).max()) / step.weight
    width = float(np.sqrt(potential.cloth.areas.sum()))
    # Round-off of the eigenvalues, or a curvature that gains less than the tolerance over the sheet's width.
    flat = max(2e-13 * float(np.abs(values).max()), 2 * TOLERANCE * step.weight / width)
    return Truth(norm, min(floor, ROUND_OFF), float(values[0]), flat)


def dense_hessian(energies: Sequence[Energy], x: np.ndarray) -> np.ndarray:
    """(3V, 3V) [N/m], from the second derivatives of each element's definition."""
    total = np.zeros((x.size, x.size))
    for energy in energies:
        if energy.name == "gravity":  # linear
            continue
        places = (3 * energy.stencils[:, :, None] + np.arange(3)).reshape(len(energy.stencils), -1)
        rows, columns = np.broadcast_arrays(places[:, :, None], places[:, None, :])
        np.add.at(total, (rows, columns), Energy.hessian_blocks(energy, x))
    return total


def warm_up() -> None:
    """Compile what the first case would otherwise have to compile within its time."""
    step = sheet(body="ball", terms="membrane+bending+area")
    judge(step, as_simulated(step.potential, step.guess))
