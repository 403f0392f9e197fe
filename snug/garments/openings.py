"""Pieces of a garment's surface and what bounds them: seams left open, openings named by their place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reference_sim.geometry.topology import boundary_loops, edge_uses
from snug.body.parametric_body import Body
from snug.garments.implicit_surface import joint_position

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ARMHOLE = 0.2  # share of the upper arm, beyond which an opening is a sleeve
OPEN_SEAM = 0.05  # of the mean boundary edge: between boundary vertices that no edge joins, a seam left open
MIDDLE = 0.5  # share of a hip joint's distance from the middle, beyond which an opening is a sleeve or a leg
ORDER = ("neck", "waist", "left_sleeve", "right_sleeve", "left_armhole", "right_armhole", "left_leg",
         "right_leg", "hem")  # fmt: skip


def name_openings(body: Body, positions: Array, faces: Index) -> dict[str, Index]:
    """Return the boundary vertices of each opening by its name, along the winding, front-most first.

    The garment (V,3) [m], (F,3) lies on the unposed body. An opening beside the middle is a sleeve above the
    hips, or far out, and a leg else; a sleeve that ends near the shoulder's joint is an armhole. In the
    middle the highest is the neck, above half the way from pelvis to neck, or else the waist, and the lowest
    the hem; one that is alone there is the hem, unless there are legs. The lowest of all is called hem too
    where no other is, but for two legs. Others are opening_1 and so on.

    Raises:
        ValueError: loops touch.
    """
    loops = [np.roll(loop, -int(np.argmax(positions[loop, 2]))) for loop in boundary_loops(faces)]
    if not loops:
        return {}
    centres = [positions[loop].mean(axis=0) for loop in loops]
    heights = [float(centre[1]) for centre in centres]
    openings: dict[str, int] = {}
    middle = []
    # The longest loop comes first: of two with one claim it has the name, a slit or a buttonhole has not.
    for number, centre in enumerate(centres):
        if side := _name_beside(body, centre):
            openings.setdefault(side, number)
        else:
            middle.append(number)
    if middle:
        middle.sort(key=lambda number: -heights[number])
        half_way = 0.5 * (joint_position(body, "pelvis")[1] + joint_position(body, "neck")[1])
        top = "neck" if heights[middle[0]] > half_way else "waist"
        if len(middle) > 1:
            openings |= {top: middle[0], "hem": middle[-1]}
        else:
            openings[top if openings.keys() & {"left_leg", "right_leg"} else "hem"] = middle[0]
    if not {"left_leg", "right_leg"} <= openings.keys():
        openings.setdefault("hem", int(np.argmin(heights)))
    rest = (number for number in range(len(loops)) if number not in openings.values())
    named = {name: loops[openings[name]] for name in ORDER if name in openings}
    return named | {f"opening_{count}": loops[number] for count, number in enumerate(rest, start=1)}


def _name_beside(body: Body, centre: Array) -> str:
    """Return the name of the sleeve or leg that ends there, or empty in the middle."""
    hip, shoulder = joint_position(body, "left_hip"), joint_position(body, "left_shoulder")
    middle = joint_position(body, "pelvis")[0]
    out = abs(centre[0] - middle)
    if out < MIDDLE * (hip[0] - middle):
        return ""
    arm = float(np.linalg.norm(joint_position(body, "left_elbow") - shoulder))
    beyond = out > shoulder[0] - middle + ARMHOLE * arm
    limb = "sleeve" if beyond else "armhole" if centre[1] > hip[1] else "leg"
    return f"{'left' if centre[0] > middle else 'right'}_{limb}"


def piece_of_faces(faces: Index) -> Index:
    """Return the number (F,) of the piece that each face (F,3) is of, from 0; pieces share no vertex.

    >>> piece_of_faces(np.array([[0, 1, 2], [5, 6, 7], [2, 1, 3]])).tolist()
    [0, 1, 0]
    """
    (edges, _), count = edge_uses(faces), int(faces.max()) + 1
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(count, count))
    of_vertex = connected_components(graph, directed=False)[1]
    return np.unique(of_vertex[faces[:, 0]], return_inverse=True)[1]


def open_seam(positions: Array, faces: Index) -> tuple[Index, float]:
    """Return the boundary vertices (n,) at which a seam was left open, and its largest gap [m].

    They lie within `OPEN_SEAM` mean boundary edges of a boundary vertex that no edge joins them with. Without
    such a seam both are empty.

    Args:
        positions: (V,3) [m].
        faces: (F,3).
    """
    edges, uses = edge_uses(faces)
    rim = edges[uses == 1]
    if not len(rim):
        return np.empty(0, dtype=np.int64), 0.0
    length = np.linalg.norm(positions[rim[:, 0]] - positions[rim[:, 1]], axis=1).mean()
    vertices = np.unique(rim)
    pairs = cKDTree(positions[vertices]).query_pairs(OPEN_SEAM * length, output_type="ndarray")
    pairs = np.sort(vertices[pairs], axis=1)
    apart = pairs[~np.isin(pairs @ [len(positions), 1], edges @ [len(positions), 1])]
    gaps = np.linalg.norm(positions[apart[:, 0]] - positions[apart[:, 1]], axis=1)
    return np.unique(apart), float(gaps.max(initial=0.0))
