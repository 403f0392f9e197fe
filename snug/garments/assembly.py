"""Assembly of a garment: a surface about the body and its cuts, meshed, openings named, weights borrowed."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from reference_sim.geometry.topology import boundary_loops
from snug.body.parametric_body import Body
from snug.garments.cuts import SEAM, CutPlane
from snug.garments.garment import Garment, GarmentError, smooth_weights
from snug.garments.implicit_surface import build_surface
from snug.garments.landmarks import SHIRT_BONES, joint_position, skin_following
from snug.garments.meshing import mesh_garment

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SMOOTHED_OVER = 0.1  # [m] about the hip joints: from borrowed weights to smoothed ones


def nearest_body_vertices(body: Body, positions: Array, bones: Sequence[str] = SHIRT_BONES) -> Index:
    """Return the nearest template vertex (V,) that follows one of `bones` to each position (V,3) [m]."""
    allowed = np.flatnonzero(skin_following(body, bones))
    return allowed[cKDTree(np.asarray(body.template)[allowed]).query(positions)[1]]


def assemble_garment(
    name: str, body: Body, vertices: int, cut: Mapping[str, float], surface: Mapping[str, Any],
    cuts: list[CutPlane], bones: Sequence[str], smoothing: int = 0,
) -> Garment:  # fmt: skip
    """Make the garment of a surface and its cuts.

    Args:
        name: of the garment.
        body: that it is made for.
        vertices: number of vertices, met within 1 %.
        cut: parameters of the tailoring, stored with the garment.
        surface: arguments of build_surface.
        cuts: where the surface ends.
        bones: whose skin the garment borrows weights from.
        smoothing: rounds over them at 1000 vertices, below the hip joints or, with a waistband, everywhere.

    Raises:
        GarmentError: no sound mesh comes out.
    """
    try:
        sheet = build_surface(body, **surface, clearance=cut["clearance"])
        positions, faces = mesh_garment(body, sheet, cuts, vertices, cut["clearance"])
    except ValueError as error:
        raise GarmentError(f"{name}: {error}") from error
    loops = _named_loops(positions, faces, cuts)
    nearest = nearest_body_vertices(body, positions, bones)
    borrowed = np.asarray(body.skinning_weights)[nearest]
    weights = smooth_weights(borrowed, faces, round(smoothing * vertices / 1000))
    if smoothing and "waist" not in loops:
        above = positions[:, 1] - joint_position(body, "left_hip")[1]
        share = np.clip(above / SMOOTHED_OVER + 0.5, 0.0, 1.0)[:, None]
        weights = share * borrowed + (1 - share) * weights
    return Garment(
        name=name,
        rest_positions=positions,
        faces=faces,
        body_vertices=nearest,
        skinning_weights=weights,
        loops=loops,
        pins=np.sort(loops.get("waist", np.empty(0, dtype=np.int64))),
        parameters=dict(cut),
    )


def _named_loops(points: Array, faces: Index, cuts: Sequence[CutPlane]) -> dict[str, Index]:
    """Return the openings by the cuts that they lie on, each from its front-most vertex on."""
    openings = [cut for cut in cuts if cut.name != SEAM]
    named = {}
    for loop in boundary_loops(faces):
        left = points[loop] * [np.sign(points[loop, 0].mean()) or 1.0, 1.0, 1.0]
        off = [np.abs(cut.beyond(left)).mean() for cut in openings]
        cut = openings[int(np.argmin(off))]
        mirrored = cut.twin and points[loop, 0].mean() < 0
        named[cut.twin if mirrored else cut.name] = np.roll(loop, -int(np.argmax(points[loop, 2])))
    return {name: named[name] for cut in reversed(openings) for name in (cut.name, cut.twin) if name}
