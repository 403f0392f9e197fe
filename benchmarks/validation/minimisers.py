"""Properties of a minimiser: one step on a quadratic, order two near the end, no rise, no saddle."""

from __future__ import annotations

from functools import partial

import numpy as np

import reference_sim as sim
from benchmarks.meshes import jittered_patch, right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.equilibrium import (
    demand_converged,
    ends,
    farthest,
    fit_order,
    flat_cloth,
    minimum,
)
from reference_sim import energies

LBFGS_STEPS = 60
TWO_CYCLE = 1.0886617668


@known_answer(expected=2.0, tolerance=0.0, reason="Newton's method ends a quadratic in one step")
def newton_quadratic() -> float:
    """Return the factorisations for inertia and weight alone: one to step, one to confirm the minimum."""
    cloth = _patch(5)
    inertia, rest = energies.Inertia(cloth, 1 / 30), cloth.rest_positions
    inertia.x_hat = rest + np.random.default_rng(0).normal(0, 0.1, rest.shape)
    potential = sim.Potential([inertia, energies.Gravity(cloth)])
    result = demand_converged(sim.minimise(potential, rest), "the minimiser")
    return float(result.factorisations)


@known_answer(expected=2.0, tolerance=0.4, reason="three steps are left between 1e-3 m and round-off")
def newton_order() -> float:
    """Return the order of the last steps of Newton's method: slope of log error over log error before."""
    potential, start = _pull_sheet()
    end = minimum(potential.energies, start, tolerance=1e-13)
    run = partial(sim.minimise, potential, start, tolerance=1e-13)
    errors = [float(np.abs(run(max_iterations=k).positions - end).max()) for k in range(1, 12)]
    steps = [k for k in range(len(errors) - 1) if errors[k] < 1e-3 and errors[k + 1] > 1e-15]
    return fit_order([errors[k + 1] for k in steps], [errors[k] for k in steps])


@known_answer(expected=0.0, tolerance=1e-12, reason="round-off of the energy")
def newton_never_rises() -> float:
    """Return the largest rise of the energy from one kept point to the next, over the first energy.

    From random places; and from the edge of a two-cycle: for log cosh y, Newton's method goes from y to
    y - sinh y cosh y, which is -y at TWO_CYCLE. A little further out every full step rises a little.
    """
    cloth = _patch(6)
    inertia = energies.Inertia(cloth, 1 / 30)
    anywhere = np.random.default_rng(4).uniform(-0.15, 0.15, cloth.rest_positions.shape)
    inertia.x_hat = anywhere
    crumpled = _potential(cloth, energies.Gravity(cloth), inertia)
    cloth = _patch(2)
    edge = np.full(cloth.rest_positions.shape, TWO_CYCLE + 1e-6)
    return max(_rise(crumpled, anywhere, 25), _rise(sim.Potential([LogCosh(cloth)]), edge, 3))


def _rise(potential: sim.Potential, start: np.ndarray, steps: int) -> float:
    values = [potential.value(start)]
    for k in range(1, steps):
        values.append(sim.minimise(potential, start, max_iterations=k).energy)
    return float(max(np.diff(values).max(), 0.0) / abs(values[0]))


class LogCosh(energies.Energy):
    """Sum of log cosh of every coordinate: convex, and too flat outside for full Newton steps."""

    name = "log_cosh"

    def __init__(self, cloth: sim.Cloth) -> None:
        self.cloth = cloth
        self.stencils = np.arange(cloth.vertex_count)[:, None]

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum and its gradient, tanh."""
        return float(np.log(np.cosh(x)).sum()), np.tanh(x)

    def hessian_blocks(self, x: np.ndarray) -> np.ndarray:
        """Return 1 / cosh^2 on the diagonals, (V, 3, 3)."""
        return np.eye(3) / np.cosh(x)[:, :, None] ** 2


@known_answer(expected=0.0, tolerance=1e-3, reason="what Newton's method calls a negligible step")
def newton_wants_small_steps() -> float:
    """Return the edge lengths from rest at which the default tolerance leaves a very soft strip.

    Its own weight, of a ten millionth of the Earth's gravity, is below that tolerance from the start; but
    the strip sags by a fifth of an edge.
    """
    points, faces = right_grid(2, 20, 0.1, 1.0)
    material = sim.Material(bending_stiffness=1e-5)
    cloth = flat_cloth(points, faces, material, held=points[:, 0] < 0.06, lies=True)
    flat = cloth.rest_positions
    potential = _potential(cloth, energies.Gravity(cloth, acceleration=3e-6))
    loose, tight = (minimum(potential.energies, flat, tolerance=small) for small in (1e-6, 1e-10))
    if np.abs(tight - flat).max() < 0.005:
        raise RuntimeError("the strip hardly sags: nothing is proved")
    return float(np.linalg.norm(loose - tight, axis=1).max() / cloth.edge_lengths.mean())


@known_answer(expected=0.0, tolerance=0.0, reason="a minimum has none")
def newton_leaves_saddles() -> float:
    """Return the number of negative eigenvalues where a flat, compressed sheet is said to have come to rest.

    It starts perfectly flat: without a force out of its plane, but not at a minimum.
    """
    points, faces = jittered_patch(6)
    cloth = flat_cloth(points, faces, held=ends(points), size=0.3)
    potential, flat = _potential(cloth), cloth.rest_positions * [0.9, 1.0, 1.0]
    free = np.repeat(cloth.free, 3)
    hessian = potential.hessian(minimum(potential.energies, flat)).toarray()
    values = np.linalg.eigvalsh(hessian[np.ix_(free, free)])
    return float((values < -1e-9 * values[-1]).sum())


@known_answer(unit="m", expected=0.0, tolerance=1e-6, reason="2e-7, and 15 times that without its memory")
def lbfgs_distance() -> float:
    """Return the distance of the end of 60 steps of L-BFGS to Newton's, where there is one minimiser."""
    potential, start = _pull_sheet()
    newton = minimum(potential.energies, start, tolerance=1e-12)
    result = sim.minimise(
        potential, start, "lbfgs", finish=False, max_iterations=LBFGS_STEPS, tolerance=1e-12
    )
    return farthest(result.positions, newton)


def _patch(cells: int) -> sim.Cloth:
    return flat_cloth(*jittered_patch(cells), size=0.3)


def _potential(cloth: sim.Cloth, *extras: energies.Energy) -> sim.Potential:
    return sim.Potential([energies.StretchStVK(cloth), energies.BendHinge(cloth), *extras])


def _pull_sheet() -> tuple[sim.Potential, np.ndarray]:
    """Return one step of a sheet pulled to 1.2 of its width: tension everywhere, and one minimiser."""
    points, faces = right_grid(8, 8, 0.3, 0.3)
    cloth = flat_cloth(points, faces, sim.Material(poisson_ratio=0.0), held=ends(points))
    inertia = energies.Inertia(cloth, 1 / 30)
    start = cloth.rest_positions * [1.2, 1.0, 1.0]
    inertia.x_hat = start
    noise = np.random.default_rng(3).normal(0, 0.003, start.shape)
    potential = _potential(cloth, energies.Gravity(cloth), inertia)
    return potential, np.where(cloth.free[:, None], start + noise, start)
