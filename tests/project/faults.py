"""One-line faults in the physics, in its minimisers and in a metric; test_mutations.py plants them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One line in which `right`, at its first place in a definition, becomes `wrong`.

    definition: of the line, a function, method, class or constant, as `Material.lame_mu`; of several that
    are called so it is the only one that holds the line. No file is named: the code may move.
    """

    title: str
    definition: str
    right: str
    wrong: str
    fast: tuple[str, ...] = ()  # checks that notice it without compiling anything anew


FAULTS = (
    # material and rest state
    Fault("mu without the thickness", "Material.lame_mu", "self.thickness * self.young_modulus / (2",
          "self.young_modulus / (2"),
    Fault("lambda of plane strain", "Material.lame_lambda", "(1 - self.poisson_ratio**2)",
          "((1 + self.poisson_ratio) * (1 - 2 * self.poisson_ratio))"),
    Fault("areal density without the thickness", "Material.areal_density",
          "return self.density * self.thickness", "return self.density"),
    Fault("hinges of ten times the stiffness", "Material", "bending_stiffness: float = 3.96e-5",
          "bending_stiffness: float = 3.96e-4"),
    Fault("gravity of 9.8", "GRAVITY", "GRAVITY = 9.81", "GRAVITY = 9.8"),
    Fault("membrane modulus of lambda + mu", "Material.membrane_modulus", "/ (lam + 2 * mu)\n",
          "/ (lam + mu)\n"),
    Fault("areas doubled", "Cloth.areas", "0.5 * np.abs(np.linalg.det", "1.0 * np.abs(np.linalg.det"),
    Fault("half a face's mass to each corner", "Cloth.vertex_areas",
          "np.repeat(self.areas / 3, 3), minlength", "np.repeat(self.areas / 2, 3), minlength"),
    Fault("rest frame transposed", "Cloth.frames", "np.stack([zero, across], -1)], axis=1)",
          "np.stack([zero, across], -1)], axis=2)"),
    Fault("mean instead of sum of hinge areas", "Cloth.hinge_areas", ".sum(axis=1)\n", ".mean(axis=1)\n"),
    # membrane
    Fault("lambda and mu swapped", "StretchStVK.__init__", "self.lam = cloth.material.lame_lambda",
          "self.lam = cloth.material.lame_mu", fast=("membrane_equibiaxial",)),
    Fault("energy of the trace doubled", "_gradient", "(0.5 * lam * trace * trace",
          "(1.0 * lam * trace * trace"),
    Fault("shear counted once", "_gradient", "2 * G01 * G01", "G01 * G01"),
    Fault("F transposed in its first column", "_gradient", "ax * d00 + bx * d10", "ax * d00 + bx * d01"),
    Fault("force by the transposed Dm", "_gradient", "ux * d00 + vx * d01", "ux * d00 + vx * d10"),
    Fault("half the shear stress in the force", "_gradient", "S01 = area * (2 * mu * G01)",
          "S01 = area * (mu * G01)"),
    Fault("first vertex feels one neighbour", "_gradient", "-ax - bx, -ay - by", "-ax, -ay"),
    Fault("geometric stiffness with the wrong sign", "_block", "s = a0 * (s00 *", "s = -a0 * (s00 *"),
    Fault("material stiffness with swapped vertices", "_block", "m * (cx * ay)", "m * (ax * cy)"),
    Fault("strain as seen from above", "_gradient", " + pz * pz - 1.0", " - 1.0"),
    Fault("half a spring's force", "_gradient", "s = 2 * stiffness * stretch", "s = stiffness * stretch"),
    Fault("slack springs stiff across", "StretchSpring.active_hessian_blocks", "slack = (1 - self",
          "slack = (1 + self"),
    # hinges
    Fault("rest angle added", "_from_rest", "theta -= rest", "theta += rest"),
    Fault("half the hinge stiffness", "_block", "k, s = u[12", "k, s = 0.5 * u[12"),
    Fault("hinge energy doubled", "_gradient", "= 0.5 * s * theta", "= s * theta"),
    Fault("hinge angle with the wrong sign", "_gradient", "arctan2(sine, ax", "arctan2(-sine, ax"),
    Fault("angle wrapped to [0, 2 pi)", "_from_rest", "np.floor((theta + np.pi) / (2 * np.pi))",
          "np.floor(theta / (2 * np.pi))"),
    Fault("angle not wrapped", "_from_rest",
          "return theta - 2 * np.pi * np.floor((theta + np.pi) / (2 * np.pi))", "return theta"),
    Fault("second tip pushed the wrong way", "_gradient", "= b2 * bx, b2 * by", "= -b2 * bx, -b2 * by"),
    Fault("ends of the hinge swapped", "_gradient", "foot_a * a, foot_b * b\n", "foot_b * a, foot_a * b\n"),
    Fault("length-area scale twice too large", "BendHinge.__init__", "/ (4 * cloth.hinge_areas)",
          "/ (2 * cloth.hinge_areas)"),
    Fault("curvature of theta with the wrong sign", "_hessian", "= (1.0 - convexity) * u[12",
          "= -(1.0 - convexity) * u[12"),
    # weight and inertia
    Fault("weight upwards in the force", "Gravity.value_and_gradient", "gradient[:, 1] = self.weights",
          "gradient[:, 1] = -self.weights"),
    Fault("weight along x", "Gravity.value_and_gradient", "gradient[:, 1] = self.weights",
          "gradient[:, 0] = self.weights"),
    Fault("inertia over dt in the force", "Inertia.value_and_gradient",
          "gradient = (self.masses / self.dt**2)", "gradient = (self.masses / self.dt)"),
    Fault("inertia over dt in the Hessian", "Inertia.hessian_blocks", "return (self.masses / self.dt**2)",
          "return (self.masses / self.dt)"),
    Fault("inertia's energy doubled", "Inertia.value_and_gradient", "0.5 * float(np.einsum",
          "1.0 * float(np.einsum"),
    Fault("velocity forgets dt", "Inertia.prepare", "step.previous + step.dt * step.velocity",
          "step.previous + step.velocity"),
    Fault("velocity backwards", "Inertia.prepare", "step.previous + step.dt * step.velocity",
          "step.previous - step.dt * step.velocity", fast=("free_fall",)),
    Fault("pins jump in the first sub-step", "TimeStepper.advance",
          "handles = (1 - share) * handles + share * pins", "handles = pins"),
    Fault("an obstacle moves on as fast in sub-steps", "Obstacle.refine",
          "fine._substeps = self._substeps * substeps", "fine._substeps = self._substeps"),
    Fault("velocity over the square of dt", "TimeStepper.advance", "(y - x) / self.dt",
          "(y - x) / self.dt**2"),
    Fault("sub-steps of a whole frame", "TimeStepper.__init__", "self.frame_dt, self.dt = dt, dt / substeps",
          "self.frame_dt, self.dt = dt, dt"),
    # contact
    Fault("contact dropped from the force", "_gradient", "if depth > 0.0:", "if depth > 1e9:"),
    Fault("contact force of a square", "_gradient", "force = -3.0 *", "force = -2.0 *"),
    Fault("contact that pulls", "_gradient", "force = -3.0 *", "force = 3.0 *"),
    Fault("margin beneath the skin", "sample_depth", "max(margin - distance, 0.0)",
          "max(-margin - distance, 0.0)"),
    Fault("contact stiffness without the area", "ContactPenalty.__init__", "stiffness * self.sample_areas",
          "stiffness * np.ones_like(self.sample_areas)"),
    Fault("edges carry half as much again", "_samples", "np.repeat(cloth.areas / 3, 3), len(edges))",
          "np.repeat(cloth.areas / 2, 3), len(edges))"),
    Fault("half the contact stiffness", "_curvatures", "6.0 * stiffness", "3.0 * stiffness"),
    Fault("friction of two thirds of the force", "ContactFriction._coulomb", "coefficient * power *",
          "coefficient * 2 *"),
    Fault("friction in proportion to slip", "_gradient", "(2 / h - y / (h * h))  #", "(1 / h)  #"),
    Fault("a first step without friction", "ContactFriction.prepare",
          "self._coulomb(samples, skin, planes.normals)", "0 * self._coulomb(samples, skin, planes.normals)"),
    Fault("friction against the ground, not its skin", "ContactFriction.prepare",
          "samples + planes.points - skin", "samples + planes.points - planes.points"),
    # minimisers
    Fault("Newton uphill", "NewtonRun.direction",
          "        p = self.hessian.solve(-self.g)\n        return p, projection",
          "        p = self.hessian.solve(self.g)\n        return p, projection"),
    Fault("any step will do", "sufficient_decrease", "return end <= start + SUFFICIENT_DECREASE * slope",
          "return True"),
    Fault("Armijo with the wrong sign", "sufficient_decrease",
          "return end <= start + SUFFICIENT_DECREASE * slope",
          "return end <= start - SUFFICIENT_DECREASE * slope"),
    Fault("convergence ignores the gradient", "Newton.terminate", "if run.gradient_norm() > run.target:",
          "if False:"),
    Fault("convergence ignores the step", "convergence_check", "small = step <= step_tolerance or",
          "small = True or"),
    Fault("tolerance a hundred thousand times too loose", "Newton.terminate",
          "run.target = max(self.tolerance, min(", "run.target = max(1e5 * self.tolerance, min("),
    Fault("gradient of one vertex only", "Descent.gradient_norm", "float(np.abs(self.g).max(initial=0.0))",
          "float(np.abs(self.g[:3]).max(initial=0.0))"),
    Fault("pinned vertices move", "Cloth.free", "free[self.pins] = False", "free[self.pins[:1]] = False"),
    Fault("saddles pass for minima", "convergence_check",
          "if run.factorise(values, run.hessian.tiny_shift(values)):",
          "if run.factorise(values, run.hessian.tiny_shift(values)) or True:"),
    Fault("shift in place of the Hessian", "FactorisedHessian.factorise",
          "values[self._pattern.diagonal] += shift * self.metric",
          "values[self._pattern.diagonal] = shift * self.metric"),
    Fault("half Newton steps", "Descent.spread", "step[self.free] = p.reshape(-1, 3)",
          "step[self.free] = 0.5 * p.reshape(-1, 3)"),
    Fault("L-BFGS adds what it should take away", "first_loop", "-alphas[k]", "alphas[k]"),
    Fault("L-BFGS pairs the gradient alone", "Descent.quasi_newton_step",
          "history.add(alpha * p, self.g - g)", "history.add(alpha * p, self.g)"),
    Fault("block transposed in the sparse matrix", "_block_keys", "key = column * n + row",
          "key = row * n + column"),
    Fault("lower half only", "HessianPattern.symmetrise", "lower + sp.tril(lower, -1).T", "lower"),
    # the metric that judges
    Fault("curvature over 2 A", "mean_curvature", "np.divide(norm, 4.0 * area", "np.divide(norm, 2.0 * area"),
    Fault("barycentric cells at half weight", "mean_curvature", "weighted) / 8.0", "weighted) / 6.0"),
)  # fmt: skip
