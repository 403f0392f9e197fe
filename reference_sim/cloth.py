"""Rest state of a cloth: everything that a term may need to know about it, computed once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from reference_sim.material import Material


class MeshError(ValueError):
    """Mesh that cannot be simulated; the message names the offending element."""


@dataclass(frozen=True, eq=False)
class Cloth:
    """Triangle mesh at rest with its material and pinned vertices.

    The rest state of areas, masses, strain and hinges is rest_positions, or the flat rest_uv where it is
    given; rest_positions then stays the starting shape.

    Raises MeshError that names the element: wrong shapes, NaN, zero-area face, coincident or unused
    vertices, seam left open, non-manifold edge, inconsistent winding, pin out of range.

    Example: a square of two triangles, held at one corner.

        >>> import numpy as np
        >>> from reference_sim import Cloth
        >>> corners = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1], [0.1, 0.0, 0.1]])
        >>> cloth = Cloth(corners, np.array([[0, 2, 1], [1, 2, 3]]), pins=[0])
        >>> cloth.areas.sum().round(4).item(), cloth.masses.sum().round(6).item()  # [m^2], [kg]
        (0.01, 0.002002)
        >>> cloth.hinges.tolist()
        [[1, 2, 3, 0]]
        >>> Cloth(corners, np.array([[0, 1, 1]]))
        Traceback (most recent call last):
        reference_sim.cloth.MeshError: face 0 = [0, 1, 1] names a vertex twice: remove it
    """

    rest_positions: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3) vertex indices, consistently wound
    material: Material = field(default_factory=Material)
    pins: np.ndarray | tuple | list = ()  # vertices that never move by themselves
    rest_uv: np.ndarray | None = None  # (V, 2) [m], or (F, 3, 2) of the faces' corners

    def __post_init__(self) -> None:
        # Copies: what is computed from them once must not change with the caller's arrays.
        positions = np.array(self.rest_positions, dtype=np.float64, order="C")
        faces = np.asarray(self.faces)
        check_mesh(positions, faces)
        faces = np.array(faces, dtype=np.int64, order="C")
        pins = np.unique(np.asarray(self.pins))
        if pins.size and not (pins.dtype.kind in "iu" and pins[0] >= 0 and pins[-1] < len(positions)):
            raise MeshError(f"pins {pins[0]} to {pins[-1]}: give indices from 0 to {len(positions) - 1}")
        pins = pins.astype(np.int64)
        uv = self.rest_uv
        if uv is not None:
            uv = np.array(uv, dtype=np.float64, order="C")
            if uv.shape not in ((len(positions), 2), (len(faces), 3, 2)) or not np.isfinite(uv).all():
                raise MeshError(
                    f"rest_uv has shape {uv.shape}: expected finite ({len(positions)}, 2) or "
                    f"({len(faces)}, 3, 2)"
                )
        vars(self).update(rest_positions=positions, faces=faces, pins=pins, rest_uv=uv)
        small = np.flatnonzero(~(self.areas > 1e-12 * self.areas.max()))
        if small.size:
            raise MeshError(
                f"face {small[0]} has no rest area ({self.areas[small[0]]:.3g} m^2): remove it"
            )
        edges, sides, _ = self._edge_table  # raises on non-manifold edges
        _refuse_open_seams(positions, faces, np.unique(edges[(sides < 0).any(axis=1)]))

    @property
    def vertex_count(self) -> int:
        """Number of vertices V."""
        return len(self.rest_positions)

    @cached_property
    def free(self) -> np.ndarray:
        """(V,) True for vertices that are not pinned."""
        free = np.ones(self.vertex_count, dtype=bool)
        free[self.pins] = False
        return free

    @cached_property
    def rest_corners(self) -> np.ndarray:
        """(F, 3, 3), or (F, 3, 2) of a flat rest state: where the faces' corners are at rest [m]."""
        if self.rest_uv is None:
            return self.rest_positions[self.faces]
        return self.rest_uv[self.faces] if self.rest_uv.ndim == 2 else self.rest_uv

    @cached_property
    def frames(self) -> np.ndarray:
        """(F, 2, 2) matrices Dm = [X1 - X0, X2 - X0] in a local orthonormal frame of the face [m]."""
        corner = self.rest_corners
        first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        if corner.shape[2] == 2:
            return np.stack([first, second], axis=-1)
        length = np.linalg.norm(first, axis=1)
        along = np.einsum("fi,fi->f", first, second) / np.maximum(length, 1e-300)
        across = np.linalg.norm(np.cross(first, second), axis=1) / np.maximum(length, 1e-300)
        zero = np.zeros_like(length)
        return np.stack([np.stack([length, along], -1), np.stack([zero, across], -1)], axis=1)

    @cached_property
    def areas(self) -> np.ndarray:
        """(F,) rest areas [m^2]."""
        return 0.5 * np.abs(np.linalg.det(self.frames))

    @cached_property
    def Dm_inverse(self) -> np.ndarray:
        """(F, 2, 2) inverse of Dm [1/m]; F = [x1 - x0, x2 - x0] Dm^-1 is the deformation gradient."""
        return np.linalg.inv(self.frames)

    @cached_property
    def masses(self) -> np.ndarray:
        """(V,) lumped masses [kg]: a third of each adjacent face."""
        return self.material.areal_density * self.vertex_areas

    @cached_property
    def vertex_areas(self) -> np.ndarray:
        """(V,) a third of the adjacent rest areas [m^2]."""
        return np.bincount(self.faces.ravel(), np.repeat(self.areas / 3, 3), minlength=self.vertex_count)

    @cached_property
    def _edge_table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return edge_table(self.faces, self.vertex_count)

    @property
    def edges(self) -> np.ndarray:
        """(E, 2) vertex indices, lower first, sorted."""
        return self._edge_table[0]

    @cached_property
    def sides(self) -> np.ndarray:
        """(F, 3) edge on each side of the faces: between corners 0 and 1, 1 and 2, 2 and 0."""
        ends = np.sort(self.faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        scale = np.array([self.vertex_count, 1])
        return np.searchsorted(self.edges @ scale, ends @ scale)

    @cached_property
    def edge_lengths(self) -> np.ndarray:
        """(E,) rest lengths [m]; of an edge whose two faces differ, as on a seam, their mean."""
        corner, sides = self.rest_corners, self.sides.ravel()
        lengths = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).ravel()
        return np.bincount(sides, lengths) / np.bincount(sides)

    @cached_property
    def _inner(self) -> np.ndarray:
        return np.flatnonzero((self._edge_table[1] >= 0).all(axis=1))

    @cached_property
    def hinges(self) -> np.ndarray:
        """(H, 4) inner edges: edge start, edge end, tip of the first face, tip of the second face."""
        edges, _, tips = self._edge_table
        return np.ascontiguousarray(np.concatenate([edges[self._inner], tips[self._inner]], axis=1))

    @cached_property
    def hinge_lengths(self) -> np.ndarray:
        """(H,) rest length of the hinge edge [m]."""
        return self.edge_lengths[self._inner]

    @cached_property
    def hinge_areas(self) -> np.ndarray:
        """(H,) sum of the two rest areas beside the hinge [m^2]."""
        return self.areas[self._edge_table[1][self._inner]].sum(axis=1)


def edge_table(faces: np.ndarray, vertex_count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return edges (E, 2), lower vertex first, sorted; the faces beside and the vertices opposite (E, 2).

    The first of the two faces walks the edge from its lower to its higher vertex; -1 at the boundary.
    Raises MeshError for an edge with more faces, or two that walk it the same way.
    """
    half = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    opposite = faces[:, [2, 0, 1]].ravel()
    key = half.min(1) * vertex_count + half.max(1)
    order = np.argsort(key, kind="stable")
    unique, start, count = np.unique(key[order], return_index=True, return_counts=True)
    edges = np.stack(np.divmod(unique, vertex_count), axis=1)
    if (count > 2).any():
        bad = np.argmax(count > 2)
        sharing = sorted((order[start[bad] :][: count[bad]] // 3).tolist())
        raise MeshError(
            f"edge ({edges[bad, 0]}, {edges[bad, 1]}) has {count[bad]} faces {sharing}: a surface is "
            "manifold, split it"
        )
    sides = np.full((len(unique), 2), -1, dtype=np.int64)
    tips = sides.copy()
    forward = half[:, 0] < half[:, 1]
    for side in (0, 1):
        rows = np.flatnonzero(count > side)
        halves = order[start[rows] + side]
        column = np.where(forward[halves], 0, 1)
        clashes = sides[rows, column] >= 0
        if clashes.any():
            bad = rows[clashes][0]
            raise MeshError(
                f"faces {sides[bad].max()} and {halves[clashes][0] // 3} walk edge "
                f"({edges[bad, 0]}, {edges[bad, 1]}) the same way: make the winding consistent"
            )
        sides[rows, column] = halves // 3
        tips[rows, column] = opposite[halves]
    return edges, sides, tips


# Of the lowest face at either: boundary vertices nearer than that are of a seam left open.
OPEN_SEAM = 0.1


def _refuse_open_seams(positions: np.ndarray, faces: np.ndarray, rim: np.ndarray) -> None:
    """Raise MeshError where a mesh (V, 3) [m], (F, 3) has a seam whose sides lie close and are not joined.

    rim: (R,) its boundary vertices. At such a seam two of them lie within `OPEN_SEAM`
    heights of the faces at either. The sides of a narrow strip do not: its faces are as low.
    """
    from scipy.spatial import cKDTree

    if not len(rim):
        return
    sides = positions[np.roll(faces, -1, axis=1)] - positions[faces]
    doubled_areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    face_heights = doubled_areas / np.linalg.norm(sides, axis=2).max(axis=1)
    heights = np.full(len(positions), np.inf)
    np.minimum.at(heights, faces, face_heights[:, None])
    radius = OPEN_SEAM * heights[rim].max()
    pairs = rim[cKDTree(positions[rim]).query_pairs(radius, output_type="ndarray")]
    gaps = np.linalg.norm(np.diff(positions[pairs], axis=1)[:, 0], axis=1)
    seam = gaps < OPEN_SEAM * heights[pairs].min(axis=1)
    if not seam.any():
        return
    ends, gap = pairs[seam], 1e3 * gaps[seam].max()
    place = ", ".join(f"{x:.3f}" for x in positions[ends.min()])
    raise MeshError(
        f"{len(np.unique(ends))} vertices of a seam lie up to {gap:.2g} mm apart, one at ({place}) m: merge "
        f"vertices closer than {1.1 * gap:.2g} mm (weld); where a slit is meant, open it wider"
    )


def check_mesh(positions: np.ndarray, faces: np.ndarray) -> None:
    """Raise MeshError for shapes, indices and vertices that no cloth can have."""
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise MeshError(f"rest_positions has shape {positions.shape}: expected (V, 3)")
    if faces.ndim != 2 or faces.shape[1] != 3 or not np.issubdtype(faces.dtype, np.integer):
        raise MeshError(f"faces has shape {faces.shape} and type {faces.dtype}: expected integers (F, 3)")
    if len(faces) == 0:
        raise MeshError("the mesh has no faces")
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if bad.size:
        raise MeshError(f"vertex {bad[0]} is not finite: {positions[bad[0]].tolist()}")
    bad = np.flatnonzero(((faces < 0) | (faces >= len(positions))).any(axis=1))
    if bad.size:
        face = faces[bad[0]].tolist()
        raise MeshError(f"face {bad[0]} = {face} names a vertex outside 0..{len(positions) - 1}")
    bad = np.flatnonzero((faces == np.roll(faces, 1, axis=1)).any(axis=1))
    if bad.size:
        raise MeshError(f"face {bad[0]} = {faces[bad[0]].tolist()} names a vertex twice: remove it")
    unused = np.setdiff1d(np.arange(len(positions)), faces)
    if unused.size:
        raise MeshError(f"vertex {unused[0]} belongs to no face: remove it")
    order = np.lexsort(positions.T)
    twins = np.flatnonzero((np.diff(positions[order], axis=0) == 0).all(axis=1))
    if twins.size:
        pair = sorted(order[twins[0] : twins[0] + 2].tolist())
        raise MeshError(f"vertices {pair[0]} and {pair[1]} coincide: merge them (weld)")
