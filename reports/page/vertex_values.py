"""What the page colours a cloth by: one number per vertex and frame, most of them from positions alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse

if TYPE_CHECKING:
    from reference_sim import Obstacle

MM = 1e3


def mean_curvature(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Magnitude of the mean curvature (T,V) [1/m] of positions (T,V,3) [m]; 0 on boundaries.

    Half the cotangent Laplacian over the mixed Voronoi area, Meyer et al. 2003.
    """
    frames, count, _ = positions.shape
    corners = positions[:, faces]  # (T,F,3,3)
    facing = np.roll(corners, -1, axis=2) - np.roll(corners, -2, axis=2)  # the edge that faces a corner
    squared = (facing**2).sum(-1)
    doubled = np.linalg.norm(np.cross(facing[:, :, 0], facing[:, :, 1]), axis=-1)  # twice the area
    dots = 0.5 * squared.sum(-1, keepdims=True) - squared
    cotangents = dots / np.maximum(doubled, np.finfo(float).tiny)[..., None]
    weighted = squared * cotangents
    mixed = (weighted.sum(-1, keepdims=True) - weighted) / 8.0
    flat = np.where(dots < 0.0, 0.25, 0.125) * doubled[..., None]
    areas = np.where((dots < 0.0).any(-1, keepdims=True), flat, mixed)
    pulls = cotangents[..., None] * facing
    gather = _gather(faces, count)
    area = (gather @ areas.reshape(frames, -1).T).T
    before, after = np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)
    flows = _gather(before, count) - _gather(after, count)
    laplacian = np.stack([(flows @ pulls[..., k].reshape(frames, -1).T).T for k in range(3)], axis=-1)
    tiny = np.finfo(float).tiny
    norm = np.linalg.norm(laplacian, axis=-1)
    found = np.divide(norm, 4.0 * area, out=np.zeros((frames, count)), where=area > tiny)
    found[:, boundary(faces, count)] = 0.0
    return found


def area_change(positions: np.ndarray, faces: np.ndarray, rest_areas: np.ndarray) -> np.ndarray:
    """Area over rest area less 1 (T,V) [%], mean over a vertex's faces by rest area; those (F,) [m^2]."""
    corners = positions[:, faces]
    normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    areas = 0.5 * np.linalg.norm(normals, axis=-1)
    gather = _gather(faces, positions.shape[1])
    rest = gather @ np.repeat(rest_areas, 3)
    now = (gather @ np.repeat(areas, 3, axis=1).T).T
    return 100.0 * (np.divide(now, rest, out=np.ones_like(now), where=rest > 0.0) - 1.0)


def distance(positions: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(T,V) [mm] between the same vertices; positions (T,V,3) [m], the reference's as many frames or more."""
    return MM * np.linalg.norm(positions - reference[: len(positions)], axis=-1)


def depth(points: np.ndarray, skin: Obstacle, frame: int) -> np.ndarray:
    """How deep points (P,3) [m] lie under the skin at that frame (P,) [mm], 0 outside.

    Inside is what lies behind the normal of the nearest point: a winding number takes six times as long.
    """
    planes = skin.planes(np.ascontiguousarray(points, dtype=float), frame)
    return MM * np.maximum(-np.einsum("pi,pi->p", planes.normals, points - planes.points), 0.0)


def skin_of(positions: np.ndarray, faces: np.ndarray) -> Obstacle | None:
    """A body (T,B,3) [m], or (B,3), as a surface with an inside; None where its faces (F,3) do not close."""
    from reference_sim.cloth import MeshError
    from reference_sim.obstacle import Obstacle

    try:
        return Obstacle(positions, faces)
    except MeshError:
        return None


def boundary(faces: np.ndarray, count: int) -> np.ndarray:
    """(V,) True on vertices of edges with one triangle, and on those of none."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, uses = np.unique(edges, axis=0, return_counts=True)
    found = np.ones(count, dtype=bool)
    found[faces] = False
    found[unique[uses == 1]] = True
    return found


def _gather(corners: np.ndarray, count: int) -> scipy.sparse.csr_array:
    """(V, 3F): sums what stands at the corners of faces (F,3) over each vertex."""
    size = corners.size
    return scipy.sparse.csr_array((np.ones(size), (corners.ravel(), np.arange(size))), shape=(count, size))
