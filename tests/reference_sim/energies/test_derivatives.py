"""Every energy where nothing is symmetric: closed forms against automatic differentiation.

The reference is the definition (`element_energy`, in torch) through the base class. An energy without a
line in CASES is found by the last test. Hinges are folded by hand too, through half a turn.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from numba import vectorize

from reference_sim import Cloth, Material, energies
from reference_sim.energies import (
    BendHinge,
    ContactFriction,
    ContactPenalty,
    Energy,
    Gravity,
    Inertia,
    StretchSpring,
    StretchStVK,
)
from reference_sim.kernels.lanes import BlockPlaces, arctan2
from tests.reference_sim.meshes import grid, patch, random_rotation


def blocks_of(energy: Energy, x: np.ndarray, convexity: float = 0.0) -> np.ndarray:
    """(N, 3k, 3k) [N/m]: what `add_hessian` adds to matrices that lie one after the other, by columns."""
    count, corners = energy.stencils.shape
    a, b = np.divmod(np.arange(corners**2), corners)
    width = 3 * corners
    base = (width**2 * np.arange(count)[:, None] + 3 * width * b + 3 * a).ravel()
    slots = np.arange(count * corners**2).reshape(count, -1)
    blocks = np.zeros((count, width, width))
    energy.add_hessian(
        x, convexity, BlockPlaces(slots, base, np.full(len(base), width), 3), blocks.reshape(-1)
    )
    return blocks.transpose(0, 2, 1)


def curved_cloth(*, uv: bool = False) -> Cloth:
    """An unstructured patch, 0.3 m wide, bent over a saddle so that nothing about its rest state is flat."""
    x, faces = patch(11, cells=4)
    x = 0.3 * x
    rest = x + np.column_stack([0 * x[:, :2], 2 * x[:, 0] * x[:, 1] + x[:, 0] ** 2])
    return Cloth(rest, faces, Material(), rest_uv=x[:, :2] * [1.1, 0.9] if uv else None)


def deformed(cloth: Cloth, seed: int) -> np.ndarray:
    """Turned, stretched by up to 30 %, folded and crumpled: strains and angles of order one."""
    generator = np.random.default_rng(seed)
    x = cloth.rest_positions @ np.diag([1.3, 0.8, 1.1]) @ random_rotation(seed).T
    return x + generator.normal(0, 0.012, x.shape)  # a sixth of an edge


def contact(cloth: Cloth, **options) -> ContactPenalty:
    """One random plane per sample: about two samples in three are within reach, up to 6 mm deep."""
    energy = ContactPenalty(cloth, **options)
    generator = np.random.default_rng(5)
    normals = generator.normal(size=(len(energy.stencils), 3))
    energy.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    distance = generator.uniform(-0.002, 2.5 * energy.margin, len(normals)) - energy.margin
    samples = energy.sample_matrix @ deformed(cloth, 1)
    along = generator.normal(size=normals.shape)
    along -= (along * energy.normals).sum(1, keepdims=True) * energy.normals
    energy.points = samples - distance[:, None] * energy.normals + 0.1 * along
    return energy


def friction(cloth: Cloth) -> ContactFriction:
    """Random forces and slips: one sample in ten is out of contact, about half of the rest stick."""
    energy = ContactFriction(contact(cloth))
    generator = np.random.default_rng(6)
    count = len(energy.stencils)
    energy.forces = generator.uniform(0.1, 1.0, count) * (generator.uniform(size=count) > 0.1)
    energy.normals = energy.contact.normals
    energy.threshold = 0.01  # [m]: wide enough for finite differences
    slips = generator.normal(size=(count, 3)) * generator.uniform(0, 0.015, (count, 1))
    energy.anchors = energy.contact.sample_matrix @ deformed(cloth, 1) - slips
    return energy


def inertia(cloth: Cloth) -> Inertia:
    energy = Inertia(cloth, 1 / 30)
    energy.x_hat = deformed(cloth, 2)
    return energy


def hinges(cloth: Cloth, scaling: str, rest: str | float | None = None) -> BendHinge:
    angles = np.random.default_rng(9).uniform(-3, 3, len(cloth.hinges)) if rest is None else rest
    return BendHinge(cloth, scaling=scaling, rest_angles=angles)


@dataclass(frozen=True)
class Case:
    """A term, the share of its elements that must be at work, and the sizes below which it tests nothing."""

    name: str
    make: Callable[[Cloth], Energy]
    active: float = 1.0
    uv: bool = False
    scale: float = 1.0  # of the deformed positions
    gradient: float = 1e-6  # [N] of the largest component
    hessian: float = 1e-4  # [N/m]; 0 for a linear term

    def __call__(self) -> tuple[Energy, np.ndarray]:
        cloth = curved_cloth(uv=self.uv)
        return self.make(cloth), self.scale * deformed(cloth, 1)


IN_CONTACT = {"active": 0.5, "gradient": 1e-3, "hessian": 1.0}
PAPER = {"samples": "vertices", "per_sample_stiffness": 250.0, "margin": 2e-3}
CASES = [
    Case("strain", StretchStVK, gradient=1e-1, hessian=10.0),
    Case("strain-uv", StretchStVK, uv=True, gradient=1e-1, hessian=10.0),
    Case("spring", lambda c: StretchSpring(c, stiffness=15.0), gradient=1e-1, hessian=10.0),
    Case("bending", lambda c: hinges(c, "none", 0.0), gradient=1e-4, hessian=1e-2),
    Case("bending-rest-angles", lambda c: hinges(c, "none", "rest"), gradient=1e-4, hessian=1e-2),
    Case("bending-any-angles", lambda c: hinges(c, "none"), gradient=1e-4, hessian=1e-2),
    Case("bending-scaled", lambda c: hinges(c, "length_area", 0.0), gradient=1e-4, hessian=1e-2),
    Case("bending-scaled-any-angles", lambda c: hinges(c, "length_area"), gradient=1e-4, hessian=1e-2),
    Case("gravity", lambda c: Gravity(c, origin_height=0.7), gradient=1e-3, hessian=0.0),
    Case("inertia", inertia, gradient=1e-2, hessian=0.1),
    Case("collision", contact, **IN_CONTACT),
    Case("collision-vertices", lambda c: contact(c, samples="vertices"), **IN_CONTACT),
    Case("collision-paper", lambda c: contact(c, **PAPER), **IN_CONTACT),
    Case("friction", friction, active=0.8, gradient=0.1, hessian=10.0),
]
every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


def close(derivative: np.ndarray, expected: np.ndarray, tolerance: float) -> bool:
    return bool(np.abs(derivative - expected).max() <= tolerance * np.abs(expected).max())


@every_case
def test_closed_gradient_is_that_of_the_definition(case):
    energy, x = case()
    value, gradient = energy.value_and_gradient(x)
    expected_value, expected = Energy.value_and_gradient(energy, x)
    assert np.abs(expected).max() >= case.gradient, "this configuration would pass on zeros"
    assert value == pytest.approx(expected_value, rel=1e-12)  # both sum the same numbers in another order
    assert gradient.shape == x.shape and gradient.dtype == np.float64
    whole = np.round(1e3 * x).astype(int)
    assert close(energy.value_and_gradient(whole)[1], energy.value_and_gradient(1.0 * whole)[1], 0)
    with pytest.raises(ValueError, match="shape" if len(x) > 1 else ""):
        energy.value_and_gradient(x[:-1])
    # Round-off times the condition of the worst hinge, about 1e3 each.
    assert close(gradient, expected, 1e-10)


@every_case
def test_closed_hessian_is_that_of_the_definition_element_by_element(case):
    energy, x = case()
    blocks = blocks_of(energy, x)
    expected = Energy.hessian_blocks(energy, x)
    assert blocks.shape == expected.shape == (len(energy.stencils), *2 * [3 * energy.stencils.shape[1]])
    sizes = np.abs(expected).max(axis=(1, 2))
    if case.hessian == 0:
        assert (blocks == 0).all() and (expected == 0).all()
        return
    assert (sizes > case.hessian / 100).mean() >= case.active, "this configuration would pass on zeros"
    assert sizes.max() >= case.hessian
    # A symmetric definition: what is left is round-off of the two orders of differentiation.
    assert close(blocks, blocks.transpose(0, 2, 1), 1e-14)
    error = np.abs(blocks - expected).max(axis=(1, 2))
    assert (error <= 1e-10 * sizes).all(), f"element {np.argmax(error / np.maximum(sizes, 1e-300))}"


@every_case
def test_what_is_declared_constant_is_the_same_everywhere(case):
    energy, x = case()
    other = 1.1 * x + 0.01
    if 3 in energy.constant:
        assert np.array_equal(blocks_of(energy, x), blocks_of(energy, other))
    if 1 in energy.constant:
        for one, later in zip(energy.scalar_stiffness(x), energy.scalar_stiffness(other), strict=True):
            assert np.array_equal(one, later)


@every_case
def test_convexity_takes_negative_curvature_out_in_proportion(case):
    energy, x = case()
    true, half, convex = (blocks_of(energy, x, convexity) for convexity in (0.0, 0.5, 1.0))
    if not true.any():
        assert not convex.any()
        return
    # Round-off of eigenvalues of the largest block, about 1e-15 of it each.
    assert np.linalg.eigvalsh(convex).min() > -1e-12 * np.abs(convex).max()
    assert np.abs(half - (true + convex) / 2).max() <= 1e-12 * np.abs(convex).max()


@every_case
def test_definition_takes_leading_axes_and_is_the_kernels_energy(case):
    energy, x = case()
    batch = torch.as_tensor(np.stack([x, 1.01 * x, x + 0.002, 0.99 * x, x, x])).reshape(2, 3, *x.shape)
    energies = energy.energy(batch)
    assert energies.shape == (2, 3, len(energy.stencils))
    for i, frame in enumerate(batch.reshape(-1, *x.shape)):
        total = energy.value_and_gradient(frame.numpy())[0]
        assert float(energies.reshape(6, -1)[i].sum()) == pytest.approx(total, rel=1e-12)
    assert energy.energy(batch.float()).dtype == torch.float32  # training decides the precision


def hinge_at(phi: float) -> np.ndarray:
    """An edge along x, one wing in the plane z = 0, the other turned by phi about the edge."""
    return np.array([(0, 0, 0), (1, 0, 0), (0.3, 1, 0), (0.6, -np.cos(phi), -np.sin(phi))])


@pytest.mark.parametrize("phi", [2.9, np.pi - 1e-7, np.pi + 1e-7, 3.4])
@pytest.mark.parametrize("rest", [3.0, -3.0, 0.0])
def test_a_hinge_passes_through_half_a_turn(phi, rest):
    """Across phi = pi atan2 jumps by a full turn; energy, torque and stiffness must not notice.

    The energy takes the shorter way round to the rest angle, so only the point opposite to it is a kink.
    """
    # The edge has length 1 and each face half a square metre: scaled by 1/4, k is 2 J.
    cloth = Cloth(hinge_at(0.0), np.array([(0, 1, 2), (1, 0, 3)]), Material(bending_stiffness=8.0))
    energy, x = BendHinge(cloth, rest_angles=rest), hinge_at(phi)
    way = (phi - rest + np.pi) % (2 * np.pi) - np.pi
    value, gradient = energy.value_and_gradient(x)
    assert value == pytest.approx(way**2, rel=1e-12)
    turn = np.zeros((4, 3))
    turn[3] = (0, np.sin(phi), -np.cos(phi))  # dx/dphi
    assert np.vdot(gradient, turn) == pytest.approx(2 * way, rel=1e-12)  # k (theta - theta_0)
    curve = np.zeros((4, 3))
    curve[3] = (0, np.cos(phi), np.sin(phi))  # d2x/dphi2
    second = turn.ravel() @ blocks_of(energy, x)[0] @ turn.ravel() + np.vdot(gradient, curve)
    assert second == pytest.approx(2.0, rel=1e-12)  # k
    assert close(gradient, Energy.value_and_gradient(energy, x)[1], 1e-10)
    assert close(blocks_of(energy, x), Energy.hessian_blocks(energy, x), 1e-10)


def test_the_arctangent_of_the_kernels_is_that_of_numpy():
    """All around the circle, near its axes and diagonals, at any size."""
    generator = np.random.default_rng(4)
    angles = np.concatenate([generator.uniform(-np.pi, np.pi, 20_000), np.pi / 8 * np.arange(-7, 8)])
    angles = np.concatenate(
        [angles, angles[-15:] + 1e-9, angles[-15:] - 1e-9, 10.0 ** np.arange(-300, 0, 7)]
    )
    size = 10 ** generator.uniform(-100, 100, len(angles))
    y, x = size * np.sin(angles), size * np.cos(angles)
    y[-5:], x[-5:] = [0.0, -0.0, 0.0, 1.0, -1.0], [1.0, 1.0, -1.0, 0.0, 0.0]
    arctangents = vectorize(lambda y, x: arctan2(y, x))(y, x)
    expected = np.arctan2(y, x)
    assert (np.abs(arctangents - expected) <= 2 * np.spacing(np.abs(expected))).all()


SHEET = Cloth(*grid(3, 3, width=0.1, depth=0.1))


@pytest.mark.parametrize(
    "make",
    [
        lambda cloth: ContactPenalty(cloth, margin=float("nan")),
        lambda cloth: ContactPenalty(cloth, per_sample_stiffness=float("inf")),
        lambda cloth: ContactFriction(ContactPenalty(cloth), speed=0.0),
        lambda cloth: Inertia(cloth, float("inf")),
        lambda cloth: BendHinge(cloth, rest_angles=float("nan")),
    ],
)
def test_numbers_that_would_push_or_do_nothing_are_refused(make):
    with pytest.raises(ValueError, match=r"must be (a )?finite number"):
        make(SHEET)


@pytest.mark.parametrize("parent", [StretchStVK, ContactPenalty])
def test_another_definition_states_where_its_derivatives_come_from(parent):
    bent = SHEET.rest_positions + 0.01 * np.sin(40 * SHEET.rest_positions[:, [1, 2, 0]])

    def halved(self, u):
        return 0.5 * parent.element_energy(self, u)

    with pytest.raises(
        TypeError, match=r"Half would inherit closed forms of another energy: write "
    ) as warnings:
        type("Half", (parent,), {"element_energy": halved})
    lines = re.findall(r"(\w+) = Energy\.(\w+)", str(warnings.value))
    Half = type(
        "Half", (parent,), {"element_energy": halved, **{a: getattr(Energy, b) for a, b in lines}}
    )
    whole, half = parent(SHEET), Half(SHEET)
    if parent is ContactPenalty:
        whole.points = half.points = whole.sample_matrix @ bent + [0.0, 1e-3, 0.0]
    value, gradient = half.value_and_gradient(bent)
    assert value == pytest.approx(0.5 * whole.value_and_gradient(bent)[0]) and value > 0
    np.testing.assert_allclose(gradient, 0.5 * whole.value_and_gradient(bent)[1], atol=1e-12)


def test_every_term_has_its_line_above():
    tested = {type(case()[0]).__name__ for case in CASES}
    # Terms that are dynamic have no definition in torch; test_self_contact.py holds theirs.
    terms = {name for name in energies.__all__ if not getattr(getattr(energies, name), "dynamic", True)}
    assert tested == terms - {"Energy"}, f"add to CASES: {', '.join(sorted(terms - tested))}"
