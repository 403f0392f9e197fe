"""Contact by penalty: depths and forces that are known in advance, friction on a slope, and no grabbing."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import GRAVITY, Cloth, Obstacle, Potential, minimise, simulate
from reference_sim.energies import (
    BendHinge,
    ContactFriction,
    ContactPenalty,
    Energy,
    Gravity,
    Step,
    StretchSpring,
    StretchStVK,
)
from tests.reference_sim.meshes import box, grid, random_rotation, sphere

TABLE = box((-1, -1, -1), (2, 0, 2))  # its top is the plane y = 0
SHEET, FACES = grid(6, 6, width=0.3, depth=0.3)


def up(height: float) -> np.ndarray:
    return np.array([0, height, 0])


def on_the_table(cloth: Cloth, *energies: Energy) -> Potential:
    """Planes taken once, from rest positions 2 mm above the table, and kept."""
    potential = Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), *energies])
    guess = cloth.rest_positions + up(0.002)
    potential.prepare(Step(guess, 0 * guess, guess, 1 / 30, Obstacle(*TABLE), 0))
    return potential


def test_one_sample_per_vertex_rests_at_the_depth_of_the_formula():
    """m g = 3 k_s delta^2. With k per area every vertex sinks alike, so that the sheet stays flat."""
    cloth = Cloth(SHEET, FACES)
    contact = ContactPenalty(cloth, samples="vertices", stiffness=1e5, margin=0.01)
    result = minimise(on_the_table(cloth, contact), SHEET + up(0.005), tolerance=1e-10)
    assert result.status == "converged", result.reason
    k = 1e5 * cloth.vertex_areas
    depth = np.sqrt(cloth.masses * GRAVITY / (3 * k))
    assert 1e-3 < depth.max() < 0.01 and np.ptp(depth) < 1e-15
    # Gradient 1e-10 mean weights, up to 6e-10 of a corner's; slope of the force 2 m g / delta: 3e-10 delta.
    assert result.positions[:, 1] == pytest.approx(0.01 - depth, abs=3e-12)


def test_the_papers_stiffness_per_vertex_depends_on_the_mass_of_the_vertex():
    """One triangle: three equal vertices of a third of its mass, k and eps as in the paper."""
    corners = 0.05 * np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0)], dtype=float)
    cloth = Cloth(corners, np.array([(0, 1, 2)]))
    contact = ContactPenalty(cloth, samples="vertices", per_sample_stiffness=250.0, margin=2e-3)
    result = minimise(on_the_table(cloth, contact), corners + up(0.0015), tolerance=1e-10)
    assert result.status == "converged", result.reason
    mass = cloth.material.areal_density * 0.05**2 / 2 / 3
    depth = np.sqrt(mass * GRAVITY / (3 * 250.0))
    assert result.positions[:, 1] == pytest.approx(2e-3 - depth, abs=1e-11)


def total_force(contact: ContactPenalty, x: np.ndarray) -> np.ndarray:
    """(3,) [N] that the body gives the cloth, added up here from depths and normals."""
    samples = contact.sample_matrix @ x
    depth = contact.margin - np.einsum("si,si->s", contact.normals, samples - contact.points)
    force = 3 * contact.stiffness * np.maximum(depth, 0) ** 2
    assert (force > 0).sum() > 3
    return force @ contact.normals


@pytest.mark.parametrize("samples", ["all", "vertices"])
def test_the_table_carries_the_weight_of_an_uneven_sheet(samples):
    cloth = Cloth(
        SHEET + np.column_stack([0 * SHEET[:, :1], 0.2 * SHEET[:, :1] ** 2, 0 * SHEET[:, :1]]), FACES
    )
    contact = ContactPenalty(cloth, samples=samples)
    result = minimise(on_the_table(cloth, contact), cloth.rest_positions + up(0.003), tolerance=1e-10)
    assert result.status == "converged", result.reason
    force = total_force(contact, result.positions)
    # 49 gradients of at most 1e-10 mean vertex weights each.
    assert force == pytest.approx(
        [0, cloth.masses.sum() * GRAVITY, 0], abs=1e-9 * cloth.masses.sum() * GRAVITY
    )


def test_a_big_sphere_carries_the_weight_of_a_sheet_on_it():
    radius = 0.4
    body, faces = sphere(4, radius)
    cloth = Cloth(SHEET + np.array([-0.15, radius + 0.003, -0.15]), FACES)
    contact = ContactPenalty(cloth)
    trajectory = simulate(
        cloth,
        [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), contact],
        obstacle=Obstacle(body, faces),
        frames=40,
        quasi_static=True,
        tolerance=1e-8,
    )
    assert trajectory.status == "converged", trajectory.reason
    x = trajectory.positions[-1]
    force = total_force(contact, x)
    weight = cloth.masses.sum() * GRAVITY
    # Not quite at rest: forgetting the velocity, the sheet still creeps; momentum per step is the difference.
    creep = cloth.masses @ (x - trajectory.positions[-2]) * 30**2
    assert force - [0, weight, 0] == pytest.approx(creep, abs=1e-7 * weight)
    assert force == pytest.approx([0, weight, 0], abs=0.01 * weight)
    height = np.linalg.norm(x, axis=1) - radius
    assert height.min() > -0.004 and height.max() < 0.02


def test_contact_does_not_depend_on_where_the_scene_stands():
    """The same sheet, table and state, turned and moved: energies agree and forces turn along."""
    cloth = Cloth(SHEET, FACES)
    turn, shift = random_rotation(4), np.array([1.0, -2.0, 0.5])
    x = SHEET + np.random.default_rng(0).normal(0, 0.002, SHEET.shape)
    values = []
    for R, t in ((np.eye(3), np.zeros(3)), (turn, shift)):
        contact = ContactPenalty(cloth)
        obstacle = Obstacle(TABLE[0] @ R.T + t, TABLE[1])
        guess = x @ R.T + t
        contact.prepare(Step(guess, 0 * guess, guess, 1 / 30, obstacle, 0))
        value, gradient = contact.value_and_gradient(guess)
        values.append((value, gradient @ R))
    assert values[0][0] > 1e-5
    assert values[1][0] == pytest.approx(values[0][0], rel=1e-9)
    assert np.abs(values[1][1] - values[0][1]).max() < 1e-9 * np.abs(values[0][1]).max()


def test_no_contact_beyond_the_margin():
    cloth = Cloth(SHEET, FACES)
    contact = ContactPenalty(cloth, margin=0.004)
    for height, touching in ((0.0041, False), (0.0039, True), (-0.01, True)):
        x = SHEET + up(height)
        contact.prepare(Step(x, 0 * x, x, 1 / 30, Obstacle(*TABLE), 0))
        value, gradient = contact.value_and_gradient(x)
        assert (value > 0) == touching and (np.abs(gradient).max() > 0) == touching
        exact = 3 * contact.sample_areas.sum() / 3 * 3.4e6 * max(0.004 - height, 0) ** 3
        assert value == pytest.approx(exact, rel=1e-9)


def slope(angle: float) -> Obstacle:
    """The table turned about z by `angle`: downhill is along -x for positive angles."""
    c, s = np.cos(angle), np.sin(angle)
    return Obstacle(TABLE[0] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T, TABLE[1])


def slide(coefficient: float, angle: float, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, V, 3) of a stiff plate on a slope, and the downhill direction."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    flat, faces = grid(2, 2, width=0.1, depth=0.1)
    cloth = Cloth(flat, faces)
    contact = ContactPenalty(cloth, samples="vertices", stiffness=1e5)
    depth = np.sqrt(cloth.material.areal_density * GRAVITY * c / (3 * 1e5))
    start = (flat + np.array([0.5, contact.margin - depth, 0.5])) @ turn.T
    terms: list[Energy] = [StretchSpring(cloth), Gravity(cloth), contact]
    if coefficient:
        terms.append(ContactFriction(contact, coefficient=coefficient, speed=1e-3))
    result = simulate(
        cloth,
        terms,
        obstacle=slope(angle),
        start=start,
        frames=frames,
        dt=0.01,
        guess="extrapolated",
        tolerance=1e-9,
    )
    assert result.status == "converged", result.reason
    return result.positions, -turn[:, 0]


def test_without_friction_a_plate_slides_as_backward_euler_says():
    positions, downhill = slide(0.0, 0.3, 20)
    n = np.arange(20)
    # x_n = x_0 + a dt^2 n (n + 1) / 2 with a = g sin(angle); the normal force does no work along the slope.
    exact = GRAVITY * np.sin(0.3) * 0.01**2 * n * (n + 1) / 2
    path = (positions.mean(axis=1) - positions[0].mean(axis=0)) @ downhill
    assert path == pytest.approx(exact, abs=1e-8)


def test_friction_above_the_slope_holds_a_plate_and_below_it_does_not():
    """tan(0.3) = 0.31. The smoothed friction creeps below its speed of 1 mm/s and never beyond."""
    held, downhill = slide(0.5, 0.3, 20)
    steps = np.diff((held.mean(axis=1)) @ downhill)[3:]  # the force is lagged by a step
    assert np.abs(steps).max() < 1e-3 * 0.01
    loose, downhill = slide(0.1, 0.3, 20)
    v = np.diff(loose.mean(axis=1) @ downhill) / 0.01
    # Sliding: a = g (sin - mu cos), once the first step, which has no friction yet, is over.
    a = np.diff(v)[3:] / 0.01
    assert a == pytest.approx(GRAVITY * (np.sin(0.3) - 0.1 * np.cos(0.3)), rel=1e-3)


def test_friction_drags_a_cloth_along_with_its_body():
    """The table slides away at 0.5 m/s; with friction the sheet comes with it, without it stays behind."""
    frames = 15
    away = np.array([0.005, 0, 0]) * np.arange(frames)[:, None, None]
    flat, faces = grid(2, 2, width=0.1, depth=0.1)
    cloth = Cloth(flat, faces)
    paths = []
    for coefficient in (0.0, 1.0):
        contact = ContactPenalty(cloth, samples="vertices", stiffness=1e5)
        depth = np.sqrt(cloth.material.areal_density * GRAVITY / (3 * 1e5))
        terms: list[Energy] = [StretchSpring(cloth), Gravity(cloth), contact]
        if coefficient:
            terms.append(ContactFriction(contact, coefficient=coefficient))
        result = simulate(
            cloth,
            terms,
            obstacle=Obstacle(TABLE[0] + away, TABLE[1]),
            start=flat + np.array([0.5, contact.margin - depth, 0.5]),
            frames=frames,
            dt=0.01,
            guess="extrapolated",
        )
        assert result.status == "converged", result.reason
        paths.append(result.positions[:, :, 0].mean(axis=1) - 0.55)
    assert np.abs(paths[0]).max() < 1e-6
    # It is sped up by mu g dt^2 = 1 mm per step until it keeps pace with the table, 5 mm per frame.
    assert np.diff(paths[1])[-1] == pytest.approx(0.005, rel=0.05)
    assert (np.diff(paths[1]) < 0.005 * 1.01).all()
