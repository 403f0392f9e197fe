"""Principal stretches of homogeneous deformations, and percentiles of known areas."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.meshes import in_space, random_rotation, right_grid
from benchmarks.metrics.deformation import measure_stretch, principal_stretches, weighted_percentiles
from reference_sim import Cloth

PLANE, FACES = right_grid(4, 5, 1.0, 1.2)
SHEET = Cloth(in_space(PLANE), FACES)


@pytest.mark.parametrize("shear", [0.0, 0.3, -1.5])
def test_simple_shear_has_its_two_stretches_in_whatever_direction_it_is_looked_at(shear):
    gradient = np.array([[1.0, shear], [0.0, 1.0]])
    larger = np.sqrt(1.0 + shear**2 / 4.0) + abs(shear) / 2.0  # their product is 1
    moved = in_space(PLANE @ gradient.T) @ random_rotation(3).T + 5.0
    stretches = principal_stretches(moved[None], SHEET)
    assert stretches.shape == (1, len(FACES), 2)
    assert np.abs(stretches - [1.0 / larger, larger]).max() < 1e-7


def test_a_triangle_that_is_a_line_is_compressed_wholly():
    assert principal_stretches((in_space(PLANE) * [1.1, 0.0, 0.0])[None], SHEET)[0, 0] == pytest.approx(
        [0, 1.1]
    )


def test_tension_and_compression_are_told_apart_and_the_warm_up_is_left_out():
    rest = SHEET.rest_positions
    frames = np.stack([rest * 9.0, rest * [1.2, 0.9, 1.0], rest * [1.2, 0.9, 1.0], rest])
    roll_out = SimpleNamespace(scene=SimpleNamespace(cloth=SHEET), positions=frames, judged=slice(1, None))
    expected = {"tension": (0.0, 20.0, 20.0), "compression": (-10.0, -10.0, 0.0)}
    assert measure_stretch(roll_out) == pytest.approx(
        {f"stretch/{side}_p{p:02}": v for side, row in expected.items() for p, v in zip((1, 50, 99), row)},
        abs=1e-9,
    )


def test_percentiles_are_those_of_the_area():
    # 2 % of the area are twice as long, and a triangle of 0.1 % five times: three triangles, two frames.
    stretch = np.array([[1.0, 5.0, 2.0], [1.0, 5.0, 2.0]])
    areas = np.array([[0.979, 0.001, 0.02]] * 2)
    assert weighted_percentiles(stretch, areas, (1, 50, 97, 99, 100)).tolist() == [1.0, 1.0, 1.0, 2.0, 5.0]
    values, random = np.linspace(0.0, 1.0, 1001), np.random.default_rng(0).permutation(1001)
    percentiles = weighted_percentiles(
        values[random], values[random], (25, 64)
    )  # density proportional to the value
    assert percentiles == pytest.approx([0.5, 0.8], abs=2e-3)
