"""Input that has to be refused before anything is solved, with a message that names what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.meshes import sphere, square_sheet
from reference_sim import Cloth, Material, Obstacle, Potential, simulate
from reference_sim.energies import BendHinge, Gravity, Inertia, StretchStVK


def sheet() -> tuple[np.ndarray, np.ndarray]:
    positions, faces = square_sheet(8, 0.4)
    return positions, faces.copy()


def zero_area() -> None:
    """A face whose third vertex lies between the other two."""
    positions, faces = sheet()
    a, b, c = faces[3]
    positions[c] = 0.5 * (positions[a] + positions[b])
    Cloth(positions, faces)


def zero_area_uv() -> None:
    """A face without area in its flat pattern."""
    positions, faces = sheet()
    uv = positions[:, [0, 2]].copy()
    a, b, c = faces[3]
    uv[c] = 0.5 * (uv[a] + uv[b])
    Cloth(positions, faces, rest_uv=uv)


def coincident_vertices() -> None:
    """A seam that was never sewn: vertex 2 doubled for one of its faces."""
    positions, faces = sheet()
    face = int(np.flatnonzero((faces == 2).any(axis=1))[0])
    faces[face][faces[face] == 2] = len(positions)
    Cloth(np.vstack([positions, positions[2]]), faces)


def unused_vertex() -> None:
    """A vertex in no face."""
    positions, faces = sheet()
    Cloth(np.vstack([positions, [9.0, 9.0, 9.0]]), faces)


def repeated_corner() -> None:
    """A face that names a vertex twice."""
    positions, faces = sheet()
    faces[3, 1] = faces[3, 0]
    Cloth(positions, faces)


def non_manifold_edge() -> None:
    """A third triangle at an inner edge."""
    positions, faces = sheet()
    edge = Cloth(positions, faces).hinges[0, :2]
    fin = [*edge, len(positions)]
    Cloth(np.vstack([positions, [0.0, 0.3, 0.0]]), np.vstack([faces, fin]))


def inconsistent_winding() -> None:
    """Neighbours wound against each other."""
    positions, faces = sheet()
    faces[3] = faces[3, ::-1]
    Cloth(positions, faces)


def nan_vertex() -> None:
    """A NaN at rest."""
    positions, faces = sheet()
    positions[5, 1] = np.nan
    Cloth(positions, faces)


def infinite_vertex() -> None:
    """An infinite position at rest."""
    positions, faces = sheet()
    positions[5, 1] = np.inf
    Cloth(positions, faces)


def vertex_out_of_range() -> None:
    """A face that names a vertex there is not."""
    positions, faces = sheet()
    faces[3, 2] = len(positions)
    Cloth(positions, faces)


def wrong_shape() -> None:
    """Positions (V, 2)."""
    positions, faces = sheet()
    Cloth(positions[:, :2], faces)


def pin_out_of_range() -> None:
    """A pin that is no vertex."""
    Cloth(*sheet(), pins=[0, 999])


def nan_start() -> None:
    """A NaN at the start of a simulation."""
    cloth = Cloth(*sheet())
    start = cloth.rest_positions.copy()
    start[5] = np.nan
    simulate(cloth, [StretchStVK(cloth)], frames=2, start=start)


def negative_stiffness() -> None:
    """A Young's modulus below zero."""
    Material(young_modulus=-1.0)


def poisson_ratio() -> None:
    """A Poisson ratio of 0.7."""
    Material(poisson_ratio=0.7)


def zero_time_step() -> None:
    """Dt = 0."""
    Inertia(Cloth(*sheet()), 0.0)


def open_body() -> None:
    """A body with a hole."""
    points, faces = sphere(0.1, 4)
    Obstacle(points, faces[1:])


def inside_out_body() -> None:
    """A body wound inwards."""
    points, faces = sphere(0.1, 4)
    Obstacle(points, faces[:, ::-1])


def nan_body() -> None:
    """A NaN in the motion of a body."""
    points, faces = sphere(0.1, 4)
    motion = np.stack([points, points])
    motion[1, 4, 2] = np.nan
    Obstacle(motion, faces)


def two_cloths() -> None:
    """Terms of two cloths in one potential."""
    first, second = Cloth(*sheet()), Cloth(*sheet())
    Potential([StretchStVK(first), BendHinge(first), Gravity(second)])


REFUSALS = (
    (zero_area, "face 3"),
    (zero_area_uv, "face 3"),
    (coincident_vertices, "vertices 2 and 81"),
    (unused_vertex, "vertex 81"),
    (repeated_corner, "face 3"),
    (non_manifold_edge, "edge"),
    (inconsistent_winding, "walk edge"),
    (nan_vertex, "vertex 5"),
    (infinite_vertex, "vertex 5"),
    (vertex_out_of_range, "face 3"),
    (wrong_shape, "(81, 2)"),
    (pin_out_of_range, "pin 999"),
    (nan_start, "start"),
    (negative_stiffness, "young_modulus"),
    (poisson_ratio, "poisson_ratio"),
    (zero_time_step, "dt"),
    (open_body, "not closed"),
    (inside_out_body, "inside out"),
    (nan_body, "vertex 4 of frame 1"),
    (two_cloths, "another cloth"),
)


@pytest.mark.parametrize(("offer", "named"), REFUSALS, ids=lambda value: getattr(value, "__name__", ""))
def test_bad_input_is_refused_by_name(offer, named):
    with pytest.raises(ValueError) as refused:
        offer()
    assert named in " ".join(str(refused.value).split())
