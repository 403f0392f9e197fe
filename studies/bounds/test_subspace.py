"""Newton's method in a subspace: against the whole space, automatic differentiation and itself."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.autograd import functional

from reference_sim import Cloth, Potential
from reference_sim.energies import BendHinge, Gravity, Inertia, StretchStVK
from subspace import (
    Placement,
    SubspaceHessian,
    SubspaceNewton,
    SubspaceRun,
    orthonormal,
)
from tests.reference_sim.meshes import grid

SHEET, FACES = grid(5, 5, width=0.5, depth=0.5)
COUNT = len(SHEET)
PINS = [0, 5]


def potential() -> Potential:
    """A step of a sheet that hangs from two corners, from a crumpled past."""
    cloth = Cloth(SHEET, FACES, pins=PINS)
    inertia = Inertia(cloth, 1 / 30)
    inertia.x_hat = SHEET + np.random.default_rng(5).normal(0, 0.02, SHEET.shape) * cloth.free[:, None]
    return Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), inertia])


def placed() -> Placement:
    """Vertices turned and sheared each in its own way, around the sheet."""
    noise = np.random.default_rng(2).normal(0, 0.3, (COUNT, 3, 3))
    return Placement(np.eye(3) + noise, SHEET)


def basis(size: int) -> np.ndarray:
    """Smooth waves along both sides, none at the pins; fewer are among more."""
    waves = [
        np.cos(np.pi * a * SHEET[:, 0] / 0.5) * np.cos(np.pi * b * SHEET[:, 2] / 0.5)
        for a, b in sorted(np.ndindex(5, 5), key=sum)
    ][:size]
    flat = np.stack(waves, axis=1)
    flat[PINS] = 0.0
    return orthonormal(np.kron(flat, np.eye(3))).reshape(COUNT, 3, -1)


def solver_of(space: np.ndarray, *placements: Placement) -> SubspaceNewton:
    start = np.zeros((COUNT, 3))
    return SubspaceNewton(potential(), basis=space, placements=placements, offsets=start)


def test_the_residual_of_a_minimum_is_that_of_automatic_differentiation():
    space, terms, placement = basis(6), potential(), placed()
    result = solver_of(space, placement).minimise(SHEET)
    columns, turns = torch.from_numpy(space), torch.from_numpy(placement.turns)

    def energy(q: torch.Tensor) -> torch.Tensor:
        offsets = columns @ q
        x = torch.from_numpy(placement.centre) + (turns @ offsets[..., None])[..., 0]
        inertia = terms.energies[-1]
        total = sum(term.energy(x).sum() for term in terms.energies[:-1])
        return total + inertia.energy(x, torch.from_numpy(inertia.x_hat)).sum()

    q = torch.from_numpy(np.einsum("vik,vi->k", space, placement.unposed(result.positions)))
    weight = terms.cloth.masses.mean() * 9.81
    assert float(energy(q)) == pytest.approx(result.energy, rel=1e-10)
    at_minimum = functional.jacobian(energy, q).abs().max() / weight
    assert at_minimum < 2e-6 and result.gradient_norm < 1e-6
    # Elsewhere too, and second derivatives.
    elsewhere = q + 0.01 * torch.randn(len(q), generator=torch.Generator().manual_seed(0), dtype=q.dtype)
    x = placement.posed(np.einsum("vik,k->vi", space, elsewhere.numpy()))
    solver, free = solver_of(space), terms.cloth.free
    posed = np.einsum("vij,vjk->vik", placement.turns, space)[free].reshape(3 * free.sum(), -1)
    assert isinstance(solver.hessian, SubspaceHessian)
    solver.hessian.basis = posed
    run = SubspaceRun(solver, x, None)
    gradient, hessian = (f(energy, elsewhere).numpy() for f in (functional.jacobian, functional.hessian))
    assert run.gradient_norm() == pytest.approx(np.abs(gradient).max() / weight, rel=1e-8)
    hessian += 1e3 * posed.T @ (solver.hessian.metric[:, None] * posed)
    assert run.factorise(run.assemble(0.0), 1e3)
    direction = posed @ np.linalg.solve(hessian, -gradient)
    assert np.abs(run.solve(-run.g) - direction).max() < 1e-8 * np.abs(direction).max()
    assert not run.factorise(run.assemble(0.0), -1e3)  # not positive definite


def test_a_run_that_starts_again_gives_the_bits_of_the_first():
    steps = [placed(), Placement(placed().turns, SHEET + np.array([0.0, 0.0, 0.01]))]
    solver = solver_of(basis(4), *steps)
    runs = []
    for _ in range(2):
        runs.append([solver.minimise(SHEET).positions for _ in steps])
        solver.start_again()
    assert np.array_equal(*runs)
