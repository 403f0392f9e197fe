"""Remesh half of a garment: cluster a dense sheet, put its rim on the exact cut lines, relax.

pyacvd's clusters give the number of vertices that was asked for, but a ragged rim. So rim vertices are spread
evenly along the cut lines of the dense sheet, and the inner ones move towards a weighted mean of the
triangles around them, kept on the surface, between Delaunay flips.
"""

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from reference_sim.geometry.surface import vertex_normals
from reference_sim.geometry.topology import boundary_loops, half_edges, triangle_areas

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Projection = Callable[[Array], Array]  # points (N,3) [m] onto a surface

# Triangles pull with their area to this power. Power 1 (Lloyd's iteration) left areas of 0.45 to 2.0 of the
# mean at 2000 to 8000 vertices, power 3 leaves 0.52 to 1.9; it needs the short step, a full one oscillates.
EVENNESS = 3
RELAXATION_STEP = 0.2
RELAXATIONS = 40  # rounds of relax


def along(curve: Array, shares: Array) -> Array:
    """Return points at the given shares (N,) of the length of a polyline (P,3)."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    return np.stack([np.interp(shares * length[-1], length, curve[:, k]) for k in range(3)], axis=1)


def interior_edges(faces: Index) -> tuple[Index, Index, Index]:
    """Return edges with two faces: ends (E,2) as wound in the first, faces (E,2), far corners (E,2)."""
    halves = half_edges(faces)
    key = np.sort(halves, axis=1) @ [int(faces.max()) + 1, 1]
    order = np.argsort(key, kind="stable")
    twin = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[twin], order[twin + 1]
    opposite = faces[:, [2, 0, 1]].reshape(-1)
    return (
        halves[first],
        np.stack([first // 3, second // 3], 1),
        np.stack([opposite[first], opposite[second]], 1),
    )


def _angle_cotangent(tip: Array, a: Array, b: Array) -> Array:
    """Return the cotangents (N,) of the angles at `tip`."""
    u, v = a - tip, b - tip
    return np.sum(u * v, axis=1) / np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-30)


def delaunay_flips(points: Array, faces: Index, *, passes: int = 3) -> Index:
    """Flip interior edges whose two opposite angles add up to more than pi; return the faces."""
    faces = faces.copy()
    for _ in range(passes):
        ends, sides, far = interior_edges(faces)
        p, q, r, s = points[ends[:, 0]], points[ends[:, 1]], points[far[:, 0]], points[far[:, 1]]
        excess = _angle_cotangent(r, p, q) + _angle_cotangent(s, p, q)
        # A flip must not turn a triangle over: both new normals agree with the old ones' sum.
        normal = np.cross(q - p, r - p) + np.cross(p - q, s - q)
        kept_side = (np.sum(np.cross(s - p, r - p) * normal, 1) > 0) & (
            np.sum(np.cross(r - q, s - q) * normal, 1) > 0
        )
        candidates = np.flatnonzero((excess < -1e-6) & kept_side)
        if not len(candidates):
            break
        present = {tuple(edge) for edge in np.sort(half_edges(faces), 1).tolist()}
        touched = np.zeros(len(faces), dtype=bool)
        for e in candidates[np.argsort(excess[candidates], kind="stable")]:
            (a, b), (f, g), (c, d) = ends[e], sides[e], far[e]
            edge = (int(min(c, d)), int(max(c, d)))
            if touched[f] or touched[g] or edge in present:
                continue
            touched[[f, g]] = True
            present.add(edge)
            faces[f], faces[g] = (a, d, c), (b, c, d)
    return faces


def relax(points: Array, faces: Index, held: NDArray[np.bool_], project: Projection) -> tuple[Array, Index]:
    """Move vertices towards larger triangles, and flip edges; `held` (V,) vertices stay.

    project: maps points (N,3) back onto the surface.
    """
    points = points.copy()
    for _ in range(RELAXATIONS):
        faces = delaunay_flips(points, faces, passes=1)
        pull = triangle_areas(points, faces) ** EVENNESS
        centroids = points[faces].mean(axis=1)
        weight = np.zeros(len(points))
        target = np.zeros_like(points)
        for k in range(3):
            np.add.at(weight, faces[:, k], pull)
            np.add.at(target, faces[:, k], pull[:, None] * centroids)
        moved = points + RELAXATION_STEP * (target / weight[:, None] - points)
        points[~held] = project(moved[~held])
    return points, delaunay_flips(points, faces)


def _cluster(points: Array, faces: Index, count: int) -> tuple[Array, Index]:
    """Return a coarser mesh of about `count` vertices by centroidal clustering (pyacvd)."""
    # VTK takes a second to load, and garments are often only named.
    import igl
    import pyacvd
    import pyvista

    sheet = pyvista.PolyData.from_regular_faces(points, faces.tolist())
    while sheet.n_points < 40 * count:
        sheet = sheet.subdivide(1, "linear")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyacvd 0.4 reads a property that pyvista 0.49 calls deprecated
        clustering = pyacvd.Clustering(sheet)
        clustering.cluster(count, maxiter=100)
        coarse = clustering.create_mesh(moveclus=False)
    coarse_points = np.asarray(coarse.points, dtype=np.float64)
    coarse_faces = np.asarray(coarse.regular_faces, dtype=np.int64)
    # pyacvd winds each triangle by a guess at its normal, wrong near creases: make it the sheet's.
    coarse_faces = igl.bfs_orient(coarse_faces)[0].astype(np.int64)
    nearest = cKDTree(np.asarray(sheet.points)).query(coarse_points[coarse_faces].mean(axis=1))[1]
    normals = vertex_normals(np.asarray(sheet.points, dtype=np.float64), np.asarray(sheet.regular_faces))
    outward = normals[nearest]
    a, b, c = (coarse_points[coarse_faces[:, k]] for k in range(3))
    if np.sum(np.cross(b - a, c - a) * outward) < 0:
        coarse_faces = coarse_faces[:, ::-1]
    return coarse_points, coarse_faces


def _spread(curve: Array, count: int, *, closed: bool) -> Array:
    """Return `count` points (count,3) evenly along a polyline (P,3), its first included, its last not."""
    line = np.concatenate([curve, curve[:1]]) if closed else curve
    return along(line, np.arange(count) / count)


def _place_rim(points: Array, loop: Index, outline: list[Array]) -> None:
    """Spread the vertices of a loop, in place, evenly along its outline: a closed curve, or several."""
    if len(outline) == 1:
        curve = outline[0]
        start = int(np.argmin(np.linalg.norm(points[loop] - curve[0], axis=1)))
        points[np.roll(loop, -start)] = _spread(curve, len(loop), closed=True)
        return
    corners = [int(np.argmin(np.linalg.norm(points[loop] - curve[0], axis=1))) for curve in outline]
    loop = np.roll(loop, -corners[0])
    stops = [(corner - corners[0]) % len(loop) for corner in corners] + [len(loop)]
    if np.any(np.diff(stops) < 1):
        raise ValueError("the rim of the mesh does not follow its outline")
    for curve, begin, end in zip(outline, stops[:-1], stops[1:], strict=True):
        points[loop[begin:end]] = _spread(curve, end - begin, closed=False)


def remesh(
    points: Array, faces: Index, outlines: list[list[Array]], count: int, project: Projection
) -> tuple[Array, Index]:
    """Remesh a sheet whose boundary loops are the `outlines` evenly, with about `count` vertices.

    Args:
        points: (N,3) [m] of the dense sheet.
        faces: (M,3).
        outlines: per loop its curves (P,3) end to end along the winding; one curve alone is closed.
        count: number of vertices.
        project: maps points (N,3) back onto the surface.

    Raises:
        ValueError: the clusters are too coarse to keep the sheet's topology.
    """
    coarse, triangles = _cluster(points, faces, count)
    loops = boundary_loops(triangles)
    if len(loops) != len(outlines):
        raise ValueError(f"{count} vertices are too few to keep {len(outlines)} boundary loops apart")
    centres = np.stack([coarse[loop].mean(axis=0) for loop in loops])
    for outline in outlines:
        centre = np.concatenate(outline).mean(axis=0)
        _place_rim(coarse, loops[int(np.argmin(np.linalg.norm(centres - centre, axis=1)))], outline)
    held = np.zeros(len(coarse), dtype=bool)
    held[np.concatenate(loops)] = True
    return relax(coarse, triangles, held, project)
