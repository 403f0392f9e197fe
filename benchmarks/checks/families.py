"""One rectangle in five families of triangles: what a result owes to the mesh shows between them."""

from __future__ import annotations

import numpy as np

from .meshes import delaunay_faces, right_grid

FAMILIES = ("right", "cross", "union_jack", "equilateral", "delaunay")
ROW = 2 / 3**0.5  # of the equilateral family: distance of neighbours in a column, over that of columns


def rectangle(
    family: str, columns: int, rows: int, length: float, width: float
) -> tuple[np.ndarray, np.ndarray]:
    """[0, length] x [0, width] in `columns` x `rows` cells: points (V,2) [m], faces (F,3) counter-clockwise.

    right: all diagonals alike; cross: both diagonals; union_jack: diagonals alternate; equilateral: columns
    shifted by half a cell in turn (truly equilateral if cells are 1 by ROW); delaunay: inner vertices moved
    by up to 0.3 cells. The first two columns are regular in all, so that a clamp means the same.
    """
    points, faces = right_grid(rows, columns, width, length)
    cell = np.array([length / columns, width / rows])
    if family == "right":
        return points, faces
    if family == "union_jack":
        return points, _alternate(rows, columns)
    if family == "cross":
        return _crossed(points, rows, columns)
    if family == "equilateral":
        points = np.concatenate([_column(i, rows) for i in range(columns + 1)]) * cell
    elif family == "delaunay":
        at = points.reshape(rows + 1, columns + 1, 2).copy()
        inner = at[1:-1, 2:-1]
        inner += cell * np.random.default_rng(0).uniform(-0.3, 0.3, inner.shape)
        points = at.reshape(-1, 2)
    else:
        raise ValueError(f"unknown family {family!r}: choose one of {', '.join(FAMILIES)}")
    return points, delaunay_faces(points / cell)


def _column(i: int, rows: int) -> np.ndarray:
    """Vertices of one column of the equilateral family, in cells; a shifted one keeps its two ends."""
    y = np.arange(rows + 1.0)
    if i % 2:
        y = np.concatenate([[0.0], np.arange(rows) + 0.5, [float(rows)]])
    return np.stack([np.full(len(y), float(i)), y], axis=1)


def _corners(rows: int, columns: int) -> tuple[np.ndarray, ...]:
    a = np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)
    return a, a + 1, a + columns + 2, a + columns + 1


def _alternate(rows: int, columns: int) -> np.ndarray:
    a, b, c, d = _corners(rows, columns)
    even = ((np.arange(rows)[:, None] + np.arange(columns)) % 2 == 0)[..., None]
    first = np.where(even, np.stack([a, b, c], -1), np.stack([a, b, d], -1))
    second = np.where(even, np.stack([a, c, d], -1), np.stack([b, c, d], -1))
    return np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def _crossed(points: np.ndarray, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    corners = [corner.ravel() for corner in _corners(rows, columns)]
    middle = len(points) + np.arange(rows * columns)
    centres = sum(points[corner] for corner in corners) / 4
    sides = zip(corners, corners[1:] + corners[:1])
    return np.concatenate([points, centres]), np.concatenate(
        [np.stack([one, other, middle], 1) for one, other in sides]
    )
