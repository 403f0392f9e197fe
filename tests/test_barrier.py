"""The barrier and its friction: derivatives, closed forms, and that nothing ever passes through anything.

Whether edges cut faces is asked here with determinants of its own, not with the package under test.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from meshes import box, grid, patch, sphere
from scipy.optimize import brentq

from reference_sim import Cloth, Material, Obstacle, Potential, Trajectory, minimise, simulate
from reference_sim.energies import (
    BarrierFriction,
    BendHinge,
    ContactBarrier,
    Energy,
    Gravity,
    Step,
    StretchStVK,
)

pytest.importorskip("ipctk", reason="ipctk is not installed: no barrier to test")
DT = 1 / 60


def cuts(x: np.ndarray, edges: np.ndarray, y: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(E, F): whether edge e of points x passes through face f of points y; shared vertices are no cut."""
    a, b = x[edges[:, 0]][:, None], x[edges[:, 1]][:, None]
    p, q, r = (y[faces[:, i]][None] for i in range(3))

    def volume(u, v, w, t):
        return np.einsum("efi,efi->ef", u - t, np.cross(v - t, w - t))

    sides = volume(a, p, q, r) * volume(b, p, q, r) < 0
    turns = np.sign([volume(a, p, q, b), volume(a, q, r, b), volume(a, r, p, b)])
    found = sides & (np.abs(turns.sum(axis=0)) == 3)
    if x is y:
        found &= ~(edges[:, None, :, None] == faces[None, :, None, :]).any(axis=(2, 3))
    return found


def mesh_edges(faces: np.ndarray) -> np.ndarray:
    return np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)


def assert_free(trajectory: Trajectory, cloth: Cloth, obstacle: Obstacle | None) -> None:
    """No edge cuts a face in any frame."""
    for frame, x in enumerate(trajectory.positions):
        assert not cuts(x, cloth.edges, x, cloth.faces).any(), f"frame {frame}: cloth through cloth"
        if obstacle is not None:
            y = obstacle.at(frame)
            assert not cuts(x, cloth.edges, y, obstacle.faces).any(), f"frame {frame}: cloth edge"
            assert not cuts(y, mesh_edges(obstacle.faces), x, cloth.faces).any(), f"frame {frame}: body edge"


def sheet(cells: int, size: float, place: tuple[float, float, float], *, pins=()) -> Cloth:
    """A horizontal sheet whose lowest corner is at place."""
    x, faces = grid(cells, cells, width=size, depth=size)
    return Cloth(x + place, faces, Material(), pins=pins)


def still(x: np.ndarray, obstacle: Obstacle | None = None, *, dt: float = DT) -> Step:
    return Step(x, np.zeros_like(x), x, dt, obstacle, 1)


def crumpled(distance: float = 3e-3) -> tuple[ContactBarrier, Obstacle, np.ndarray]:
    """A sheet folded over to 2 mm from itself and 1.5 mm above a rough sphere: pairs of every kind."""
    x, faces = patch(3, cells=6)
    cloth = Cloth(0.1 * x, faces, Material())
    generator = np.random.default_rng(4)
    y = 0.1 * x[:, [0, 2, 1]]  # horizontal
    over = y[:, 0] > 0.05
    y[over] = y[over] * [-1, 1, 1] + [0.1, 2.0e-3, 0.0011]
    y += generator.uniform(-1e-4, 1e-4, y.shape)
    ball, ball_faces = sphere(4, radius=0.2)
    ball += [0.05, -0.2015, 0.05]
    return ContactBarrier(cloth, distance=distance), Obstacle(ball, ball_faces), y


def with_pairs() -> tuple[ContactBarrier, BarrierFriction, np.ndarray]:
    barrier, obstacle, x = crumpled()
    friction = BarrierFriction(barrier, coefficient=0.7, speed=0.05)
    step = still(x, obstacle)
    for energy in (barrier, friction):
        energy.prepare(step)
    kinds = barrier.collisions.pairs(x)[0]
    assert min(map(len, (kinds.fv_collisions, kinds.ee_collisions, kinds.ev_collisions))) > 0
    # 0.8 mm is the slip at which friction is fully grown: some pairs have slipped less, some more.
    return barrier, friction, x + np.random.default_rng(5).normal(0, 3e-4, x.shape)


@pytest.mark.parametrize(("which", "force", "stiffness"), [(0, 1e-3, 1.0), (1, 1e-4, 0.1)])
def test_derivatives_are_those_of_finite_differences(which, force, stiffness):
    *energies, x = with_pairs()
    energy = energies[which]
    gradient, hessian = energy.value_and_gradient(x)[1], energy.sparse_hessian(x)
    assert np.abs(gradient).max() >= force and np.abs(hessian.data).max() >= stiffness
    assert abs(hessian - hessian.T).max() <= 1e-12 * np.abs(hessian.data).max()
    h = 1e-9  # [m]: a hundred-thousandth of the smallest distance
    for seed in range(3):
        d = np.random.default_rng(seed).normal(size=x.shape)
        (above, up), (below, down) = (energy.value_and_gradient(x + s * h * d) for s in (1, -1))
        # Half the digits are left of a difference; a wrong factor or sign is far beyond that.
        assert (above - below) / (2 * h) == pytest.approx(np.vdot(gradient, d), rel=1e-4)
        product = (hessian @ d.ravel()).reshape(-1, 3)
        assert np.abs((up - down) / (2 * h) - product).max() <= 1e-4 * np.abs(product).max()


def test_convexity_takes_out_the_negative_curvature_and_nothing_else():
    barrier, friction, x = with_pairs()
    true, half, convex = (barrier.sparse_hessian(x, c).toarray() for c in (0.0, 0.5, 1.0))
    scale = np.abs(true).max()
    assert np.linalg.eigvalsh(true)[0] < -1e-3 * scale
    assert np.linalg.eigvalsh(convex)[0] > -1e-12 * scale
    assert np.linalg.eigvalsh(convex - true)[0] > -1e-12 * scale
    assert np.abs(half - (true + convex) / 2).max() <= 1e-12 * scale
    own = friction.sparse_hessian(x).toarray()
    assert np.linalg.eigvalsh(own)[0] > -1e-12 * np.abs(own).max()


def test_there_is_no_definition_in_torch_and_it_says_so():
    for energy in with_pairs()[:2]:
        with pytest.raises(NotImplementedError, match="no definition in torch"):
            energy.energy(None)


def test_hessian_of_a_potential_holds_pairs_that_no_other_term_couples():
    barrier, friction, x = with_pairs()
    others: list[Energy] = [StretchStVK(barrier.cloth), BendHinge(barrier.cloth)]
    whole = Potential([*others, barrier, friction]).hessian(x)
    parts = Potential(others).hessian(x) + barrier.sparse_hessian(x) + friction.sparse_hessian(x)
    assert abs(whole - parts).max() <= 1e-12 * np.abs(whole.data).max()
    assert whole.nnz > Potential(others).hessian(x).nnz


def test_a_wider_pattern_is_kept_while_it_serves():
    barrier, _, x = with_pairs()
    potential = Potential([StretchStVK(barrier.cloth), barrier])
    fixed = potential.pattern(np.ones(barrier.cloth.vertex_count, dtype=bool))
    wide = fixed.covering(fixed.changing(x))
    assert len(wide.indices) > len(fixed.indices)
    assert wide.covering(wide.changing(x)) is wide
    apart = wide.changing(barrier.cloth.rest_positions)
    assert apart[0].nnz == 0 and wide.covering(apart) is wide and fixed.covering(apart) is fixed
    assert np.array_equal(np.sort(wide.order), np.arange(wide.size))


def equilibrium(barrier: ContactBarrier, pressure: float) -> float:
    """Height [m] of a sheet above a wide face: each vertex has one pair, of a quarter of its area."""

    def push(height: float) -> float:
        s = (height / barrier.distance) ** 2
        slope = -(2 * (s - 1) * np.log(s) + (s - 1) ** 2 / s)
        return -0.25 * barrier.stiffness * slope * 2 * height / barrier.distance

    return brentq(lambda h: push(h) - pressure, 1e-3 * barrier.distance, barrier.distance * (1 - 1e-12))


def test_a_sheet_rests_at_the_height_of_the_formula():
    cloth = sheet(3, 0.1, (0.0, 1e-3, 0.5))  # away from the diagonal of the box
    barrier = ContactBarrier(cloth)
    potential = Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier])
    potential.prepare(still(cloth.rest_positions, Obstacle(*box((-1, -0.1, -1), (1, 0, 1)))))
    result = minimise(potential, cloth.rest_positions)
    height = equilibrium(barrier, cloth.material.areal_density * 9.81)
    assert result.status == "converged"
    assert np.abs(result.positions[:, 1] - height).max() < 1e-8
    push = -barrier.value_and_gradient(result.positions)[1]
    # The weight, up to the gradient's tolerance of 1e-6 vertex weights.
    assert push.sum(axis=0) == pytest.approx([0, 9.81 * cloth.masses.sum(), 0], abs=1e-7)


@pytest.mark.parametrize("ratio", [0.5, 0.9, 1.2])
def test_friction_on_a_slope_is_the_law(ratio):
    """tan(angle) = ratio mu. A rigid slide obeys v' = v + g dt (sin - mu f'(v') cos), solved here alone."""
    mu, speed, frames = 0.4, 0.01, 10
    angle = np.arctan(ratio * mu)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    cloth = sheet(3, 0.1, (0.0, 0.0, 0.0))
    barrier = ContactBarrier(cloth)
    height = equilibrium(barrier, cloth.material.areal_density * 9.81 * np.cos(angle))
    start = (cloth.rest_positions + np.array([0, height, 0.5])) @ turn.T
    ramp, faces = box((-1, -0.1, -1), (1, 0, 1))
    friction = BarrierFriction(barrier, coefficient=mu, speed=speed)
    slide = simulate(
        cloth,
        [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier, friction],
        obstacle=Obstacle(ramp @ turn.T, faces),
        start=start,
        frames=frames,
        dt=DT,
        guess="extrapolated",
    )
    assert slide.status == "converged"
    found = np.diff(-(slide.positions @ turn[:, 0]).mean(axis=1)) / DT

    def grip(v: float) -> float:
        y = min(v / speed, 1.0)
        return 2 * y - y * y

    v, expected = 0.0, []
    for _ in range(frames - 1):
        before, pull = v, 9.81 * DT
        v = brentq(lambda w: w - before - pull * (np.sin(angle) - mu * np.cos(angle) * grip(w)), 0, 10)  # noqa: B023
        expected.append(v)
    # The minimiser stops at 1e-6 weights: a velocity of 1e-6 g dt.
    assert found == pytest.approx(expected, abs=1e-6)
    held = speed * (1 - np.sqrt(max(1 - ratio, 0)))
    assert found[-1] == pytest.approx(held, rel=1e-2) if ratio < 1 else found[-1] > 5 * speed


def test_a_sheet_dropped_on_a_sphere_never_meets_it():
    cloth = sheet(8, 0.26, (-0.127, 0.105, -0.132))
    ball, faces = sphere(3, radius=0.1)
    obstacle = Obstacle(ball, faces)
    barrier = ContactBarrier(cloth)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier]
    thrown = np.tile([0.0, -6.0, 0.0], (cloth.vertex_count, 1))  # a sphere's diameter in one frame
    drop = simulate(cloth, terms, obstacle=obstacle, frames=8, velocity=thrown)
    assert drop.status == "converged", drop.reason
    assert_free(drop, cloth, obstacle)
    assert drop.positions[-1][:, 1].min() < 0.0  # it hangs round the sphere
    assert drop.frame_fields["energy/barrier"][-1] > 0
    again = simulate(cloth, terms, obstacle=obstacle, frames=4, velocity=thrown)
    assert np.array_equal(again.positions, drop.positions[:4])


@pytest.mark.parametrize(("guess", "speed", "frames"), [("carried", 0.06, 4), ("previous", 0.02, 3)])
def test_a_rising_sphere_takes_a_sheet_along(guess, speed, frames):
    """`speed` [m] a frame. A guess that stands still leaves all the work to the way there."""
    cloth = sheet(6, 0.24, (-0.12, 0.0, -0.12))
    ball, faces = sphere(3, radius=0.1)
    up = np.array([0.0, 1.0, 0.0])
    obstacle = Obstacle(np.stack([ball + (speed * k - 0.103) * up for k in range(frames)]), faces)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactBarrier(cloth)]
    ride = simulate(cloth, terms, obstacle=obstacle, frames=frames, guess=guess)
    assert ride.status == "converged", ride.reason
    assert_free(ride, cloth, obstacle)
    assert ride.positions[-1][:, 1].max() > speed * (frames - 1)


def test_pins_push_cloth_before_them():
    """A small sheet, all of it pinned, is driven 3 cm a frame down on a free one."""
    x, faces = grid(6, 6, width=0.16, depth=0.16)
    y, more = grid(2, 2, width=0.05, depth=0.05)
    both = np.concatenate([x, y + np.array([0.0531, 4e-3, 0.0547])])
    paddle = np.arange(len(x), len(both))
    cloth = Cloth(both, np.concatenate([faces, more + len(x)]), Material(), pins=paddle)

    def driven(frame: int) -> np.ndarray:
        return both[paddle] - np.array([0, 0.03 * frame, 0])

    terms = [StretchStVK(cloth), BendHinge(cloth), ContactBarrier(cloth)]
    push = simulate(cloth, terms, frames=3, pin_positions=driven)
    assert push.status == "converged", push.reason
    assert_free(push, cloth, None)
    assert np.array_equal(push.positions[-1][paddle], driven(2))
    centre = np.linalg.norm(x - [0.08, 0, 0.08], axis=1) < 0.02
    assert (push.positions[-1][: len(x)][centre, 1] < -0.055).all()


def folded(cells: int) -> tuple[Cloth, np.ndarray]:
    """A strip whose right half lies 16 mm above its left half, bent round a cylinder between them."""
    x, faces = grid(2 * cells, cells, width=0.16, depth=0.08)
    s, radius = x[:, 0] - 0.08, 0.008
    phi = np.clip(s / radius, 0, np.pi)
    along = np.where(s < 0, s, radius * np.sin(phi) - np.maximum(s - np.pi * radius, 0))
    return Cloth(x, faces, Material()), np.stack([along, 3e-3 + radius * (1 - np.cos(phi)), x[:, 2]], 1)


def fall_shut(self_contact: bool) -> tuple[Trajectory, Cloth, Obstacle]:
    cloth, start = folded(5)
    floor = Obstacle(*box((-1, -0.1, -1), (1.1, 0, 1.2)))
    barrier = ContactBarrier(cloth, self_contact=self_contact)
    friction = BarrierFriction(barrier, coefficient=0.5, speed=1e-3)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth, acceleration=60.0), barrier, friction]
    return simulate(cloth, terms, obstacle=floor, start=start, frames=20), cloth, floor


def test_a_folded_sheet_comes_to_rest_on_itself():
    rest, cloth, floor = fall_shut(True)
    assert rest.status == "converged", rest.reason
    assert_free(rest, cloth, floor)
    speed = np.linalg.norm(np.diff(rest.positions[-2:], axis=0), axis=2).max() * 30
    assert speed < 2e-3  # as friction creeps
    upper = rest.positions[-1][cloth.rest_positions[:, 0] > 0.13]
    assert 2e-3 < upper[:, 1].min() < 6e-3  # on the lower half, which is 2 mm above the floor


def test_without_self_contact_the_same_sheet_falls_through_itself():
    """What the test above would miss if its sheet did not press on itself."""
    fallen, cloth, floor = fall_shut(False)
    x = fallen.positions[-1]
    assert fallen.status == "converged" and cuts(x, cloth.edges, x, cloth.faces).any()
    assert not cuts(x, cloth.edges, floor.at(0), floor.faces).any()


def test_the_way_of_a_line_search_ends_before_the_first_touch():
    barrier, obstacle, x = crumpled()
    barrier.prepare(still(x, obstacle))
    cloth = barrier.cloth
    for down in (1e-3, 0.01, 0.5):
        direction = np.tile([0.0, -down, 0.0], (len(x), 1))
        share = barrier.largest_step(x, direction)
        assert 0 < share <= 1 and (share == 1) == (down == 1e-3)
        assert not barrier.objection(x + share * direction)
        assert not cuts(x + share * direction, cloth.edges, obstacle.at(0), obstacle.faces).any()
    assert "cuts" in barrier.objection(x - np.array([0, 0.004, 0]))


def test_a_start_that_intersects_is_refused_by_name():
    cloth = sheet(2, 0.1, (-0.05, 0.0, -0.05))
    ball, faces = sphere(1, radius=0.02)
    terms = [StretchStVK(cloth), Gravity(cloth), ContactBarrier(cloth)]
    words = r"edge \(\d+, \d+\) of the (cloth|body) cuts face \d+ of the (cloth|body)"
    with pytest.raises(ValueError, match=words):
        simulate(cloth, terms, obstacle=Obstacle(ball, faces), frames=2)
    strip, start = folded(5)
    start[strip.rest_positions[:, 0] > 0.11, 1] -= 0.0175  # the upper half, through the lower
    with pytest.raises(ValueError, match=r"edge \(\d+, \d+\) of the cloth cuts face \d+ of the cloth"):
        simulate(strip, [StretchStVK(strip), ContactBarrier(strip)], start=start, frames=2)
    result = minimise(Potential([StretchStVK(strip), ContactBarrier(strip)]), start)
    assert result.status == "diverged" and "of the cloth cuts face" in result.reason


def test_the_elements_named_are_those_that_cut():
    cloth = sheet(2, 0.1, (-0.05, 0.0, -0.05))
    needle, faces = box((0.011, -0.05, 0.013), (0.012, 0.05, 0.014))
    barrier = ContactBarrier(cloth)
    x = cloth.rest_positions
    barrier.prepare(still(x, Obstacle(needle, faces)))
    words = barrier.objection(x)
    names = re.fullmatch(r"edge \((\d+), (\d+)\) of the body cuts face (\d+) of the cloth", words)
    assert names, words
    a, b, face = map(int, names.groups())
    assert cuts(needle, np.array([[a, b]]), x, cloth.faces[face : face + 1]).all()


def test_a_body_that_leaves_no_room_stops_and_says_so():
    """A press that closes wholly, and opens again: between its jaws there is no place for a sheet.

    The sheet reaches out of the jaws, so that it would be cut, not buried.
    """
    cloth = sheet(4, 0.06, (-0.03, 0.01, 0.4))
    low, faces = box((-0.019, -0.05, 0.408), (0.021, 0, 0.449))
    high, _ = box((-0.019, 0.02, 0.408), (0.021, 0.07, 0.449))
    both = np.concatenate([faces, faces + len(low)])
    shut = [0, 0.01, 0.0205, 0.0205, 0.01]
    press = Obstacle(np.stack([np.concatenate([low, high - [0, s, 0]]) for s in shut]), both)
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactBarrier(cloth)]
    pressed = simulate(cloth, terms, obstacle=press, frames=5)
    assert pressed.status == "stalled" and "pins and obstacle came" in pressed.reason
    assert "frame 2" in pressed.reason
    assert list(pressed.frame_fields["converged"][[1, 2, 4]]) == [1, 0, 1]
    assert not cuts(pressed.positions[4], cloth.edges, press.at(4), press.faces).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"distance": 0.0}, "distance = 0.0: must be a finite number above 0"),
        ({"stiffness": np.nan}, "stiffness = nan: must be"),
        ({"distance": 0.05}, "face 0 is only 0.0236 m high at rest; choose a distance below that"),
    ],
)
def test_impossible_barriers_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        ContactBarrier(sheet(3, 0.1, (0, 0, 0)), **options)


@pytest.mark.parametrize(
    ("options", "message"), [({"coefficient": -0.1}, "must not be negative"), ({"speed": 0.0}, "above 0")]
)
def test_impossible_friction_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        BarrierFriction(ContactBarrier(sheet(3, 0.1, (0, 0, 0))), **options)


def test_friction_listed_before_its_barrier_is_refused():
    cloth = sheet(3, 0.1, (0, 0, 0))
    barrier = ContactBarrier(cloth)
    with pytest.raises(ValueError, match="list the barrier first"):
        simulate(cloth, [BarrierFriction(barrier), barrier], frames=2)


def test_areas_that_weigh_pairs_are_the_rest_state_of_the_cloth():
    x, faces = grid(3, 3, width=0.1, depth=0.1)
    cloth = Cloth(x, faces, Material(), rest_uv=2 * x[:, [0, 2]])
    barrier = ContactBarrier(cloth)
    barrier.prepare(still(x, Obstacle(*box((-1, -0.1, -1), (1, -1e-3, 1)))))
    mesh = barrier.collisions.pairs(x)[1].mesh
    count = cloth.vertex_count
    assert mesh.vertex_areas[:count] == pytest.approx(cloth.vertex_areas, rel=1e-12)
    assert mesh.vertex_areas[count:].max() <= cloth.vertex_areas.mean() * (1 + 1e-12)
    own = (mesh.edges < count).all(axis=1)
    assert mesh.edge_areas[own].sum() == pytest.approx(cloth.areas.sum(), rel=1e-12)
    assert mesh.edge_areas[~own].max() <= mesh.edge_areas[own].mean() * (1 + 1e-12)
