"""Connected pieces of a garment's surface: which lie inside out, and where an edge almost meets an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reference_sim.geometry.topology import half_edges

Array = NDArray[np.float64]
Index = NDArray[np.int64]

OUTWARD = 0.5  # share of the area that looks away from the skin, below which a piece is inside out
OPEN_SEAM = 0.05  # of the mean boundary edge: between boundary vertices that no edge joins, a seam left open


def piece_of_faces(faces: Index) -> Index:
    """Return the number (F,) of the piece that each face (F,3) is of, from 0; pieces share no vertex.

    >>> piece_of_faces(np.array([[0, 1, 2], [5, 6, 7], [2, 1, 3]])).tolist()
    [0, 1, 0]
    """
    halves, count = half_edges(faces), int(faces.max()) + 1
    graph = coo_array((np.ones(len(halves)), (halves[:, 0], halves[:, 1])), shape=(count, count))
    of_vertex = connected_components(graph, directed=False)[1]
    return np.unique(of_vertex[faces[:, 0]], return_inverse=True)[1]


def inside_out(areas: Array, outward: NDArray[np.bool_], pieces: Index) -> NDArray[np.bool_]:
    """Return which faces (F,) are of a piece of whose area half or less looks outward.

    Args:
        areas: (F,) [m^2].
        outward: (F,), whether a face looks away from the skin.
        pieces: (F,), of `piece_of_faces`.
    """
    share = np.bincount(pieces, areas * outward) / np.bincount(pieces, areas)
    return (share <= OUTWARD)[pieces]


def open_seam(positions: Array, faces: Index) -> tuple[Index, float]:
    """Return the boundary vertices (n,) at which a seam was left open, and its largest gap [m].

    They lie within `OPEN_SEAM` mean boundary edges of a boundary vertex that no edge joins them with. Without
    such a seam both are empty.

    Args:
        positions: (V,3) [m].
        faces: (F,3).
    """
    edges, uses = np.unique(np.sort(half_edges(faces), axis=1), axis=0, return_counts=True)
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
