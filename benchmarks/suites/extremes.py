"""Suite extremes: one hard step each. It has to converge truly, or to fail and say so.

What counts as passing: the energy did not rise, everything is finite, and a claim of convergence is true.
The claim is judged by another path than the solver's: gradient and Hessian come from automatic
differentiation of each term's torch definition. A false claim is a failed row; an honest "stalled",
"diverged" or "timeout" keeps that name and its reason.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..results import Row

if TYPE_CHECKING:
    import numpy as np

    from reference_sim import Potential, Result

METHOD = "simulation"
TOLERANCE = 1e-6  # largest gradient component over the mean weight of a vertex
TIMEOUT = 30.0  # [s]


@dataclass(frozen=True, kw_only=True)
class Case:
    """One hard step; `function` of benchmarks.checks.hard_steps gives its potential and initial guess."""

    name: str
    description: str
    function: str


CASES = (
    Case(name="stiffness_x1000", function="stiffness_up", description="Young's modulus 70 MPa, noisy"),
    Case(name="stiffness_x0.001", function="stiffness_down", description="Young's modulus 70 Pa, noisy"),
    Case(name="time_step_1s", function="long_step", description="one step of a second, thrown at 1 m/s"),
    Case(name="gravity_x1000", function="heavy", description="weight a thousand times the Earth's"),
    Case(name="random_start", function="random_start", description="every vertex anywhere in 0.4 m"),
    Case(name="compression_70", function="compressed", description="pushed to 30 % of its width, flat"),
    Case(name="all_at_one_point", function="one_point", description="all vertices at one point: a saddle"),
    Case(name="body_teleport", function="teleport", description="a sphere appears inside the resting sheet"),
)


@dataclass(frozen=True)
class HardStep:
    """A prepared potential, the guess (V,3) [m] to start from, pins and the mean weight of a vertex [N]."""

    potential: Potential
    guess: np.ndarray
    pins: np.ndarray
    weight: float


@dataclass(frozen=True)
class Verdict:
    """What is true of the end of a hard step: independent gradient norm, status and reason of the row."""

    value: float | None
    status: str
    reason: str


def run_case(case: Case) -> Row:
    """The row of one case: value = independent gradient norm in vertex weights."""
    terms = ""
    try:
        step: HardStep = getattr(importlib.import_module("benchmarks.checks.hard_steps"), case.function)()
        terms = "+".join(energy.name for energy in step.potential.energies)
        from reference_sim import minimise

        verdict = judge(step, minimise(step.potential, step.guess, tolerance=TOLERANCE, timeout=TIMEOUT))
    except Exception as error:
        verdict = Verdict(None, "failed", f"{type(error).__name__}: {error}")
    return Row(
        suite="extremes",
        scene=case.name,
        method=METHOD,
        seed=0,
        metric="outcome",
        unit="vertex weights",
        value=verdict.value,
        status=verdict.status,
        reason=verdict.reason,
        expected=0.0,
        tolerance=TOLERANCE,
        terms=terms,
    )


def judge(step: HardStep, result: Result) -> Verdict:
    """The claim of the solver, held against what is found independently."""
    import numpy as np

    if not np.isfinite(result.positions).all():
        return Verdict(None, "failed", "the positions are not finite")
    truth = _independent(step, result.positions)
    norm = truth.gradient_norm
    if not np.isfinite(norm):
        return Verdict(None, "failed", "the gradient at the end is not finite")
    before = step.potential.value(step.guess)
    after = step.potential.value(result.positions)
    if after > before + 1e-12 * abs(before):
        return Verdict(norm, "failed", f"the energy rose from {before:.6g} to {after:.6g} J")
    if result.status != "converged":
        status = {"max_iterations": "stalled"}.get(result.status, result.status)
        return Verdict(norm, status, f"{result.iterations} iterations: {result.reason}")
    # Round-off of positions times stiffness bounds what any solver can reach.
    if norm > max(TOLERANCE, truth.floor):
        return Verdict(norm, "failed", f"claims convergence at a gradient of {norm:.3g} vertex weights")
    if truth.lowest < -1e-9 * truth.highest:
        return Verdict(norm, "failed", f"claims convergence on a saddle: curvature {truth.lowest:.3g} N/m")
    return Verdict(norm, "ok", f"{result.iterations} iterations")


@dataclass(frozen=True)
class _Truth:
    gradient_norm: float  # [vertex weights], free vertices
    floor: float  # what round-off does to it
    lowest: float  # smallest eigenvalue of the Hessian over free vertices [N/m]
    highest: float


def _independent(step: HardStep, positions: np.ndarray) -> _Truth:
    """Gradient and Hessian by automatic differentiation of the definitions; no kernel takes part."""
    import numpy as np
    import torch

    free = np.setdiff1d(np.arange(len(positions)), step.pins)
    fixed = torch.as_tensor(positions)

    def total(part: torch.Tensor) -> torch.Tensor:
        x = fixed.index_copy(0, torch.as_tensor(free), part.reshape(-1, 3))
        return torch.stack([energy.energy(x).sum() for energy in step.potential.energies]).sum()

    at = fixed[torch.as_tensor(free)].flatten().requires_grad_(True)
    (gradient,) = torch.autograd.grad(total(at), at, create_graph=True)
    hessian = torch.stack([torch.autograd.grad(part, at, retain_graph=True)[0] for part in gradient])
    norm = float(gradient.detach().abs().max()) / step.weight
    if not torch.isfinite(hessian).all():
        return _Truth(norm, 0.0, float("-inf"), float("inf"))
    values = torch.linalg.eigvalsh(hessian)
    floor = 8 * np.finfo(float).eps * float(hessian.diagonal().abs().max()) * np.abs(positions).max()
    return _Truth(norm, floor / step.weight, float(values[0]), float(values[-1]))
