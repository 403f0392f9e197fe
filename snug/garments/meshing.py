"""Mesh of a garment from its surface and cuts: half remeshed, kept off the body, mirrored at the seam."""

import numpy as np
from numpy.typing import NDArray

from reference_sim.geometry.topology import boundary_loops, corner_angles, triangle_areas
from snug.body.parametric_body import Body
from snug.garments.cuts import SEAM, CutPlane, cut_sheet, outlines
from snug.garments.implicit_surface import ImplicitSurface
from snug.garments.remeshing import remesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

AREA_BOUNDS = (0.5, 2.0)  # every triangle's area over the mean
SMALLEST_ANGLE = 15.0  # [degrees]


def mesh_garment(
    body: Body, surface: ImplicitSurface, cuts: list[CutPlane], vertices: int, clearance: float
) -> tuple[Array, Index]:
    """Return the whole garment, positions (V,3) [m] and faces (F,3), of `vertices` vertices within 1 %.

    clearance: least distance [m] from the skin. Raises ValueError where no sound mesh comes out.
    """
    sheet, sheet_faces = cut_sheet(surface, cuts)
    try:
        curves = outlines(sheet, sheet_faces, cuts)
    except ValueError as error:
        raise ValueError(f"nothing fits this body: {error}") from error
    names = sorted(name for loop in curves for name, _ in loop)
    expected = [cut.name for cut in cuts]  # the seam runs down front and back; of trousers the two are one
    if names not in (sorted([SEAM, *expected]), sorted(expected)) or [SEAM] in [
        [n for n, _ in c] for c in curves
    ]:
        raise ValueError(f"nothing fits this body: the cuts of its surface are {', '.join(names)}")
    rims = [[curve for _, curve in loop] for loop in curves]
    # An opening that the seam does not meet has a twin on the other side.
    openings = sum(2 if len(loop) == 1 else sum(name != SEAM for name, _ in loop) for loop in curves)
    # V = 2 half - seam, and only the mesh tells how many vertices its seam has; some sizes come out unsound.
    half, tried, problem = vertices // 2 + int(0.57 * np.sqrt(vertices)), set[int](), ""
    while len(tried) < 16:
        while half in tried:
            half += 1
        tried.add(half)
        try:
            points, faces = remesh(sheet, sheet_faces, rims, half, surface.project)
            count = 2 * len(points) - int(np.count_nonzero(np.abs(points[:, 0]) < 1e-6))
            if abs(count - vertices) > max(1, vertices // 100):
                half += (vertices - count) // 2
                raise ValueError(f"{count} vertices instead of {vertices}")
            whole, whole_faces = _mirror(_keep_off(body, points, faces, cuts, clearance), faces)
            _check_even(whole, whole_faces, openings)
            return whole, whole_faces
        except ValueError as error:
            problem = str(error)
    raise ValueError(f"vertices={vertices}: no sound mesh of this size ({problem}); ask for more")


def _mirror(points: Array, faces: Index) -> tuple[Array, Index]:
    """Return both halves, welded at x = 0."""
    seam = points[:, 0] == 0
    twin = np.where(seam, np.arange(len(points)), len(points) + np.cumsum(~seam) - 1)
    whole = np.concatenate([points, points[~seam] * [-1.0, 1.0, 1.0]])
    return whole, np.concatenate([faces, twin[faces][:, ::-1]])


def _keep_off(body: Body, points: Array, faces: Index, cuts: list[CutPlane], clearance: float) -> Array:
    """Push points outward, along their cuts, until no sample is nearer to the skin than `clearance` [m].

    Raises ValueError if it cannot be met.
    """
    import igl  # not loaded where garments are only named

    skin, skin_faces = np.asarray(body.template, dtype=np.float64), np.asarray(body.faces, dtype=np.int64)
    # Of a body that is not quite symmetric, both of its sides.
    skin = np.concatenate([skin, skin * [-1.0, 1.0, 1.0]])
    skin_faces = np.concatenate([skin_faces, skin_faces[:, ::-1] + len(body.template)])
    a, b, c = (skin[skin_faces[:, k]] for k in range(3))
    outward = np.cross(b - a, c - a)
    tree = igl.AABB()
    tree.init(skin, skin_faces)
    points = points.copy()
    for _ in range(30):
        corners = points[faces]
        middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
        samples = np.concatenate([corners, middles, corners.mean(axis=1, keepdims=True)], axis=1)  # (F,7,3)
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
            on = np.abs(cut.beyond(points)) < 1e-6
            normal = cut.normals(points[on])
            # Along the cut, and longer: the distance must still grow by what is lacking.
            slanted = push[on] - np.sum(push[on] * normal, axis=1, keepdims=True) * normal
            length2 = np.sum(push[on] ** 2, axis=1), np.maximum(np.sum(slanted**2, axis=1), 1e-20)
            push[on] = slanted * np.minimum(length2[0] / length2[1], 4.0)[:, None]
        points += push
    raise ValueError(f"{1000 * lack.max():.2f} mm of clearance missing")


def _check_even(points: Array, faces: Index, wanted: int) -> None:
    """Raise ValueError for a triangle too small, large or sharp, and for another number of openings."""
    areas = triangle_areas(points, faces)
    ratio = areas / areas.mean()
    if ratio.min() < AREA_BOUNDS[0] or ratio.max() > AREA_BOUNDS[1]:
        raise ValueError(f"triangle areas from {ratio.min():.2f} to {ratio.max():.2f} of the mean")
    smallest = np.degrees(corner_angles(points, faces).min())
    if smallest < SMALLEST_ANGLE:
        raise ValueError(f"an angle of {smallest:.1f} degrees")
    openings = len(boundary_loops(faces))
    if openings != wanted:
        raise ValueError(f"{openings} openings instead of {wanted}")
