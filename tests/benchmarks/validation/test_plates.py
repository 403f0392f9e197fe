"""Patches of a plate, bent in all ways: which energies they have beside Kirchhoff's plate."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.validation.plates import NU, GaussianCurvature, hinges, patch_energy

D = 1 / 4  # over k, of scaled hinges on equilateral triangles
CORNERS = 3e-4  # relative: what the corners of three patches leave


def cylinder(degrees):
    direction = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    return np.outer(direction, direction)


SHAPES = {
    **{f"cylinder at {degrees} degrees": cylinder(degrees) for degrees in (0, 20, 90)},
    "sphere": np.eye(2),
    "twist": np.array([[0.0, 1.0], [1.0, 0.0]]),
    "saddle of two curvatures": np.array([[1.0, 0.3], [0.3, -0.4]]),
}


def kirchhoff(curvature, nu):
    return D / 2 * (np.trace(curvature) ** 2 - 2 * (1 - nu) * np.linalg.det(curvature))


def hinges_without_poisson_effect(cloth):
    return [*hinges("length_area")(cloth), GaussianCurvature(cloth, -NU * D)]


@pytest.mark.parametrize(
    ("terms", "nu"),
    [(hinges("length_area"), NU), (hinges_without_poisson_effect, 0.0)],
    ids=["hinges", "with Gaussian curvature"],
)
@pytest.mark.parametrize("shape", SHAPES)
def test_equilateral_triangles_are_a_plate_of_kirchhoff(shape, terms, nu):
    energy = patch_energy("equilateral", SHAPES[shape], terms)
    assert energy == pytest.approx(kirchhoff(SHAPES[shape], nu), rel=CORNERS)


# Energies over k of folds about y and about a diagonal, and of a twist: no isotropic plate has such.
@pytest.mark.parametrize(
    ("family", "fold", "diagonal_fold", "twist"),
    [
        ("right", 1 / 8, 3 / 8, 3 / 4),
        ("cross", 1 / 6, 5 / 48, 1 / 4),
        ("union_jack", 5 / 48, 1 / 6, 1 / 2),
    ],
)
def test_other_triangles_are_stiffer_in_some_directions(family, fold, diagonal_fold, twist):
    energies = [
        patch_energy(family, curvature, hinges("length_area"))
        for curvature in (cylinder(0), cylinder(45), SHAPES["twist"])
    ]
    assert energies == pytest.approx([fold, diagonal_fold, twist], rel=CORNERS)
