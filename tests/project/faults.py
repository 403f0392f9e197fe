"""One-line faults in the physics, in its minimisers and in a metric; test_mutations.py plants them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One line of `file` in which `right`, at its first place, becomes `wrong`."""

    title: str
    file: str
    right: str
    wrong: str
    fast: tuple[str, ...] = ()  # checks that notice it without compiling anything anew


MATERIAL, CLOTH, TIME_STEP = (f"reference_sim/{name}.py" for name in ("material", "cloth", "time_step"))
STVK, HINGE, CONTACT = (
    f"reference_sim/energies/{name}/definition.py"
    for name in ("stretch_stvk", "bend_hinge", "contact_penalty")
)
SPRING, BARRIER, GRAVITY, INERTIA, FRICTION = (
    f"reference_sim/energies/{name}.py"
    for name in ("stretch_spring", "area_barrier", "gravity", "inertia", "contact_friction")
)
NEWTON, CHECK, FACTORISED, DESCENT, HISTORY = (
    f"reference_sim/minimise/{name}.py"
    for name in ("newton", "convergence_check", "factorised", "descent", "two_loop")
)
PATTERN, CURVATURE = "reference_sim/assembly/hessian_pattern.py", "benchmarks/metrics/surface/curvature.py"

FAULTS = (
    # material and rest state
    Fault("mu without the thickness", MATERIAL, "self.thickness * self.young_modulus / (2",
          "self.young_modulus / (2"),
    Fault("lambda of plane strain", MATERIAL, "(1 - self.poisson_ratio**2)",
          "((1 + self.poisson_ratio) * (1 - 2 * self.poisson_ratio))"),
    Fault("areal density without the thickness", MATERIAL, "return self.density * self.thickness",
          "return self.density"),
    Fault("hinges of ten times the stiffness", MATERIAL, "bending_stiffness: float = 3.96e-5",
          "bending_stiffness: float = 3.96e-4"),
    Fault("gravity of 9.8", MATERIAL, "GRAVITY = 9.81", "GRAVITY = 9.8"),
    Fault("membrane modulus of lambda + mu", MATERIAL, "/ (lam + 2 * mu)\n", "/ (lam + mu)\n"),
    Fault("areas doubled", CLOTH, "0.5 * np.abs(np.linalg.det", "1.0 * np.abs(np.linalg.det"),
    Fault("half a face's mass to each corner", CLOTH, "np.repeat(self.areas / 3, 3), minlength",
          "np.repeat(self.areas / 2, 3), minlength"),
    Fault("rest frame transposed", CLOTH, "np.stack([zero, across], -1)], axis=1)",
          "np.stack([zero, across], -1)], axis=2)"),
    Fault("mean instead of sum of hinge areas", CLOTH, ".sum(axis=1)\n\n\ndef check_mesh",
          ".mean(axis=1)\n\n\ndef check_mesh"),
    # membrane
    Fault("lambda and mu swapped", STVK, "self.lam = cloth.material.lame_lambda",
          "self.lam = cloth.material.lame_mu", fast=("membrane_equibiaxial",)),
    Fault("energy of the trace doubled", STVK, "(0.5 * lam * trace * trace", "(1.0 * lam * trace * trace"),
    Fault("shear counted once", STVK, "2 * G01 * G01", "G01 * G01"),
    Fault("F transposed in its first column", STVK, "ax * d00 + bx * d10", "ax * d00 + bx * d01"),
    Fault("force by the transposed Dm", STVK, "ux * d00 + vx * d01", "ux * d00 + vx * d10"),
    Fault("half the shear stress in the force", STVK, "S01 = area * (2 * mu * G01)",
          "S01 = area * (mu * G01)"),
    Fault("first vertex feels one neighbour", STVK, "-ax - bx, -ay - by", "-ax, -ay"),
    Fault("geometric stiffness with the wrong sign", STVK, "s = a0 * (s00 *", "s = -a0 * (s00 *"),
    Fault("material stiffness with swapped vertices", STVK, "m * (cx * ay)", "m * (ax * cy)"),
    Fault("strain as seen from above", STVK, " + pz * pz - 1.0", " - 1.0"),
    Fault("half a spring's force", SPRING, "s = 2 * stiffness * stretch", "s = stiffness * stretch"),
    Fault("slack springs stiff across", SPRING, "slack = (1 - self", "slack = (1 + self"),
    Fault("half the barrier's first slope", BARRIER, "(2 * (q - q0) * log +", "(1 * (q - q0) * log +"),
    Fault("half the barrier's middle curvature", BARRIER, "(2 * log + 4 *", "(2 * log + 2 *"),
    # hinges
    Fault("rest angle added", HINGE, "theta -= rest", "theta += rest"),
    Fault("half the hinge stiffness", HINGE, "k, s = u[12", "k, s = 0.5 * u[12"),
    Fault("hinge energy doubled", HINGE, "= 0.5 * s * theta", "= s * theta"),
    Fault("hinge angle with the wrong sign", HINGE, "arctan2(sine, ax", "arctan2(-sine, ax"),
    Fault("angle wrapped to [0, 2 pi)", HINGE, "np.floor((theta + np.pi) / (2 * np.pi))",
          "np.floor(theta / (2 * np.pi))"),
    Fault("angle not wrapped", HINGE, "return theta - 2 * np.pi * np.floor((theta + np.pi) / (2 * np.pi))",
          "return theta"),
    Fault("second tip pushed the wrong way", HINGE, "= b2 * bx, b2 * by", "= -b2 * bx, -b2 * by"),
    Fault("ends of the hinge swapped", HINGE, "foot_a * a, foot_b * b\n", "foot_b * a, foot_a * b\n"),
    Fault("length-area scale twice too large", HINGE, "/ (4 * cloth.hinge_areas)",
          "/ (2 * cloth.hinge_areas)"),
    Fault("curvature of theta with the wrong sign", HINGE, "= (1.0 - convexity) * u[12",
          "= -(1.0 - convexity) * u[12"),
    # weight and inertia
    Fault("weight upwards in the force", GRAVITY, "gradient[:, 1] = self.weights",
          "gradient[:, 1] = -self.weights"),
    Fault("weight along x", GRAVITY, "gradient[:, 1] = self.weights", "gradient[:, 0] = self.weights"),
    Fault("inertia over dt in the force", INERTIA, "gradient = (self.masses / self.dt**2)",
          "gradient = (self.masses / self.dt)"),
    Fault("inertia over dt in the Hessian", INERTIA, "return (self.masses / self.dt**2)",
          "return (self.masses / self.dt)"),
    Fault("inertia's energy doubled", INERTIA, "0.5 * float(np.einsum", "1.0 * float(np.einsum"),
    Fault("velocity forgets dt", INERTIA, "step.previous + step.dt * step.velocity",
          "step.previous + step.velocity"),
    Fault("velocity backwards", INERTIA, "step.previous + step.dt * step.velocity",
          "step.previous - step.dt * step.velocity", fast=("free_fall",)),
    Fault("pins jump in the first sub-step", TIME_STEP, "handles = (1 - share) * handles + share * pins",
          "handles = pins"),
    Fault("an obstacle moves on as fast in sub-steps", "reference_sim/obstacle.py",
          "fine._substeps = self._substeps * substeps", "fine._substeps = self._substeps"),
    Fault("velocity over the square of dt", TIME_STEP, "(x - before) / self.dt", "(x - before) / self.dt**2"),
    Fault("sub-steps of a whole frame", TIME_STEP, "self.frame_dt, self.dt = dt, dt / substeps",
          "self.frame_dt, self.dt = dt, dt"),
    # contact
    Fault("contact dropped from the force", CONTACT, "if depth > 0.0:", "if depth > 1e9:"),
    Fault("contact force of a square", CONTACT, "force = -3.0 *", "force = -2.0 *"),
    Fault("contact that pulls", CONTACT, "force = -3.0 *", "force = 3.0 *"),
    Fault("margin beneath the skin", CONTACT, "max(margin - distance, 0.0)", "max(-margin - distance, 0.0)"),
    Fault("contact stiffness without the area", CONTACT, "stiffness * self.sample_areas",
          "stiffness * np.ones_like(self.sample_areas)"),
    Fault("edges carry half as much again", CONTACT, "np.repeat(cloth.areas / 3, 3), len(edges))",
          "np.repeat(cloth.areas / 2, 3), len(edges))"),
    Fault("half the contact stiffness", CONTACT, "6.0 * stiffness", "3.0 * stiffness"),
    Fault("friction of two thirds of the force", FRICTION, "coefficient * 3 *", "coefficient * 2 *"),
    Fault("friction in proportion to slip", FRICTION, "(2 / h - y / (h * h))  #", "(1 / h)  #"),
    Fault("a first step without friction", FRICTION, "self._coulomb(samples, skin, planes.normals)",
          "0 * self._coulomb(samples, skin, planes.normals)"),
    Fault("friction against the ground, not its skin", FRICTION, "samples + planes.points - skin",
          "samples + planes.points - planes.points"),
    # minimisers
    Fault("Newton uphill", NEWTON, "        p = self.solve(-self.g)\n        return p, projection",
          "        p = self.solve(self.g)\n        return p, projection"),
    Fault("any step will do", DESCENT, "return after <= before + SUFFICIENT_DECREASE * slope", "return True"),
    Fault("Armijo with the wrong sign", DESCENT, "return after <= before + SUFFICIENT_DECREASE * slope",
          "return after <= before - SUFFICIENT_DECREASE * slope"),
    Fault("convergence ignores the gradient", NEWTON, "if run.gradient_norm() > run.target:", "if False:"),
    Fault("convergence ignores the step", CHECK, "small = step <= step_tolerance or", "small = True or"),
    Fault("tolerance a hundred thousand times too loose", NEWTON, "run.target = max(self.tolerance, min(",
          "run.target = max(1e5 * self.tolerance, min("),
    Fault("gradient of one vertex only", DESCENT, "float(np.abs(self.g).max(initial=0.0))",
          "float(np.abs(self.g[:3]).max(initial=0.0))"),
    Fault("pinned vertices move", CLOTH, "free[self.pins] = False", "free[self.pins[:1]] = False"),
    Fault("saddles pass for minima", CHECK, "if run.factorise(values, run.hessian.tiny_shift(values)):",
          "if run.factorise(values, run.hessian.tiny_shift(values)) or True:"),
    Fault("shift in place of the Hessian", FACTORISED,
          "values[self._pattern.diagonal] += shift * self.metric",
          "values[self._pattern.diagonal] = shift * self.metric"),
    Fault("half Newton steps", DESCENT, "step[self.free] = p.reshape(-1, 3)",
          "step[self.free] = 0.5 * p.reshape(-1, 3)"),
    Fault("L-BFGS adds what it should take away", HISTORY, "q[i] -= alphas", "q[i] += alphas"),
    Fault("L-BFGS pairs the gradient alone", DESCENT, "history.add(alpha * p, self.g - g)",
          "history.add(alpha * p, self.g)"),
    Fault("block transposed in the sparse matrix", PATTERN, "key = column * n + row",
          "key = row * n + column"),
    Fault("lower half only", PATTERN, "lower + sp.tril(lower, -1).T", "lower"),
    # the metric that judges
    Fault("curvature over 2 A", CURVATURE, "np.divide(norm, 4.0 * area", "np.divide(norm, 2.0 * area"),
    Fault("barycentric cells at half weight", CURVATURE, "weighted) / 8.0", "weighted) / 6.0"),
)  # fmt: skip
