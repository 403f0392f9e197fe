"""Moving closed triangle mesh that cloth may touch: contact planes for a step, and true distances.

The solver knows a body as nothing more than this.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reference_sim.cloth import MeshError
from reference_sim.geometry.closest_point import Closest, FaceSearch, Listed
from reference_sim.geometry.surface import (
    carry,
    faces_around,
    plane_normals,
    winding_numbers,
)
from reference_sim.geometry.topology import check_closed

DEFAULT_REGION = 0.20  # [m]
BESIDE = 0.05  # [m] from the surface: what is pinned there rides on it


@dataclass(frozen=True)
class Planes:
    """Contact plane of each sample."""

    points: np.ndarray  # (S, 3) [m] on the obstacle
    normals: np.ndarray  # (S, 3) unit, outward
    faces: np.ndarray  # (S,) of the obstacle
    barycentric: np.ndarray  # (S, 3) places on them


def reachable_faces(rest_points: np.ndarray, centroids: np.ndarray, region: float) -> np.ndarray:
    """Return the faces that some sample may meet: those with a centroid no farther away than `region` [m].

    rest_points (S, 3) and centroids (F, 3) [m] are at rest. Where a sample has no such face, it is all
    faces.
    """
    from scipy.spatial import cKDTree

    if cKDTree(centroids).query(rest_points)[0].max() > region:
        return np.arange(len(centroids))
    distances = cKDTree(rest_points).query(centroids, distance_upper_bound=region)[0]
    return np.flatnonzero(np.isfinite(distances))


class Obstacle:
    """Closed mesh that moves through T frames.

    Args:
        positions: (T, B, 3) [m], or (B, 3) for one that stands still.
        faces: (F, 3) outward wound.
        rest_positions: (B, 3) [m], the obstacle in the pose in which the cloth was made. With it, a cloth
            sample only ever meets faces whose rest centroid lies within `region` [m] of the sample's own
            rest position (the whole mesh, where there is none).

    Raises MeshError for wrong shapes, NaN, a mesh that is no closed surface (see `check_closed`).

    Example: a tetrahedron that rises by a centimetre a frame.

        >>> import numpy as np
        >>> from reference_sim import Obstacle
        >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        >>> faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> rising = Obstacle(np.stack([corners, corners + [0.0, 0.01, 0.0]]), faces)
        >>> rising.frames
        2
        >>> rising.signed_distance(np.array([[0.1, -0.1, 0.1], [0.2, 0.1, 0.3]]), frame=1).round(3).tolist()
        [0.11, -0.09]
    """

    def __init__(
        self,
        positions: np.ndarray,
        faces: np.ndarray,
        *,
        rest_positions: np.ndarray | None = None,
        region: float = DEFAULT_REGION,
    ) -> None:
        positions = np.array(positions, dtype=np.float64)
        self.positions = positions[None] if positions.ndim == 2 else positions
        check_closed(self.positions, np.asarray(faces))
        self.faces = np.array(faces, dtype=np.int64, order="C")
        self.region = float(region)
        self.rest_centroids: np.ndarray | None = None
        if rest_positions is not None:
            rest = np.asarray(rest_positions, dtype=np.float64)
            if rest.shape != self.positions.shape[1:] or not np.isfinite(rest).all():
                raise MeshError(
                    f"obstacle rest_positions {rest.shape}: expected finite {self.positions.shape[1:]}"
                )
            self.rest_centroids = np.ascontiguousarray(rest[self.faces].mean(axis=1))
        self._substeps = 1
        self._forget()

    def _forget(self) -> None:
        self._search: FaceSearch | None = None
        self._fitted: int | None = None  # the frame that the search is fitted to
        # Of so many points, in regions or not: the faces found last, the lists to search, places at rest.
        self._last: dict[tuple[int, bool], tuple[np.ndarray, Listed, np.ndarray | None]] = {}

    @property
    def frames(self) -> int:
        """Number of frames, sub-steps included."""
        return (len(self.positions) - 1) * self._substeps + 1

    def at(self, frame: int) -> np.ndarray:
        """Return the vertices (B, 3) [m] at `frame` from 0 on; the last frame holds on for ever."""
        if frame < 0:
            raise ValueError(f"obstacle: frame {frame}: frames count from 0")
        index, part = divmod(min(frame, self.frames - 1), self._substeps)
        if part == 0:
            return self.positions[index]
        share = part / self._substeps
        return (1 - share) * self.positions[index] + share * self.positions[index + 1]

    def refine(self, substeps: int) -> Obstacle:
        """Return the same motion, linear in between, with `substeps` frames for each frame here."""
        fine = copy.copy(self)
        fine._substeps = self._substeps * substeps
        fine._forget()
        return fine

    @cached_property
    def _around(self) -> tuple[np.ndarray, np.ndarray]:
        return faces_around(self.faces, self.positions.shape[1])

    def _nearest(self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None) -> Closest:
        """Find closest points under the rule of regions.

        Each search begins with the faces that the last one answered for as many points, in groups made
        for the first one: the solver asks for the same samples in every frame.
        """
        frame = min(frame, self.frames - 1)
        if self._search is None:
            centroids = self.rest_centroids
            if centroids is None:
                centroids = self.at(0)[self.faces].mean(axis=1)
            self._search = FaceSearch(self.faces, centroids)
        if self._fitted != frame:
            self._search.refit(self.at(frame))
            self._fitted = frame
        if self.rest_centroids is None:
            rest_points = None
        kind = len(points), rest_points is not None
        hints, samples, home = self._last.get(kind, (None, None, None))
        if samples is None or not (home is rest_points or np.array_equal(home, rest_points)):  # type: ignore[arg-type]
            home = rest_points
            samples = (
                self._search.group(points) if home is None else self._search.group(home, self.region)
            )
        closest = self._search.nearest(points, hints=hints, samples=samples)
        self._last[kind] = closest.faces, samples, home
        return closest

    def planes(
        self,
        points: np.ndarray,
        frame: int,
        rest_points: np.ndarray | None = None,
        *,
        margin: float | None = None,
    ) -> Planes:
        """Return contact planes at `frame`.

        The plane goes through the closest allowed point of the surface; its normal points from there to
        the sample (from the sample, when that is inside), which makes n.(x - c) the signed distance at
        the sample's own position. Beyond the border of the allowed faces it fades: see
        `surface.plane_normals`. With `margin` [m] no plane farther than TANGENT_BALL touches a free
        sample: one outside the whole surface, and farther from it than the margin.

        points (S, 3) [m]: samples. rest_points (S, 3) [m]: the samples at rest, for the rule of regions.
        """
        closest = self._nearest(points, frame, rest_points)
        vertices = self.at(frame)
        normals = np.empty_like(closest.points)
        tilted = plane_normals(
            points, closest.points, closest.faces, closest.barycentric, vertices, self.faces,
            *self._around, normals,
        )  # fmt: skip
        if margin is not None and len(tilted):
            tilted_points = points[tilted]
            assert self._search is not None
            nearest = self._search.nearest(tilted_points, hints=closest.faces[tilted]).points
            free = np.linalg.norm(tilted_points - nearest, axis=1) > margin
            free[free] = winding_numbers(vertices, self.faces, tilted_points[free]) <= 0
            offsets = (tilted_points - closest.points[tilted])[free]
            normals[tilted[free]] = offsets / np.linalg.norm(offsets, axis=1)[:, None]
        return Planes(closest.points, normals, closest.faces, closest.barycentric)

    def transport(
        self, points: np.ndarray, frame: int, rest_points: np.ndarray | None = None
    ) -> np.ndarray:
        """Return points (N, 3) [m] of frame - 1 moved along with the body; at frame 0 nothing has moved.

        The best known initial guess for a garment.
        """
        return self.carrying(points, max(frame - 1, 0), rest_points)(frame)

    def carrying(
        self, points: np.ndarray, start: int = 0, rest_points: np.ndarray | None = None
    ) -> Callable[[int], np.ndarray]:
        """Return the function of the frame that moves points (N, 3) [m] of frame `start` along.

        Each stays beside its nearest face, as a pin that rides: `simulate(...,
        pin_positions=body.carrying(x[cloth.pins]))`. Points that are all farther away than DEFAULT_REGION
        stay where they are: carried on so long a lever, cloth would be torn.
        """
        closest = self._nearest(points, start, rest_points)
        before = self.at(start)
        if np.linalg.norm(points - closest.points, axis=1).min(initial=np.inf) > DEFAULT_REGION:
            return lambda frame: points.copy()

        def move(frame: int) -> np.ndarray:
            moved = np.empty_like(closest.points)
            carry(
                points, closest.points, closest.faces, closest.barycentric, before, self.at(frame),
                self.faces, moved,
            )  # fmt: skip
            return moved

        return move

    def moves_beside(self, points: np.ndarray) -> bool:
        """Return whether it moves, and most points (N, 3) [m] are within BESIDE of it in frame 0."""
        if not np.ptp(self.positions, axis=0).any() or len(points) == 0:
            return False
        gaps = np.linalg.norm(points - self._nearest(points, 0).points, axis=1)
        return bool(np.median(gaps) <= BESIDE)

    def signed_distance(self, points: np.ndarray, frame: int) -> np.ndarray:
        """Return the distance of points (N, 3) to the surface [m], negative where it winds around a point."""
        distance = np.linalg.norm(points - self._nearest(points, frame).points, axis=1)
        distance[winding_numbers(self.at(frame), self.faces, points) > 0] *= -1.0
        return distance
