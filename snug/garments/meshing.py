"""Mesh of a garment from its surface and cuts: half remeshed, kept off the body, mirrored at the seam.

pyacvd's clusters give a ragged rim. So rim vertices are spread evenly along the cut lines of the dense sheet,
and the inner ones move towards a weighted mean of the triangles around them, between Delaunay flips.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from reference_sim.cloth import edge_table
from reference_sim.geometry.surface import vertex_normals
from reference_sim.geometry.topology import (
    Array,
    Index,
    boundary_loops,
    corner_angles,
    corner_areas,
    half_edges,
)
from snug.body.parametric_body import Body
from snug.garments.cuts import SEAM, CutPlane, cut_sheet, outlines
from snug.garments.implicit_surface import SHIRT_BONES, ImplicitSurface, skin_following

# Triangles pull with their area to this power. Power 1 (Lloyd's iteration) left areas of 0.45 to 2.0 of
# the mean at 2000 to 8000 vertices, power 3 leaves 0.52 to 1.9; it needs the short step, a full one
# oscillates.
EVENNESS = 3
RELAXATION_STEP = 0.2
RELAXATIONS = 40  # rounds of relax


def _angle_cotangent(tip: Array, a: Array, b: Array) -> Array:
    """Return the cotangents (N,) of the angles at `tip`."""
    u, v = a - tip, b - tip
    return np.sum(u * v, axis=1) / np.maximum(np.linalg.norm(np.cross(u, v), axis=1), 1e-30)


def delaunay_flips(points: Array, faces: Index, *, passes: int = 3) -> Index:
    """Flip interior edges whose two opposite angles add up to more than pi; return the faces."""
    faces = faces.copy()
    for _ in range(passes):
        ends, sides, tips = edge_table(faces, len(points))
        inner = (sides >= 0).all(axis=1)
        ends, sides, tips = ends[inner], sides[inner], tips[inner]
        p, q, r, s = points[ends[:, 0]], points[ends[:, 1]], points[tips[:, 0]], points[tips[:, 1]]
        excess = _angle_cotangent(r, p, q) + _angle_cotangent(s, p, q)
        # A flip must not turn a triangle over: both new normals agree with the old ones' sum.
        normal = np.cross(q - p, r - p) + np.cross(p - q, s - q)
        kept_side = (np.sum(np.cross(s - p, r - p) * normal, 1) > 0) & (
            np.sum(np.cross(r - q, s - q) * normal, 1) > 0
        )
        candidates = np.flatnonzero((excess < -1e-6) & kept_side)
        if not len(candidates):
            break
        edges = {tuple(edge) for edge in np.sort(half_edges(faces), 1).tolist()}
        touched = np.zeros(len(faces), dtype=bool)
        for e in candidates[np.argsort(excess[candidates], kind="stable")]:
            (a, b), (f, g), (c, d) = ends[e], sides[e], tips[e]
            edge = (int(min(c, d)), int(max(c, d)))
            if touched[f] or touched[g] or edge in edges:
                continue
            touched[[f, g]] = True
            edges.add(edge)
            faces[f], faces[g] = (a, d, c), (b, c, d)
    return faces


def relax(
    points: Array, faces: Index, rim: NDArray[np.bool_], surface: ImplicitSurface
) -> tuple[Array, Index]:
    """Move vertices along the surface towards larger triangles, flip edges; `rim` (V,) stay."""
    points = points.copy()
    for _ in range(RELAXATIONS):
        faces = delaunay_flips(points, faces, passes=1)
        pull = corner_areas(points[faces]) ** EVENNESS
        centroids = points[faces].mean(axis=1)
        weight = np.zeros(len(points))
        target = np.zeros_like(points)
        for k in range(3):
            np.add.at(weight, faces[:, k], pull)
            np.add.at(target, faces[:, k], pull[:, None] * centroids)
        moved = points + RELAXATION_STEP * (target / weight[:, None] - points)
        points[~rim] = surface.project(moved[~rim])
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
    a, b, c = (coarse_points[coarse_faces[:, k]] for k in range(3))
    if np.sum(np.cross(b - a, c - a) * normals[nearest]) < 0:
        coarse_faces = coarse_faces[:, ::-1]
    return coarse_points, coarse_faces


def _spread(curve: Array, count: int) -> Array:
    """Return `count` points (count,3) evenly along a polyline (P,3), its first included, its last not."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    shares = np.arange(count) / count
    return np.stack([np.interp(shares * length[-1], length, curve[:, k]) for k in range(3)], axis=1)


def _place_rim(points: Array, loop: Index, outline: list[Array]) -> None:
    """Spread the vertices of a loop, in place, evenly along its outline: a closed curve, or several."""
    if len(outline) == 1:
        outline = [np.concatenate([outline[0], outline[0][:1]])]
    corners = [int(np.argmin(np.linalg.norm(points[loop] - curve[0], axis=1))) for curve in outline]
    loop = np.roll(loop, -corners[0])
    stops = [(corner - corners[0]) % len(loop) for corner in corners] + [len(loop)]
    if np.any(np.diff(stops) < 1):
        raise ValueError("the rim of the mesh does not follow its outline")
    for curve, begin, end in zip(outline, stops[:-1], stops[1:], strict=True):
        points[loop[begin:end]] = _spread(curve, end - begin)


def remesh(
    points: Array, faces: Index, outlines: list[list[Array]], count: int, surface: ImplicitSurface
) -> tuple[Array, Index]:
    """Remesh a dense sheet (N,3) [m], (M,3) evenly, with about `count` vertices that stay on the surface.

    outlines: of each boundary loop its curves (P,3) end to end along the winding; one curve alone is
    closed.

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
    rim = np.zeros(len(coarse), dtype=bool)
    rim[np.concatenate(loops)] = True
    return relax(coarse, triangles, rim, surface)


AREA_BOUNDS = (0.5, 2.0)  # every triangle's area over the mean
SMALLEST_ANGLE = 15.0  # [degrees]


def mesh_garment(
    body: Body, surface: ImplicitSurface, cuts: list[CutPlane], vertices: int, clearance: float
) -> tuple[Array, Index]:
    """Return the whole garment, positions (V,3) [m] and faces (F,3), of `vertices` vertices within 1 %.

    clearance: least distance [m] from the skin. Raises ValueError where no sound mesh comes out.
    """
    sheet, sheet_faces = cut_sheet(surface, cuts)
    curves = outlines(sheet, sheet_faces, cuts)
    names = sorted(name for loop in curves for name, _ in loop)
    # The seam runs down front and back; of trousers the two are one.
    expected = [cut.name for cut in cuts]
    if names not in (sorted([SEAM, *expected]), sorted(expected)) or [SEAM] in [
        [n for n, _ in c] for c in curves
    ]:
        raise ValueError(f"nothing fits this body: the cuts of its surface are {', '.join(names)}")
    rims = [[curve for _, curve in loop] for loop in curves]
    # An opening that the seam does not meet has a twin on the other side.
    openings = sum(2 if len(loop) == 1 else sum(name != SEAM for name, _ in loop) for loop in curves)
    # V = 2 half - seam, and only the mesh tells how many vertices its seam has; some sizes come out
    # unsound.
    half, tried, problem = vertices // 2 + int(0.57 * np.sqrt(vertices)), set[int](), ""
    while len(tried) < 16:
        while half in tried:
            half += 1
        tried.add(half)
        try:
            points, faces = remesh(sheet, sheet_faces, rims, half, surface)
            count = 2 * len(points) - int(np.count_nonzero(np.abs(points[:, 0]) < 1e-6))
            if abs(count - vertices) > max(1, vertices // 100):
                half += (vertices - count) // 2
                raise ValueError(f"{count} vertices instead of {vertices}")
            # To the nanometre: digits that depend on the processor's sines would become other folds.
            points = _keep_off(body, points, faces, cuts, clearance).round(9)
            seam = points[:, 0] == 0
            twin = np.where(seam, np.arange(len(points)), len(points) + np.cumsum(~seam) - 1)
            whole_points = np.concatenate([points, points[~seam] * [-1.0, 1.0, 1.0]])
            whole_faces = np.concatenate([faces, twin[faces][:, ::-1]])
            _check_even(whole_points, whole_faces, openings)
            return whole_points, whole_faces
        except ValueError as error:
            problem = str(error)
    raise ValueError(f"vertices={vertices}: no sound mesh of this size ({problem}); ask for more")


def _keep_off(body: Body, points: Array, faces: Index, cuts: list[CutPlane], clearance: float) -> Array:
    """Push points outward, along their cuts, until no sample is nearer to the skin than `clearance` [m].

    Raises ValueError if it cannot be met.
    """
    import igl  # not loaded where garments are only named

    # Of a body that is not quite symmetric, both of its sides.
    skin = np.concatenate([body.template, body.template * [-1.0, 1.0, 1.0]])
    skin_faces = np.concatenate([body.faces, body.faces[:, ::-1] + len(body.template)])
    a, b, c = (skin[skin_faces[:, k]] for k in range(3))
    outward = np.cross(b - a, c - a)
    tree = igl.AABB()
    tree.init(skin, skin_faces)
    points = points.copy()
    for _ in range(30):
        corners = points[faces]
        middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
        # (F,7,3)
        samples = np.concatenate([corners, middles, corners.mean(axis=1, keepdims=True)], axis=1)
        squared, nearest, closest = tree.squared_distance(skin, skin_faces, samples.reshape(-1, 3))
        away = samples.reshape(-1, 3) - closest
        side = np.sign(np.sum(away * outward[nearest], axis=1))  # a chord may run inside of the body
        away *= (side / np.maximum(np.sqrt(squared), 1e-12))[:, None]
        distance = (side * np.sqrt(squared)).reshape(-1, 7)
        lack = clearance - distance.min(axis=1)
        if lack.max() <= 0:
            points[np.abs(points[:, 0]) < 1e-6, 0] = 0.0
            return points
        worst = np.arange(len(faces)), distance.argmin(axis=1)
        away = away.reshape(-1, 7, 3)[worst]
        short = np.flatnonzero(lack > 0)
        short = short[np.argsort(lack[short], kind="stable")]
        push = np.zeros_like(points)
        # A vertex of several such faces follows the worst one: the last to be written.
        push[faces[short].ravel()] = np.repeat(1.3 * (lack[short, None] + 1e-5) * away[short], 3, axis=0)
        for cut in cuts:
            on = np.abs(cut.depth(points)) < 1e-6
            normal = cut.normals(points[on])
            # Along the cut, and longer: the distance must still grow by what is lacking.
            slanted = push[on] - np.sum(push[on] * normal, axis=1, keepdims=True) * normal
            length2 = np.sum(push[on] ** 2, axis=1), np.maximum(np.sum(slanted**2, axis=1), 1e-20)
            push[on] = slanted * np.minimum(length2[0] / length2[1], 4.0)[:, None]
        points += push
    raise ValueError(f"{1000 * lack.max():.2f} mm of clearance missing")


def _check_even(points: Array, faces: Index, count: int) -> None:
    """Raise ValueError for a triangle too small, large or sharp, and for another number of openings."""
    areas = corner_areas(points[faces])
    ratio = areas / areas.mean()
    if ratio.min() < AREA_BOUNDS[0] or ratio.max() > AREA_BOUNDS[1]:
        raise ValueError(f"triangle areas from {ratio.min():.2f} to {ratio.max():.2f} of the mean")
    smallest = np.degrees(corner_angles(points, faces).min())
    if smallest < SMALLEST_ANGLE:
        raise ValueError(f"an angle of {smallest:.1f} degrees")
    openings = len(boundary_loops(faces))
    if openings != count:
        raise ValueError(f"{openings} openings instead of {count}")


def nearest_body_vertices(body: Body, positions: Array, bones: Sequence[str] = SHIRT_BONES) -> Index:
    """Return the nearest template vertex (V,) that follows one of `bones` to each position (V,3) [m]."""
    skin = np.flatnonzero(skin_following(body, bones))
    return skin[cKDTree(body.template[skin]).query(positions)[1]]
