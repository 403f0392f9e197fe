"""Small meshes that several tests share: numpy and scipy alone, nothing of the project."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation


def grid(
    columns: int, rows: int, *, width: float = 1.0, depth: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal sheet of right triangles, normals up; vertex i * (rows + 1) + j is at x_i, z_j [m]."""
    i, j = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    positions = np.stack([width * i / columns, 0.0 * i, depth * j / rows], axis=-1).reshape(-1, 3)
    a = (i * (rows + 1) + j)[:-1, :-1].ravel()
    b, c, d = a + rows + 1, a + rows + 2, a + 1
    return positions, np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)])


def patch(seed: int, cells: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Flat unstructured patch of the unit square in the plane z = 0: a jittered lattice, Delaunay."""
    generator = np.random.default_rng(seed)
    lattice = np.stack(np.meshgrid(*2 * [np.arange(cells + 1.0)]), axis=-1).reshape(-1, 2)
    inner = ((lattice > 0) & (lattice < cells)).all(axis=1)
    lattice[inner] += generator.uniform(-0.35, 0.35, (inner.sum(), 2))
    return np.column_stack([lattice / cells, np.zeros(len(lattice))]), Delaunay(lattice).simplices


def random_rotation(seed: int) -> np.ndarray:
    """(3, 3) rotation matrix."""
    return Rotation.random(random_state=seed).as_matrix()


def box(
    low: tuple[float, float, float], high: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Closed box, outward wound."""
    corner = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return np.where(corner == 0, low, high).astype(float), np.array(faces)


def sphere(subdivisions: int, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Closed sphere from an octahedron, outward wound; its vertices lie on the true sphere."""
    points = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=float)
    octants = [(x, y, z) for x in (0, 1) for y in (2, 3) for z in (4, 5)]
    faces = np.array([(x, y, z) if (x + y + z) % 2 == 0 else (x, z, y) for x, y, z in octants])
    for _ in range(subdivisions):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        a, b, c = inverse.reshape(3, -1) + len(points)
        points = np.concatenate([points, points[unique].mean(axis=1)])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        i, j, k = faces.T
        faces = np.concatenate([np.stack(f, 1) for f in ((i, a, c), (a, j, b), (c, b, k), (a, b, c))])
    return radius * points, faces


def edge_counts(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directed edges (3F, 2), edges (E, 2) and in how many faces each is (E,)."""
    halves = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges, counts = np.unique(np.sort(halves, axis=1), axis=0, return_counts=True)
    return halves, edges, counts


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Volume of a closed mesh [m^3], positive where faces are wound outwards."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def girth(points: np.ndarray, faces: np.ndarray, axis: int, level: float) -> float:
    """Length [m] of a mesh's cut with the plane where coordinate `axis` is `level`, triangle by triangle."""
    total = 0.0
    for corners in points[faces]:
        height = corners[:, axis] - level
        ends = []
        for i, j in ((0, 1), (1, 2), (2, 0)):
            if height[i] * height[j] < 0:
                ends.append(corners[i] + (corners[j] - corners[i]) * height[i] / (height[i] - height[j]))
        if len(ends) == 2:
            total += float(np.linalg.norm(ends[1] - ends[0]))
    return total
