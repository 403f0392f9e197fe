"""The loss of a window is what an independent sum of the paper's formulas gives, in every form of inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from snug.named_recipes import PAPER
from snug.recipe import INERTIA_FORMS, Recipe
from snug.training.physics_loss import PhysicsLoss
from tests.snug.training.dressing import tube_dress

DT = 1 / 30
LAMBDA, MU, DENSITY, HINGE = 20.8638, 11.0774, 0.20022, 3.96e-5  # N/m, N/m, kg/m^2, J
CONTACT, MARGIN, GRAVITY = 1.34e6, 2e-3, 9.81  # J/m^5, m, m/s^2


def normals(x: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return np.cross(x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]])


def membrane(x: np.ndarray, rest: np.ndarray, faces: np.ndarray) -> float:
    """St. Venant-Kirchhoff from lengths alone: the Cauchy-Green tensor in the basis of two rest edges."""
    total = 0.0
    for a, b, c in faces:
        now, still = (np.stack([y[b] - y[a], y[c] - y[a]]) for y in (x, rest))
        metric, home = now @ now.T, still @ still.T
        green = 0.5 * np.linalg.solve(home, metric - home)  # of the same trace and trace of square
        area = 0.5 * np.sqrt(np.linalg.det(home))
        total += area * (0.5 * LAMBDA * np.trace(green) ** 2 + MU * np.trace(green @ green))
    return total


def hinges(x: np.ndarray, rest: np.ndarray, faces: np.ndarray) -> float:
    sides: dict[frozenset, list[int]] = {}
    for number, (a, b, c) in enumerate(faces):
        for edge in ((a, b), (b, c), (c, a)):
            sides.setdefault(frozenset(edge), []).append(number)
    now, areas, total = normals(x, faces), 0.5 * np.linalg.norm(normals(rest, faces), axis=1), 0.0
    for edge, beside in sides.items():
        if len(beside) == 2:
            one, other = now[beside]
            angle = np.arccos(np.clip(one @ other / np.linalg.norm(one) / np.linalg.norm(other), -1, 1))
            a, b = edge
            scale = ((rest[a] - rest[b]) ** 2).sum() / (4 * areas[beside].sum())
            total += 0.5 * HINGE * scale * angle**2
    return total


def masses(rest: np.ndarray, faces: np.ndarray) -> np.ndarray:
    areas = np.zeros(len(rest))
    for face, normal in zip(faces, normals(rest, faces)):
        areas[face] += 0.5 * np.linalg.norm(normal) / 3
    return areas * DENSITY


def window(frames: int):
    """Two windows: cloth in the pelvis' axes, the pelvis [m], points and normals of contact."""
    dressed, random = tube_dress(), np.random.default_rng(frames)
    rest, faces = dressed.garment.rest_positions, dressed.garment.faces
    noise = random.normal(0, 0.004, (2, frames, *rest.shape))
    drift = 0.01 * np.arange(frames)[:, None, None] ** 2 * random.normal(size=(2, 1, 1, 3))
    turn = Rotation.from_rotvec([0.3, 0.2, -0.1]).as_matrix()
    x = ((rest + noise) @ turn.T + drift).astype(np.float32)
    pelvis = np.cumsum(random.normal(0, 0.02, (2, frames, 3)), axis=1)
    direction = random.normal(size=x.shape)
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    points = (x + random.uniform(-0.004, 0.004, (*x.shape[:-1], 1)) * direction).astype(np.float32)
    return dressed, rest, faces, x, pelvis, points, direction.astype(np.float32)


def independent_loss(form: str, rest, faces, x, pelvis, points, direction) -> float:
    x, points, direction = (array.astype(float) for array in (x, points, direction))
    mass, losses = masses(rest, faces), []
    for one, at, plane, normal in zip(x, pelvis, points, direction):
        depth = np.maximum(MARGIN - ((one - plane) * normal).sum(-1), 0)
        static = [
            membrane(y, rest, faces) + hinges(y, rest, faces)
            + GRAVITY * mass @ y[:, 1] + CONTACT / DENSITY * mass @ d**3
            for y, d in zip(one, depth)
        ]  # fmt: skip
        world = one + at[:, None]
        kinetic = [
            (0.5 / DT**2 * mass * ((world[t] - 2 * world[t - 1] + world[t - 2]) ** 2).sum(-1)).sum()
            for t in range(2, len(world))
        ]
        if form == "two_transitions":
            kinetic.append((0.5 / DT**2 * mass * ((world[1] - world[0]) ** 2).sum(-1)).sum())
        losses.append(np.mean(static) + np.mean(kinetic))
    return float(np.mean(losses))


def loss_of(recipe: Recipe, *, copies: int, kernels: bool, frames: int) -> tuple[float, torch.Tensor]:
    """Return the loss that training descends by, and its gradient, of so many copies of the two windows."""
    dressed, _, _, x, pelvis, points, direction = window(frames)
    behind = -np.diff(pelvis, axis=1, prepend=pelvis[:, :1])
    ahead = np.zeros_like(behind)
    ahead[:, 2:] = behind[:, 2:] - behind[:, 1:-1]
    planes = tuple(torch.as_tensor(np.repeat(array, copies, 0)) for array in (points, direction))
    start = torch.as_tensor(x).repeat_interleave(copies, 0).requires_grad_()
    steps = (torch.as_tensor(np.repeat(a, copies, 0)).float() for a in (ahead, behind))
    loss = PhysicsLoss(dressed.cloth, recipe, dt=DT, kernels=kernels)
    terms = loss(start, next(steps), planes, lag=next(steps))
    total = sum(energy.mean() for energy in terms.values())
    total.backward()
    return total.item(), start.grad * copies


@pytest.mark.parametrize("frames", [3, 6])
@pytest.mark.parametrize("form", INERTIA_FORMS)
@pytest.mark.parametrize(("copies", "kernels"), [(1, False), (8, True)], ids=["definitions", "kernels"])
def test_window_loss_is_the_sum_of_the_papers_formulas(form, frames, copies, kernels):
    recipe = replace(PAPER, inertia_form=form)
    loss, _ = loss_of(recipe, copies=copies, kernels=kernels, frames=frames)
    expected = independent_loss(form, *window(frames)[1:])
    assert loss == pytest.approx(expected, rel=1e-5)


def test_a_detached_past_gets_no_gradient_and_the_present_the_same():
    whole, detached = (
        loss_of(replace(PAPER, terms=("inertia",), inertia_form=form), copies=1, kernels=False, frames=3)[
            1
        ]
        for form in ("equation_5", "detached_past")
    )
    assert not detached[:, :2].any() and whole[:, :2].any()
    assert torch.allclose(detached[:, 2], whole[:, 2])
