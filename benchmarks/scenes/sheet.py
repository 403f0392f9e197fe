"""Sheets for the small scenes."""

from __future__ import annotations

import numpy as np


def square_sheet(cells: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    """A horizontal square of `size` [m] about the origin, facing up: positions (V,3), faces (F,3)."""
    return sheet((cells, cells), (size, size))


def sheet(cells: tuple[int, int], size: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """A horizontal rectangle of that size along x and z [m], facing up: positions (V,3), faces (F,3).

    The vertices of a regular grid are nudged by up to a quarter of a cell inside the rectangle and the
    diagonals alternate, so that no direction of the mesh is special. Vertex i * (cells[1] + 1) + j is the
    j-th along z of the i-th row along x.
    """
    rows, columns = cells[0] + 1, cells[1] + 1
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    nudge = np.random.default_rng(0).uniform(-0.25, 0.25, (2, rows, columns))
    nudge[:, [0, -1], :] = 0.0
    nudge[:, :, [0, -1]] = 0.0
    x = size[0] * ((i + nudge[0]) / cells[0] - 0.5)
    z = size[1] * ((j + nudge[1]) / cells[1] - 0.5)
    positions = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)

    a = (i[:-1, :-1] * columns + j[:-1, :-1]).ravel()
    b, c, d = a + columns, a + columns + 1, a + 1
    even = ((i + j)[:-1, :-1].ravel() % 2 == 0)[:, None]
    first = np.where(even, np.stack([a, c, b], 1), np.stack([a, d, b], 1))
    second = np.where(even, np.stack([a, d, c], 1), np.stack([b, d, c], 1))
    return positions, np.concatenate([first, second])
