"""Flat rest shape from the UV chart of a mesh: the pattern that a garment was sewn from, in metres.

Along a seam a vertex has one place in each piece of the pattern, so a chart is kept by the faces' corners. In
space the pieces are one mesh: vertices that a program has doubled for the sake of its chart are joined.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reference_sim.cloth import MeshError
from reference_sim.files.mesh_files import Surface
from reference_sim.geometry.topology import corner_areas

JOIN_DISTANCE = 1e-6  # [m] from which two vertices are one: round-off of six digits
AREA_FACTOR = 1.5  # a chart whose area is further from the mesh's is in another unit
LARGEST_STRETCH = 1.5  # from chart to mesh, or its inverse: no cloth is sewn so
STRETCHED_SHARE = 0.1  # of the area, from which a chart is no pattern


def join_seams(surface: Surface) -> tuple[Surface, np.ndarray]:
    """Join the doubled vertices of a surface in metres: those closer than a micrometre are one.

    Returns:
        The surface, and of each vertex left its number in the file (V,). A surface without doubled vertices
        stays as it is.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    count = len(surface.positions)
    pairs = cKDTree(surface.positions).query_pairs(JOIN_DISTANCE, output_type="ndarray")
    if not len(pairs):
        return surface, np.arange(count)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    of_vertex = connected_components(graph, directed=False)[1]
    _, first = np.unique(of_vertex, return_index=True)
    kept = np.sort(first)
    place = np.empty(count, dtype=np.int64)
    place[of_vertex[kept]] = np.arange(len(kept))
    joined = replace(surface, positions=surface.positions[kept], faces=place[of_vertex][surface.faces])
    return joined, kept


def rest_chart(surface: Surface, scale: float) -> np.ndarray:
    """Return the chart (F, 3, 2) [m] of a surface in metres, as `Cloth` takes it for `rest_uv`.

    Args:
        surface: positions in metres.
        scale: metres per unit of the chart.

    Raises:
        MeshError: no chart, a corner or an area missing, a total area further than `AREA_FACTOR` from that of
            the mesh, or pieces so distorted that they are no pattern.
    """
    instead = "rest=mesh takes the mesh itself as rest shape"
    if surface.uv is None:
        raise MeshError(f"has no UV: {instead}")
    bad = np.flatnonzero(~np.isfinite(surface.uv).all(axis=(1, 2)))
    if bad.size:
        raise MeshError(f"triangle {bad[0]} has a corner without UV: complete the chart, or {instead}")
    if not (np.isfinite(scale) and scale > 0):
        raise MeshError(f"uv_scale={scale}: give metres per unit of the chart, above 0")
    chart = scale * surface.uv
    corners = surface.positions[surface.faces]
    flat, mesh = corner_areas(chart), corner_areas(corners)
    ratio = flat.sum() / mesh.sum()
    if not 1 / AREA_FACTOR <= ratio <= AREA_FACTOR:
        equal = f"uv_scale={scale / np.sqrt(ratio):.4g} makes them equal, " if ratio > 0 else ""
        raise MeshError(
            f"its UV chart measures {flat.sum():.4g} m^2 and the mesh {mesh.sum():.4g} m^2: give metres per "
            f"unit of the chart, {equal}or {instead}"
        )
    small = np.flatnonzero(~(flat > 1e-12 * flat.max()))
    if small.size:
        raise MeshError(f"triangle {small[0]} has no area in the UV chart: mend the chart, or {instead}")
    stretch = stretches(corners, chart)
    off = (stretch[:, 0] > LARGEST_STRETCH) | (stretch[:, 1] < 1 / LARGEST_STRETCH)
    share = flat[off].sum() / flat.sum()
    if share > STRETCHED_SHARE:
        raise MeshError(
            f"{share:.0%} of its UV chart is stretched or pressed by more than {LARGEST_STRETCH:g} on the "
            f"mesh: that is a texture and no pattern; {instead}"
        )
    return chart


def stretches(corners: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return the principal stretches (F, 2), the larger first, from a chart to a mesh.

    They are the singular values of F = [x1 - x0, x2 - x0] Dm^-1.

    Args:
        corners: (F, 3, 3) of the mesh.
        chart: (F, 3, 2), no triangle without area.
    """
    Dm = np.stack([chart[:, 1] - chart[:, 0], chart[:, 2] - chart[:, 0]], axis=-1)
    Ds = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    return np.linalg.svd(Ds @ np.linalg.inv(Dm), compute_uv=False)
