"""Distances between surfaces and into the body, from positions alone. No physics here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from reference_sim import Obstacle

Floats = NDArray[np.float64]


def whole_frames(positions: Floats) -> Floats:
    """The frames (T',V,3) of positions (T,V,3) before the first that is not finite."""
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=(1, 2)))
    return positions[: bad[0]] if len(bad) else positions


def distance_rms(positions: Floats, reference: Floats) -> Floats:
    """(T,) root mean square distance [m] between the same vertices of (T,V,3) and (T,V,3) [m].

    Two accurate solvers of one wrinkling step differ by centimetres, since it has several minima: read
    this beside the spread between two references, never alone.
    """
    return np.sqrt(((positions - reference) ** 2).sum(2).mean(1))


@dataclass(frozen=True)
class Penetration:
    """Per frame, over all vertices with none left out: share below the skin and depth (0 outside) [m]."""

    share: Floats  # (T,)
    depth: Floats  # (T,V)


def penetration(trajectories: Sequence[Floats], obstacle: Obstacle) -> list[Penetration]:
    """How deep the vertices of each trajectory (T,V,3) [m] lie in the obstacle, by its true signed distance.

    All trajectories are asked about together at each frame: the obstacle's search tree is made once.
    """
    depths = [np.empty(positions.shape[:2]) for positions in trajectories]
    for frame in range(max(map(len, trajectories), default=0)):
        present = [k for k, positions in enumerate(trajectories) if frame < len(positions)]
        points = np.concatenate([trajectories[k][frame] for k in present])
        inside = np.maximum(0.0, -np.asarray(obstacle.signed_distance(points, frame)))
        ends = np.cumsum([trajectories[k].shape[1] for k in present])
        for k, part in zip(present, np.split(inside, ends[:-1])):
            depths[k][frame] = part
    return [Penetration(share=(depth > 0.0).mean(1), depth=depth) for depth in depths]


def own_part_depth(positions: Floats, obstacle: Obstacle, rest_positions: Floats) -> Floats:
    """(T,V) depth [m] of positions (T,V,3) under the part of the body that each vertex belongs to.

    The true signed distance also counts cloth in the fold of a hip or between arm and chest, which no eye
    sees; this one measures against the faces near a vertex's own rest position (V,3) alone.
    """
    depth = np.empty(positions.shape[:2])
    for frame, x in enumerate(positions):
        planes = obstacle.planes(np.ascontiguousarray(x), frame, rest_positions)
        gap = np.einsum("vi,vi->v", planes.normals, x - planes.points)
        depth[frame] = np.maximum(0.0, -gap)
    return depth


def hem_drift(positions: Floats, hem: NDArray[np.int64], origin_heights: Floats) -> float:
    """How far the hem's mean height above the pelvis has risen from the first frame to the last [m].

    positions (T,V,3) [m], hem: vertex indices, origin_heights (T,) [m]. A shirt that crept up stays up.
    """
    heights = positions[:, hem, 1].mean(1) - origin_heights[: len(positions)]
    return float(heights[-1] - heights[0])
