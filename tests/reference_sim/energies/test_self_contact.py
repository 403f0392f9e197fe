"""The barrier of a cloth against itself: derivatives, known answers, and that nothing passes through.

Whether edges cut faces is asked here with determinants of its own, not with the package under test.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.optimize import brentq

from reference_sim import Cloth, Material, Potential, Trajectory, minimise, simulate
from reference_sim.energies import BendHinge, ContactBarrier, Gravity, StretchStVK
from reference_sim.material import GRAVITY
from reference_sim.minimise.newton import Newton
from tests.reference_sim.meshes import grid, patch

pytest.importorskip("ipctk", reason="ipctk is not installed: no barrier to test")


def cuts(x: np.ndarray, edges: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(E, F): whether an edge of points x passes through a face; shared vertices are no cut."""
    a, b = x[edges[:, 0]][:, None], x[edges[:, 1]][:, None]
    p, q, r = (x[faces[:, i]][None] for i in range(3))

    def volume(u, v, w, t):
        return np.einsum("efi,efi->ef", u - t, np.cross(v - t, w - t))

    sides = volume(a, p, q, r) * volume(b, p, q, r) < 0
    turns = np.sign([volume(a, p, q, b), volume(a, q, r, b), volume(a, r, p, b)])
    shared = (edges[:, None, :, None] == faces[None, :, None, :]).any(axis=(2, 3))
    return sides & (np.abs(turns.sum(axis=0)) == 3) & ~shared


def free(trajectory: Trajectory, cloth: Cloth) -> bool:
    return not any(cuts(x, cloth.edges, cloth.faces).any() for x in trajectory.positions)


def two_sheets(*, gap: float, lower: int, width: float) -> tuple[Cloth, int]:
    """A sheet that is held, and one above it, not vertex over vertex; the number of vertices held."""
    x, faces = grid(lower, lower, width=width, depth=width)
    y, tops = grid(3, 3, width=0.05, depth=0.05)
    both = np.concatenate([x, y + np.array([0.0131 * width / 0.08, gap, 0.0147])])
    return Cloth(both, np.concatenate([faces, tops + len(x)]), Material(), pins=np.arange(len(x))), len(x)


def crumpled() -> tuple[ContactBarrier, np.ndarray]:
    """A rough sheet folded over to 2 mm from itself: pairs of every kind."""
    x, faces = patch(3, cells=6)
    cloth = Cloth(0.1 * x, faces, Material())
    y = 0.1 * x[:, [0, 2, 1]]  # horizontal
    over = y[:, 0] > 0.05
    y[over] = y[over] * [-1, 1, 1] + [0.1, 2.0e-3, 0.0011]
    return ContactBarrier(cloth, distance=3e-3), y + np.random.default_rng(5).normal(0, 3e-4, y.shape)


def test_derivatives_are_those_of_finite_differences():
    energy, x = crumpled()
    kinds = energy.pairs(x)[0]
    assert min(map(len, (kinds.fv_collisions, kinds.ee_collisions, kinds.ev_collisions))) > 0
    gradient, hessian = energy.value_and_gradient(x)[1], energy.sparse_hessian(x)
    assert np.abs(gradient).max() >= 1e-3 and np.abs(hessian.data).max() >= 1.0
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
    barrier, x = crumpled()
    true, half, convex = (barrier.sparse_hessian(x, c).toarray() for c in (0.0, 0.5, 1.0))
    scale = np.abs(true).max()
    assert np.linalg.eigvalsh(true)[0] < -1e-3 * scale
    assert np.linalg.eigvalsh(convex)[0] > -1e-12 * scale
    assert np.linalg.eigvalsh(convex - true)[0] > -1e-12 * scale
    assert np.abs(half - (true + convex) / 2).max() <= 1e-12 * scale


def test_a_sheet_rests_at_the_height_of_the_formula():
    """Each vertex over a wide face has one pair, of a quarter of its area."""
    cloth, lower = two_sheets(gap=1e-3, lower=1, width=1.0)  # above one face, away from its sides
    barrier = ContactBarrier(cloth)
    result = minimise(
        Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), barrier]), cloth.rest_positions
    )

    def push(height: float) -> float:
        s = (height / barrier.distance) ** 2
        slope = -(2 * (s - 1) * np.log(s) + (s - 1) ** 2 / s)
        return -0.25 * barrier.stiffness * slope * 2 * height / barrier.distance

    pressure = cloth.material.areal_density * GRAVITY
    height = brentq(lambda h: push(h) - pressure, 2e-6, 2e-3 * (1 - 1e-12))
    assert result.status == "converged"
    assert np.abs(result.positions[lower:, 1] - height).max() < 1e-8
    up = -barrier.value_and_gradient(result.positions)[1][lower:]
    # The weight, up to the gradient's tolerance of a relative residual of 1e-6 of a mean vertex.
    assert up.sum(axis=0) == pytest.approx([0, GRAVITY * cloth.masses[lower:].sum(), 0], abs=1e-4)


def test_the_way_of_a_line_search_ends_before_the_first_touch():
    barrier, x = crumpled()
    cloth = barrier.cloth
    upper = cloth.rest_positions[:, 0] > 0.05
    for down in (1e-5, 0.01, 0.5):
        direction = np.where(upper[:, None], [0.0, -down, 0.0], 0.0)
        share = barrier.largest_step(x, direction)
        assert 0 < share <= 1 and (share == 1) == (down == 1e-5)
        assert not barrier.infeasibility(x + share * direction)
        assert not cuts(x + share * direction, cloth.edges, cloth.faces).any()


def test_a_start_that_intersects_is_refused_with_the_elements_that_cut():
    cloth, lower = two_sheets(gap=0.0, lower=4, width=0.08)
    start = cloth.rest_positions.copy()
    start[lower:, 1] += 0.2 * (start[lower:, 0] - 0.0431)  # tilted through the sheet below it
    terms = [StretchStVK(cloth), ContactBarrier(cloth)]
    with pytest.raises(ValueError, match="the start is not free of intersections") as error:
        simulate(cloth, terms, start=start, frames=2)
    pattern = r"edge \((\d+), (\d+)\) of the cloth cuts face (\d+) of the cloth"
    a, b, face = map(int, re.search(pattern, str(error.value)).groups())
    assert cuts(start, np.array([[a, b]]), cloth.faces[face : face + 1]).all()
    result = minimise(Potential(terms), start)
    assert result.status == "diverged" and re.search(pattern, result.reason)


def test_a_barrier_across_a_triangle_is_refused():
    with pytest.raises(ValueError, match=r"is only 0\.0118 m high at rest; choose a distance below that"):
        ContactBarrier(Cloth(*grid(3, 3, width=0.05, depth=0.05)), distance=0.05)


def test_pins_push_cloth_before_them():
    """A small sheet, all of it pinned, is driven 3 cm a frame down on a free one."""
    x, faces = grid(6, 6, width=0.16, depth=0.16)
    y, upper = grid(2, 2, width=0.05, depth=0.05)
    both = np.concatenate([x, y + np.array([0.0531, 4e-3, 0.0547])])
    paddle = np.arange(len(x), len(both))
    cloth = Cloth(both, np.concatenate([faces, upper + len(x)]), Material(), pins=paddle)
    terms = [StretchStVK(cloth), BendHinge(cloth), ContactBarrier(cloth)]
    push = simulate(
        cloth, terms, frames=3, pin_positions=lambda frame: both[paddle] - [0, 0.03 * frame, 0]
    )
    assert push.status == "converged", push.reason
    assert free(push, cloth)
    assert np.array_equal(push.positions[-1][paddle], both[paddle] - [0, 0.06, 0])
    centre = np.linalg.norm(x - [0.08, 0, 0.08], axis=1) < 0.02
    assert (push.positions[-1][: len(x)][centre, 1] < -0.055).all()


def test_pins_that_find_no_way_stop_and_say_so():
    """Two sheets, all of both pinned but one vertex, driven through each other."""
    cloth, lower = two_sheets(gap=3e-3, lower=4, width=0.08)
    cloth = Cloth(cloth.rest_positions, cloth.faces, Material(), pins=np.arange(cloth.vertex_count - 1))
    down = np.where(np.arange(cloth.vertex_count - 1) < lower, 0.0, -0.01)[:, None] * [0, 1, 0]
    terms = [StretchStVK(cloth), BendHinge(cloth), ContactBarrier(cloth)]
    driven = simulate(
        cloth, terms, frames=2, pin_positions=lambda f: cloth.rest_positions[:-1] + f * down
    )
    assert driven.status == "stalled" and "no way without intersection: pins came" in driven.reason
    assert free(driven, cloth)


def test_frames_in_which_nothing_is_near_are_those_without_it_and_a_run_tells_how_steps_were_opened():
    """L-BFGS begins the steps by default, Newton's method if it is asked for; it ends them either way."""
    cloth = Cloth(*grid(4, 4, width=0.2, depth=0.2), pins=[0, 4])
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    without = simulate(cloth, terms, frames=5)
    by_default = simulate(cloth, [*terms, ContactBarrier(cloth)], frames=5)
    by_newton = simulate(cloth, [*terms, ContactBarrier(cloth)], frames=3, method="newton")
    assert np.array_equal(without.positions, by_default.positions)
    assert list(by_default.frame_fields["energy/barrier"][1:]) == [0.0] * 4
    assert not np.array_equal(by_default.positions[:3], by_newton.positions)
    assert (by_default.provenance["opening"], by_newton.provenance["opening"]) == ("lbfgs", "newton")
    assert "opening" not in without.provenance
    with pytest.raises(ValueError, match="but Newton ends steps with 'barrier': choose"):
        simulate(cloth, [*terms, ContactBarrier(cloth)], method=lambda potential, **_: Newton(potential))
