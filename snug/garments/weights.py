"""Skinning weights of a garment from a file: those that came with it, or those of the skin below it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import igl
import numpy as np
from numpy.typing import NDArray

from reference_sim.files.array_file import ArrayFileError, read_arrays
from reference_sim.geometry.closest_point import FaceSearch
from snug.body.parametric_body import Body
from snug.body.skeleton import JOINT_NAMES
from snug.garments.garment import SKIRT_SMOOTHING, GarmentError, smooth_weights
from snug.garments.landmarks import joint_position, skin_following

Array = NDArray[np.float64]
Index = NDArray[np.int64]

KEY = "weights"  # of the array in an .npz; of a PLY's properties weight_0 to weight_23
NEVER = ("head", "left_wrist", "right_wrist", "left_hand", "right_hand", "left_foot", "right_foot")
INSIDE = 0.5  # winding number of the garment around what it encloses
COVERED = 0.05  # share of a limb's skin within a garment, from which the garment follows that limb
BELOW_HIPS = 0.1  # [m] below the hip joints, from where one tube around both legs follows neither


def find_weights(
    body: Body, positions: Array, faces: Index, *, legs: bool, authored: Array | None
) -> tuple[Array, Index, tuple[str, ...]]:
    """Find the skinning weights of a garment on the unposed body.

    They are the authored ones, or blended from the three corners of the closest face of the skin, among the
    limbs that the garment encloses. One tube around both legs is smoothed below the hips as a skirt is.

    Args:
        body: in the pose that the garment was made for.
        positions: (V,3) [m].
        faces: (F,3), wound outward.
        legs: whether each leg has its own opening.
        authored: (V,24), or None.

    Returns:
        Weights (V,24), nearest vertices of the body (V,), and names of the joints that the garment follows.
    """
    followed = enclosed_limbs(body, positions, faces)
    skin = np.asarray(body.faces)[skin_following(body, followed)[body.faces].all(axis=1)]
    search = FaceSearch(skin, body.template[skin].mean(axis=1))
    search.refit(body.template)
    closest = search.nearest(positions)
    corners = skin[closest.faces]
    nearest = corners[np.arange(len(corners)), closest.barycentric.argmax(axis=1)]
    if authored is not None:
        return authored, nearest, followed
    weights = np.einsum("va,vaj->vj", closest.barycentric, body.skinning_weights[corners])
    below = joint_position(body, "left_hip")[1] - positions[:, 1]
    if not legs and below.max() > BELOW_HIPS:
        # As far as a template's skirt, whatever the size of the triangles.
        smooth = smooth_weights(weights, faces, round(SKIRT_SMOOTHING * len(positions) / 1000))
        share = np.clip(below / BELOW_HIPS, 0.0, 1.0)[:, None]
        weights = (1 - share) * weights + share * smooth
    return weights, nearest, followed


def enclosed_limbs(body: Body, positions: Array, faces: Index) -> tuple[str, ...]:
    """Return the joints whose skin lies within the garment in part; never those of head, hands and feet.

    Within is where the generalised winding number of the open mesh is above a half. For a garment that
    encloses nothing, as a cape: all of them.
    """
    winding = igl.fast_winding_number(
        np.asfortranarray(positions), np.asfortranarray(faces), np.asfortranarray(body.template)
    )
    inside = np.abs(np.asarray(winding).ravel()) > INSIDE
    strongest = np.argmax(body.skinning_weights, axis=1)
    allowed = [name for name in JOINT_NAMES if name not in NEVER]
    limbs = {name: strongest == JOINT_NAMES.index(name) for name in allowed}
    limbs = {name: skin for name, skin in limbs.items() if skin.any()}
    return tuple(name for name, skin in limbs.items() if inside[skin].mean() > COVERED) or tuple(limbs)


def read_authored_weights(path: Path, data: Mapping[str, Array], beside: Path, count: int) -> Array | None:
    """Return weights (count, 24) of a file beside a mesh, or of the mesh's vertex data; None without either.

    Raises:
        GarmentError: weights of another shape, negative, or whose rows do not sum to one.
    """
    names = [f"{KEY.removesuffix('s')}_{number}" for number in range(len(JOINT_NAMES))]
    if beside.is_file():
        path = beside
        try:
            stored = read_arrays(beside, (KEY,))
        except ArrayFileError as error:
            raise GarmentError(str(error)) from None
        if KEY not in stored:
            raise GarmentError(
                f"{beside}: no array {KEY!r}: save weights (V, {len(JOINT_NAMES)}) by this name"
            )
        weights = stored[KEY]
    elif names[0] in data:
        if missing := [name for name in names if name not in data]:
            raise GarmentError(f"{path}: no vertex property {missing[0]!r} beside {names[0]!r}: give all 24")
        weights = np.stack([data[name] for name in names], axis=1)
    else:
        return None
    if weights.shape != (count, len(JOINT_NAMES)) or weights.dtype.kind not in "fiu":
        raise GarmentError(
            f"{path}: {KEY} are {weights.dtype} {weights.shape}: expected numbers ({count}, "
            f"{len(JOINT_NAMES)}), a row for each vertex of the mesh file"
        )
    weights = weights.astype(np.float64)
    sums = weights.sum(axis=1)
    off = ~(np.isfinite(weights).all(axis=1) & (weights >= -1e-6).all(axis=1) & (np.abs(sums - 1) < 1e-3))
    if off.any():
        row = int(np.argmax(off))
        raise GarmentError(
            f"{path}: weights of vertex {row} are negative or sum to {sums[row]:.4g} instead of 1"
        )
    return np.maximum(weights, 0.0) / np.maximum(weights, 0.0).sum(axis=1, keepdims=True)
