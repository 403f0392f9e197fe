"""Inputs that have to be refused before anything is solved, each with a message that names what is wrong."""

from __future__ import annotations

import numpy as np

from reference_sim import Cloth, Material, Obstacle, Potential, simulate
from reference_sim.energies import BendHinge, Gravity, Inertia, StretchStVK

from ..scenes.sheet import square_sheet
from ..scenes.sheet_on_sphere import sphere


def _sheet() -> tuple[np.ndarray, np.ndarray]:
    positions, faces = square_sheet(8, 0.4)
    return positions, faces.copy()


def zero_area() -> None:
    """A face whose third vertex lies between the other two."""
    positions, faces = _sheet()
    a, b, c = faces[3]
    positions[c] = 0.5 * (positions[a] + positions[b])
    Cloth(positions, faces)


def zero_area_uv() -> None:
    positions, faces = _sheet()
    uv = positions[:, [0, 2]].copy()
    a, b, c = faces[3]
    uv[c] = 0.5 * (uv[a] + uv[b])
    Cloth(positions, faces, rest_uv=uv)


def coincident_vertices() -> None:
    """A seam that was never sewn: vertex 2 doubled for one of its faces."""
    positions, faces = _sheet()
    face = int(np.flatnonzero((faces == 2).any(axis=1))[0])
    faces[face][faces[face] == 2] = len(positions)
    Cloth(np.vstack([positions, positions[2]]), faces)


def unused_vertex() -> None:
    positions, faces = _sheet()
    Cloth(np.vstack([positions, [9.0, 9.0, 9.0]]), faces)


def repeated_corner() -> None:
    positions, faces = _sheet()
    faces[3, 1] = faces[3, 0]
    Cloth(positions, faces)


def non_manifold_edge() -> None:
    """A third triangle at an inner edge."""
    positions, faces = _sheet()
    edge = Cloth(positions, faces).hinges[0, :2]
    fin = [*edge, len(positions)]
    Cloth(np.vstack([positions, [0.0, 0.3, 0.0]]), np.vstack([faces, fin]))


def inconsistent_winding() -> None:
    positions, faces = _sheet()
    faces[3] = faces[3, ::-1]
    Cloth(positions, faces)


def nan_vertex() -> None:
    positions, faces = _sheet()
    positions[5, 1] = np.nan
    Cloth(positions, faces)


def infinite_vertex() -> None:
    positions, faces = _sheet()
    positions[5, 1] = np.inf
    Cloth(positions, faces)


def vertex_out_of_range() -> None:
    positions, faces = _sheet()
    faces[3, 2] = len(positions)
    Cloth(positions, faces)


def wrong_shape() -> None:
    positions, faces = _sheet()
    Cloth(positions[:, :2], faces)


def pin_out_of_range() -> None:
    Cloth(*_sheet(), pins=[0, 999])


def nan_start() -> None:
    cloth = Cloth(*_sheet())
    start = cloth.rest_positions.copy()
    start[5] = np.nan
    simulate(cloth, [StretchStVK(cloth)], frames=2, start=start)


def negative_stiffness() -> None:
    Material(young_modulus=-1.0)


def poisson_ratio() -> None:
    Material(poisson_ratio=0.7)


def zero_time_step() -> None:
    Inertia(Cloth(*_sheet()), 0.0)


def open_body() -> None:
    points, faces = sphere(0.1, 4)
    Obstacle(points, faces[1:])


def inside_out_body() -> None:
    points, faces = sphere(0.1, 4)
    Obstacle(points, faces[:, ::-1])


def nan_body() -> None:
    points, faces = sphere(0.1, 4)
    motion = np.stack([points, points])
    motion[1, 4, 2] = np.nan
    Obstacle(motion, faces)


def two_cloths() -> None:
    first, second = Cloth(*_sheet()), Cloth(*_sheet())
    Potential([StretchStVK(first), BendHinge(first), Gravity(second)])
