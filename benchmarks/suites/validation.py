"""Suite validation: numbers whose exact value is known before anything is computed."""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass

from ..results import Row

METHOD = "simulation"


@dataclass(frozen=True, kw_only=True)
class Check:
    """One number: what it is, what it must be and how far it may be off. `reason` defends the tolerance."""

    name: str
    description: str
    unit: str
    expected: float
    tolerance: float
    reason: str
    module: str
    function: str

    def measure(self) -> float:
        """Compute the number; slow ones take a few seconds."""
        return float(getattr(importlib.import_module(f"benchmarks.checks.{self.module}"), self.function)())


CHECKS = (
    Check(
        name="membrane_closed_forms",
        description="energy of five homogeneous states of a rotated, unstructured patch",
        unit="1", expected=0.0, tolerance=1e-12, reason="round-off of some hundred triangles",
        module="membrane", function="closed_forms",
    ),
    Check(
        name="membrane_energy_scikit_fem",
        description="membrane energy beside scikit-fem's assembly, random 3D state",
        unit="1", expected=0.0, tolerance=1e-12, reason="round-off",
        module="membrane", function="scikit_fem_energy",
    ),
    Check(
        name="membrane_gradient_scikit_fem",
        description="membrane gradient beside scikit-fem's assembly",
        unit="1", expected=0.0, tolerance=1e-12, reason="round-off",
        module="membrane", function="scikit_fem_gradient",
    ),
    Check(
        name="membrane_hessian_scikit_fem",
        description="membrane Hessian beside scikit-fem's assembly",
        unit="1", expected=0.0, tolerance=1e-12, reason="round-off",
        module="membrane", function="scikit_fem_hessian",
    ),
    Check(
        name="rigid_motion_force",
        description="largest force after a rigid motion of a flat patch, hinges on",
        unit="N", expected=0.0, tolerance=1e-11, reason="round-off of a membrane of 33 N/m moved by 4 m",
        module="membrane", function="rigid_motion",
    ),
    Check(
        name="rigid_zero_modes",
        description="zero eigenvalues of the Hessian of a flat patch, hinges on",
        unit="1", expected=6.0, tolerance=0.0, reason="three translations and three rotations, no other",
        module="membrane", function="zero_modes",
    ),
    Check(
        name="free_fall",
        description="largest distance to backward Euler's own discrete fall over 45 frames",
        unit="m", expected=0.0, tolerance=1e-12, reason="round-off over a fall of 11 m",
        module="dynamics", function="free_fall",
    ),
    Check(
        name="stretched_membrane_vibration",
        description="largest error of the lowest mode over 30 steps, as a share of its start",
        unit="1", expected=0.0, tolerance=1e-8, reason="the mode's own nonlinearity, (pi amplitude)^2",
        module="dynamics", function="membrane_vibration",
    ),
    Check(
        name="momentum_balance",
        description="largest error of P' - P = dt sum F over the steps of a crumpling free sheet",
        unit="1", expected=0.0, tolerance=2e-6, reason="the residual gradient that the solver may leave",
        module="dynamics", function="momentum_balance",
    ),
    Check(
        name="energy_inequality",
        description="largest rise of a step's objective above its start, over the kinetic energy",
        unit="1", expected=0.0, tolerance=1e-9, reason="backward Euler only ever loses energy; round-off",
        module="dynamics", function="energy_inequality",
    ),
    Check(
        name="penalty_depth",
        description="resting depth of a sheet on a plane, as a multiple of sqrt(rho g / (3 k))",
        unit="1", expected=1.0, tolerance=1e-3, reason="the depth follows the load by a square root",
        module="contact", function="penalty_depth",
    ),
    Check(
        name="contact_force_is_weight",
        description="total contact force over weight of a sheet at rest on a plane",
        unit="1", expected=1.0, tolerance=2e-6, reason="the residual gradient that the solver may leave",
        module="contact", function="contact_force",
    ),
    Check(
        name="hanging_strip_tip",
        description="tip of a 1 m strip (lambda = 0) hanging by its top, against its exact curve",
        unit="m", expected=1.0281999567, tolerance=2e-6, reason="second order in 1/24 of the length",
        module="statics", function="hanging_strip_tip",
    ),
    Check(
        name="curvature_sphere",
        description="largest relative error of mean curvature on a sphere of 642 vertices",
        unit="1", expected=0.0, tolerance=1e-3, reason="second order in cells of a tenth of the radius",
        module="geometry", function="sphere_curvature",
    ),
    Check(
        name="curvature_torus_order",
        description="order at which mean curvature converges on a torus, worst vertex",
        unit="1", expected=2.0, tolerance=0.1, reason="mixed Voronoi areas are second order there",
        module="geometry", function="torus_order",
    ),
    Check(
        name="curvature_cylinder",
        description="mean curvature of a cylinder of radius 0.1 m, mean over interior vertices",
        unit="1/m", expected=5.0, tolerance=1e-9, reason="exact for vertices on a circle; round-off",
        module="geometry", function="cylinder_curvature",
    ),
)  # fmt: skip


def run_check(check: Check) -> Row:
    """The row of one check. What a check raises becomes a failed row with the reason."""
    try:
        value = check.measure()
    except Exception as error:
        return _row(check, None, "failed", f"{type(error).__name__}: {error}")
    if math.isfinite(value) and abs(value - check.expected) <= check.tolerance:
        return _row(check, value, "ok", "")
    far = f"{value:.6g} is further than {check.tolerance:g} from {check.expected:g} ({check.reason})"
    return _row(check, value, "failed", far)


def _row(check: Check, value: float | None, status: str, reason: str) -> Row:
    return Row(
        suite="validation",
        scene=check.name,
        method=METHOD,
        seed=0,
        metric="check",
        unit=check.unit,
        value=value,
        status=status,
        reason=reason,
        expected=check.expected,
        tolerance=check.tolerance,
    )
