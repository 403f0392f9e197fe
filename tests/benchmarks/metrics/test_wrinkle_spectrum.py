"""Amplitudes of bands where the waves of a surface are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.meshes import icosphere, in_space, random_rotation, right_grid
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics.wrinkle_spectrum import (
    BANDS,
    band_amplitudes,
    compare,
    measure,
    signed_curvature,
    waves_of_rest_shape,
)
from reference_sim import Cloth, Trajectory

CELLS, EDGE = 30, 0.02
PLANE, FACES = right_grid(CELLS, CELLS, CELLS * EDGE, CELLS * EDGE)
SHEET = Cloth(in_space(PLANE), FACES)
INNER = (CELLS - 2) * EDGE  # 0.56 m between the outermost vertices that have a curvature
WAVES = waves_of_rest_shape(SHEET)
HEIGHT = 4e-4


def wave(half_waves: int, height: float = HEIGHT, shift: float = 0.0) -> np.ndarray:
    """The sheet in so many half waves over its inner width, (V,3) [m]."""
    phase = np.pi * half_waves * (PLANE[:, 0] - EDGE) / INNER + shift
    return in_space(PLANE) + np.outer(height * np.cos(phase), [0.0, 0.0, 1.0])


def amplitude(half_waves: int, height: float = HEIGHT) -> float:
    """Root mean square of the mean curvature of that wave on the grid: half of its second difference."""
    return height * (2.0 / EDGE * np.sin(0.5 * np.pi * half_waves * EDGE / INNER)) ** 2 / (2.0 * np.sqrt(2.0))


@pytest.mark.parametrize(("half_waves", "band"), [(2, 0), (4, 1), (8, 2), (14, 3)])
def test_a_wave_is_in_the_band_of_its_length_alone(half_waves, band):
    # 560, 280, 140 and 80 mm long.
    turned = wave(half_waves) @ random_rotation(half_waves).T + 2.0
    (amplitudes,) = band_amplitudes(turned[None], FACES, WAVES)
    assert amplitudes[band] == pytest.approx(amplitude(half_waves), rel=2e-3)
    assert np.delete(amplitudes, band).max() < 0.02 * amplitudes[band]


def test_two_waves_have_the_amplitude_of_each_and_squares_of_bands_add_up():
    both = wave(4) + wave(8, 2e-4) - in_space(PLANE)
    (amplitudes,) = band_amplitudes(both[None], FACES, WAVES)
    assert amplitudes[1:3] == pytest.approx([amplitude(4), amplitude(8, 2e-4)], rel=1e-2)
    rough = both + 1e-4 * np.random.default_rng(1).normal(size=both.shape)
    (amplitudes,) = band_amplitudes(rough[None], FACES, WAVES)
    curvature = signed_curvature(rough[None], FACES)[0, WAVES.vertices]
    assert (amplitudes**2).sum() == pytest.approx((WAVES.areas * curvature**2).sum() / WAVES.areas.sum())


def test_waves_are_those_of_a_square_and_orthonormal():
    by_formula = sorted(
        (2.0 * INNER / np.hypot(m, n) for m in range(12) for n in range(12) if m + n), reverse=True
    )
    assert WAVES.wavelengths[0] == np.inf
    # Discrete waves are longer than continuous ones by the square of what an edge is of them.
    assert WAVES.wavelengths[1:20] == pytest.approx(by_formula[:19], rel=1e-2)
    assert WAVES.wavelengths.min() >= 0.1 and 80 < len(WAVES.wavelengths) < 130
    gram = WAVES.vectors.T @ (WAVES.areas[:, None] * WAVES.vectors)
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-9


def test_a_fine_mesh_has_the_same_waves_by_the_sparse_solver():
    plane, faces = right_grid(60, 60, 0.6, 0.6)  # 3481 vertices take part
    fine = waves_of_rest_shape(Cloth(in_space(plane), faces))
    inner = 0.58
    assert fine.wavelengths[1:4] == pytest.approx([2 * inner, 2 * inner, np.sqrt(2) * inner], rel=2e-3)
    assert fine.wavelengths.min() >= 0.1 and 90 < len(fine.wavelengths) < 140


def test_a_sphere_has_its_curvature_in_the_longest_band():
    x, faces = icosphere(3, 0.25)
    (amplitudes,) = band_amplitudes(x[None], faces, waves_of_rest_shape(Cloth(x, faces)))
    assert amplitudes[0] == pytest.approx(4.0, rel=1e-3) and amplitudes[1:].max() < 0.05


def roll_out(group: SceneRollOuts, frames: np.ndarray) -> RollOut:
    return RollOut(group, None, Trajectory(frames, FACES, np.arange(len(frames)) / 30.0))


def test_errors_see_depth_and_length_at_the_same_frame_and_not_the_place():
    group = SceneRollOuts(SimpleNamespace(cloth=SHEET, warm_up=1))
    reference = roll_out(group, np.stack([wave(14), wave(8), wave(8, 2 * HEIGHT)]))
    half = amplitude(8)
    assert measure(reference)["wrinkles/100_to_200"] == pytest.approx(1.5 * half, rel=1e-2)

    def errors(*frames):
        metrics = compare(roll_out(group, np.stack([wave(2), *frames])), reference)
        return [metrics[f"wrinkles/error_{band}"] for band in BANDS]

    assert max(errors(wave(8, -HEIGHT), wave(8, -2 * HEIGHT))) < 1e-3 * half  # crests where valleys were
    assert errors(wave(8), wave(8))[2] == pytest.approx(0.5 * half, rel=1e-2)
    swapped = errors(wave(8, 2 * HEIGHT), wave(8))  # the means over frames are equal
    assert swapped[2] == pytest.approx(half, rel=1e-2)
    longer = errors(wave(4), wave(4))
    # The sheet's edges put 1 % of the reference's deeper wave into the band beside it.
    assert longer[1:3] == pytest.approx([amplitude(4), 1.5 * half], rel=3e-2)


def test_a_cloth_of_boundary_alone_has_no_waves():
    plane, faces = right_grid(1, 3, 0.1, 0.3)
    strip = Cloth(in_space(plane), faces)
    assert waves_of_rest_shape(strip) is None
    group = SceneRollOuts(SimpleNamespace(cloth=strip, warm_up=0))
    only = RollOut(group, None, Trajectory(strip.rest_positions[None], faces, np.zeros(1)))
    assert measure(only) == compare(only, only) == {}
