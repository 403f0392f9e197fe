"""Shape functions of handles on a garment: where the handles sit, and how each moves every vertex.

    u_v = sum_b w_b(v) A_b [(r_v - c_b) / h; 1],      A_b: (3, 4), the numbers of handle b

u is an offset of the unposed garment r, as SNUG's, so that it is skinned. The centres c are farthest points
of the garment, each the vertex that lies farthest from those before it. The weights are compact,
w_b ~ (1 - d_b/R)^4 (4 d_b/R + 1) for distances d_b < R (Wendland 1995), and sum to one in each vertex, so
that equal transforms of all handles move the garment affinely. h is the covering radius, the largest distance
of a vertex from its nearest centre; R = REACH h. Distances are straight: those along edges leave more of the
energy above the minimum (docs/notebook/training.md).
"""

from __future__ import annotations

import numpy as np

from snug.garments.garment import Garment

REACH = 2.5  # covering radii


class HandleError(ValueError):
    """A number of handles that a garment cannot have; the message names both."""


def shape_functions(garment: Garment, handles: int) -> np.ndarray:
    """Return the four functions of each handle at the vertices, (V, handles, 4) float64; zero at pins.

    The first three are w_b (r - c_b) / h, the last is w_b [1].

    Raises:
        HandleError: no handle, or as many as the garment has vertices.
    """
    rest = np.asarray(garment.rest_positions, dtype=np.float64)
    if not 1 <= handles < len(rest):
        raise HandleError(f"{handles} handles: a garment of {len(rest)} vertices has 1 to {len(rest) - 1}")
    centres = farthest_points(rest, handles)
    away = rest[:, None] - rest[centres]
    distances = np.linalg.norm(away, axis=2)
    radius = float(distances.min(axis=1).max())
    weights = compact_weights(distances, REACH * radius)
    affine = np.concatenate([away / radius, np.ones((*weights.shape, 1))], axis=2)
    functions = weights[..., None] * affine
    functions[np.asarray(garment.pins, dtype=np.int64)] = 0.0
    return functions


def farthest_points(rest: np.ndarray, count: int) -> np.ndarray:
    """Return `count` of the vertices rest (V, 3), (count,): the first is farthest from the mean of all.

    More points keep the first ones.

    >>> farthest_points(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 0, 0]]), 3).tolist()
    [3, 0, 2]
    """
    points = [int(np.argmax(np.linalg.norm(rest - rest.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(rest - rest[points[0]], axis=1)
    while len(points) < count:
        points.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(rest - rest[points[-1]], axis=1))
    return np.array(points)


def compact_weights(distances: np.ndarray, reach: float) -> np.ndarray:
    """Return the weights (V, B) of centres at distances (V, B) [m], of sum one; zero from `reach` [m] on."""
    share = np.minimum(distances / reach, 1.0)
    weights = (1.0 - share) ** 4 * (4.0 * share + 1.0)
    return weights / weights.sum(axis=1, keepdims=True)


def span(functions: np.ndarray) -> np.ndarray:
    """Return a basis (3 V, 12 B) of the offsets that shape functions (V, B, 4) express.

    Its columns belong to numbers in the order (3, B, 4): each function along x, then along y, then along z.
    """
    flat = functions.reshape(len(functions), -1)
    return np.einsum("vk,ij->vijk", flat, np.eye(3, dtype=flat.dtype)).reshape(3 * len(flat), -1)
