"""Meshes made by formula, for scenes and checks: sheets, families of plane triangles, spheres, tori."""

from __future__ import annotations

import numpy as np

from reference_sim.geometry.topology import half_edges

FAMILIES = ("right", "cross", "union_jack", "equilateral", "delaunay")
# In the equilateral family: distance of neighbours in a column, over that of columns.
ROW = 2 / 3**0.5


def jittered_patch(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a Delaunay mesh of the unit square: points (V,2) [m], faces (F,3), counter-clockwise."""
    random = np.random.default_rng(0)
    points = np.moveaxis(np.indices((cells + 1, cells + 1)), 0, -1).astype(float)
    points[1:-1, 1:-1] += random.uniform(-0.3, 0.3, (cells - 1, cells - 1, 2))
    points = points.reshape(-1, 2) / cells
    return points, delaunay_faces(points)


def delaunay_faces(points: np.ndarray) -> np.ndarray:
    """Return Delaunay triangles (F,3) of points (V,2), counter-clockwise, without flat ones on borders."""
    from scipy.spatial import Delaunay

    faces = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    solid = np.abs(signed) > 1e-9
    faces, signed = faces[solid], signed[solid]
    faces[signed < 0] = faces[signed < 0][:, ::-1]
    return faces


def right_grid(rows: int, columns: int, height: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return right triangles, all diagonals alike: points (V,2) [m], row by row, faces (F,3).

    >>> points, faces = right_grid(1, 2, 0.5, 1.0)
    >>> points.shape, len(faces)
    ((6, 2), 4)
    """
    x, y = np.meshgrid(np.linspace(0, width, columns + 1), np.linspace(0, height, rows + 1))
    a, b, c, d = _corners(rows, columns)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x.ravel(), y.ravel()], 1), faces


def in_space(points: np.ndarray) -> np.ndarray:
    """Return points (V,2) as (V,3) in the plane z = 0."""
    return np.concatenate([points, np.zeros((len(points), 1))], axis=1)


def lying(points: np.ndarray) -> np.ndarray:
    """Return points (V,2) as (V,3) in the plane y = 0, where faces that were counter-clockwise look down."""
    return in_space(points)[:, [0, 2, 1]]


def random_rotation(seed: int) -> np.ndarray:
    """Return a proper rotation (3,3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def icosphere(subdivisions: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return an icosahedron refined and pushed out to `radius` [m]: points (V,3), outward faces (F,3).

    >>> points, faces = icosphere(1, 1.0)
    >>> len(points), len(faces)
    (42, 80)
    """
    golden = (1 + 5**0.5) / 2
    corners = [(0.0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(corner, k) for k in range(3) for corner in corners])
    edges = np.isclose(np.linalg.norm(points[:, None] - points[None], axis=2), 2.0)
    i, j, k = np.indices((12, 12, 12))
    faces = np.argwhere((i < j) & (i < k) & edges[i, j] & edges[j, k] & edges[k, i])
    faces = faces[np.linalg.det(points[faces]) > 0]
    for _ in range(subdivisions):
        unique, inverse = np.unique(np.sort(half_edges(faces), axis=1), axis=0, return_inverse=True)
        a, b, c = inverse.reshape(-1, 3).T + len(points)
        points = np.concatenate([points, points[unique].mean(1)])
        i, j, k = faces.T
        faces = np.stack([(i, a, c), (a, j, b), (c, b, k), (a, b, c)]).transpose(0, 2, 1).reshape(-1, 3)
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True), faces


def cylinder_patch(cells: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return two radians of a cylinder about y, as high as its radius [m]: points and faces."""
    flat, faces = right_grid(cells, cells, radius, 2.0)
    angle = flat[:, 0]
    return np.stack([radius * np.cos(angle), flat[:, 1], radius * np.sin(angle)], axis=1), faces


def torus(cells: int, major: float, minor: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a closed torus [m] of 2 x `cells` by `cells`, with its exact mean curvature.

    H = (R + 2 r cos v) / (2 r (R + r cos v)) with v the angle around the tube.

    Returns:
        Points (V,3) [m], faces (F,3), and H (V,) [1/m].
    """
    i, j = np.indices((2 * cells, cells))
    u, v = np.pi / cells * i, 2 * np.pi / cells * j
    across = minor * np.cos(v)
    ring = major + across
    points = np.stack([ring * np.cos(u), minor * np.sin(v), ring * np.sin(u)], -1).reshape(-1, 3)
    i_next, j_next = (i + 1) % (2 * cells), (j + 1) % cells
    around = ((i, j), (i_next, j), (i_next, j_next), (i, j_next))
    a, b, c, d = ((p * cells + q).ravel() for p, q in around)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return points, faces, ((ring + across) / (2 * minor * ring)).ravel()


def rectangle(
    family: str, columns: int, rows: int, length: float, width: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return [0, length] x [0, width] in `columns` x `rows` cells: points (V,2) [m], faces (F,3).

    The families of triangles: right, all diagonals alike; cross, both diagonals; union_jack, diagonals
    alternate; equilateral, columns shifted by half a cell in turn (truly equilateral if cells are 1 by
    ROW); delaunay, inner vertices moved by up to 0.3 cells. The first two columns are regular in all, so
    that a clamp means the same. Raises ValueError for an unknown family.
    """
    points, faces = right_grid(rows, columns, width, length)
    cell = np.array([length / columns, width / rows])
    if family == "right":
        return points, faces
    if family == "union_jack":
        return points, _alternate(rows, columns)
    if family == "cross":
        return _cross(points, rows, columns)
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
    """Return one column of vertices of the equilateral family, in cells; a shifted one keeps its ends."""
    y = np.arange(rows + 1.0)
    if i % 2:
        y = np.concatenate([[0.0], np.arange(rows) + 0.5, [float(rows)]])
    return np.stack([np.full(len(y), float(i)), y], axis=1)


def _corners(rows: int, columns: int) -> tuple[np.ndarray, ...]:
    """Return the corners of each cell of a grid, (rows * columns,) each, one after another around it."""
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    return a, a + 1, a + columns + 2, a + columns + 1


def _even(rows: int, columns: int) -> np.ndarray:
    """Return whether each cell of a grid is of one colour of a chessboard, (rows * columns, 1)."""
    return ((np.arange(rows)[:, None] + np.arange(columns)) % 2 == 0).reshape(-1, 1)


def _alternate(rows: int, columns: int) -> np.ndarray:
    a, b, c, d = _corners(rows, columns)
    even = _even(rows, columns)
    first = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return np.concatenate([first, second])


def _cross(points: np.ndarray, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    corners = _corners(rows, columns)
    middle = len(points) + np.arange(rows * columns)
    centres = sum(points[corner] for corner in corners) / 4
    sides = zip(corners, corners[1:] + corners[:1])
    return np.concatenate([points, centres]), np.concatenate(
        [np.stack([one, other, middle], 1) for one, other in sides]
    )


def square_sheet(cells: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a horizontal square of `size` [m] about the origin, facing up: (V,3) [m], faces (F,3).

    The vertices of a regular grid are nudged by up to a quarter of a cell inside the square and the
    diagonals alternate, so that no direction of the mesh is special. Vertex i * (cells + 1) + j is the
    j-th along z of the i-th row along x.
    """
    i, j = np.indices((cells + 1, cells + 1))
    nudge = np.random.default_rng(0).uniform(-0.25, 0.25, (2, *i.shape))
    nudge[:, [0, -1], :] = 0.0
    nudge[:, :, [0, -1]] = 0.0
    x = size * ((i + nudge[0]) / cells - 0.5)
    z = size * ((j + nudge[1]) / cells - 0.5)
    positions = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)

    a, d, c, b = _corners(cells, cells)
    even = _even(cells, cells)
    first = np.where(even, np.stack([a, c, b], 1), np.stack([a, d, b], 1))
    second = np.where(even, np.stack([a, d, c], 1), np.stack([b, d, c], 1))
    return positions, np.concatenate([first, second])


def sphere(radius: float, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a closed sphere about the origin: positions (B,3) [m], outward faces (G,3).

    A cube of `cells` x `cells` squares a side, pushed out to the radius [m]; tan evens the squares out.

    >>> points, faces = sphere(0.1, 4)
    >>> len(points) - len(faces) // 2  # of a closed surface without holes
    2
    """
    ticks = np.tan(np.linspace(-np.pi / 4, np.pi / 4, cells + 1))
    u, v = np.meshgrid(ticks, ticks, indexing="ij")
    one = np.ones_like(u)
    sides = [
        np.roll(np.stack([one * s, u, v * s], -1), k, axis=-1) for k in range(3) for s in (-1.0, 1.0)
    ]
    points = np.concatenate([side.reshape(-1, 3) for side in sides])
    a, d, c, b = _corners(cells, cells)
    square = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    faces = np.concatenate([square + k * (cells + 1) ** 2 for k in range(6)])
    # Points on the cube's edges were made once for each side: keep one of each.
    _, first, inverse = np.unique(
        np.round(points, 12) + 0.0, axis=0, return_index=True, return_inverse=True
    )
    points, faces = points[first], inverse.ravel()[faces]
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True), faces
