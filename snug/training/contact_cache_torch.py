"""Contact anchors held and searched in torch on any device, as ContactCache does on a CPU.

Normals are rounded to the same 127 steps as there, so that both give the same planes. The search is by
brute force: of all allowed body vertices the nearest few, and of the faces around those the one that
comes closest.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from reference_sim.geometry.surface import faces_around
from snug.kernels.contact import CROSSINGS, WALK_SLACK
from snug.training.contact_cache import PARTS, ContactCache, Patch, quantise
from snug.training.device import CudaGraph, compile_for

Anchors = tuple[Tensor, Tensor]  # faces (N, S) and barycentric coordinates (N, S, 2)
NEAREST = 3  # body vertices whose faces are tried for each sample
CHUNK = 2048  # samples searched at once: a table of CHUNK x P distances
# m^2 added to the squared distance of a face out of the region: taken only for want of others.
FORBIDDEN = 1.0


class TensorContactCache:
    """One anchor per frame and sample on `device`."""

    def __init__(self, patch: Patch, frames: int, device: torch.device) -> None:
        start = ContactCache(patch, 1)
        self.patch = patch
        self.faces = torch.as_tensor(start.faces, device=device).repeat(frames, 1)
        self.barycentric = torch.as_tensor(start.barycentric, device=device).repeat(frames, 1, 1)
        self.corners = torch.as_tensor(patch.faces, device=device).long()  # (Q, 3)
        self.rest, self.centroids, self.sample_rest = (
            torch.as_tensor(array, device=device)
            for array in (patch.rest, patch.centroids, patch.sample_rest)
        )
        self.adjacency = torch.as_tensor(patch.adjacency, device=device).long()  # (Q, 3)
        around = incident(patch.faces)
        self.around = torch.as_tensor(around, device=device)  # (P, K) faces, -1 beyond the last
        self._walk, self.planes_at = compile_for(self._move, device), compile_for(self._planes, device)
        self._closest = CudaGraph(self._search_in_parts, device)

    def normals(self, positions: Tensor) -> Tensor:
        """Return area-weighted vertex normals (N, P, 3) of positions (N, P, 3), rounded to 1/127."""
        normals = normal_sums(positions, self.corners, self.around)
        return (
            127.0 * normals / (torch.linalg.vector_norm(normals, dim=-1, keepdim=True) + 1e-30)
        ).round()

    def anchors(self, frames: Tensor) -> Anchors:
        """Return the anchors of frames (N,)."""
        return self.faces[frames], self.barycentric[frames]

    def _planes(
        self, faces: Tensor, barycentric: Tensor, positions: Tensor, normals: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return points and unit normals (N, S, 3) of the planes at anchors (N, S) of bodies (N, P, 3)."""
        corners, row = self.corners[faces.long()], _rows(faces)  # (N, S, 3)
        last = barycentric / PARTS
        weights = torch.cat([1 - last.sum(-1, keepdim=True), last], -1)[..., None]
        points = (weights * positions[row, corners]).sum(-2)
        directions = (weights * normals[row, corners]).sum(-2)
        return points, directions / (torch.linalg.vector_norm(directions, dim=-1, keepdim=True) + 1e-30)

    def walk(
        self, samples: Tensor, frames: Tensor, first: Tensor, positions: Tensor, normals: Tensor, *,
        reach: float,
    ) -> Anchors:  # fmt: skip
        """Return the anchors of frames (N,), moved as snug.kernels.contact.walk_to_foot does.

        Those of samples (N, S, 3) less than `reach` and WALK_SLACK above their planes walk. A frame that
        comes twice walks once, as its first garment has it. first (N,): see `first_places`; positions,
        normals: bodies (N, P, 3).
        """
        faces, barycentric = self._walk(samples, *self.anchors(frames), positions, normals, reach)
        return faces[first], barycentric[first]

    def place(self, frames: Tensor, anchors: Anchors) -> None:
        """Keep anchors of frames (N,); those of a frame that comes twice must be equal."""
        self.faces[frames], self.barycentric[frames] = anchors

    def _move(
        self,
        x: Tensor,
        faces: Tensor,
        barycentric: Tensor,
        positions: Tensor,
        normals: Tensor,
        reach: float,
    ) -> Anchors:
        """Return where anchors (N, S) of samples x (N, S, 3) rest, on bodies (N, P, 3).

        All of them take every turn, for a GPU that counts those near the skin waits for the count.
        """
        points, directions = self._planes(faces, barycentric, positions, normals)
        walks = ((x - points) * directions).sum(-1) < reach + WALK_SLACK
        row, face = _rows(faces), faces.long()
        last, moving = face, walks
        for _ in range(CROSSINGS):
            a, b, c = positions[row, self.corners[face]].unbind(-2)
            v, w, _ = foot(b - a, c - a, x - a)
            weights = torch.stack([1 - v - w, v, w], -1)
            other = self.adjacency[face, weights.argmin(-1)]
            squared = (self.centroids[other] - self.sample_rest).square().sum(-1)
            outside = squared > self.patch.region**2
            moving = moving & (weights.amin(-1) < 0) & (other >= 0) & (other != last) & ~outside
            last, face = torch.where(moving, face, last), torch.where(moving, other, face)
        a, b, c = positions[row, self.corners[face]].unbind(-2)
        v, w = closest_on_triangle(b - a, c - a, x - a)
        face, parts = face.to(faces.dtype), quantise(torch.stack([v, w], -1)).to(torch.uint8)
        return torch.where(walks, face, faces), torch.where(walks[..., None], parts, barycentric)

    def requery(self, frame: int, points: Tensor, positions: Tensor, *, exact: bool = False) -> None:
        """Search one frame's anchors anew: points (S, 3), positions (P, 3) of that frame.

        Brute force has no use for old anchors, so that `exact` changes nothing.
        """
        self.faces[frame], self.barycentric[frame] = self._closest(points, positions)

    def _search_in_parts(self, points: Tensor, positions: Tensor) -> Anchors:
        """Return the closest anchors of samples (S, 3) on a body (P, 3), part by part."""
        parts = zip(points.split(CHUNK), self.sample_rest.split(CHUNK))
        searches = [self._search(point, home, positions) for point, home in parts]
        faces, barycentric = (torch.cat(pieces) for pieces in zip(*searches))
        return faces, quantise(barycentric)

    def _search(self, points: Tensor, home: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        distances = torch.cdist(points, positions)
        inside = torch.cdist(home, self.rest) < self.patch.region
        distances = torch.where(inside | ~inside.any(1, keepdim=True), distances, torch.inf)
        nearest = distances.topk(min(NEAREST, len(positions)), largest=False).indices
        faces = self.around[nearest].flatten(1)  # (S, NEAREST K)
        indices = faces.clamp(min=0)
        a, b, c = positions[self.corners[indices]].unbind(-2)
        s, t, r = b - a, c - a, points[:, None] - a
        v, w = closest_on_triangle(s, t, r)
        squared = (r - v[..., None] * s - w[..., None] * t).square().sum(-1)
        away = (self.centroids[indices] - home[:, None]).square().sum(-1)
        outside = away >= self.patch.region**2
        squared = torch.where(faces < 0, torch.inf, squared + FORBIDDEN * outside)
        best = squared.argmin(1, keepdim=True)
        pick = [table.gather(1, best)[:, 0] for table in (faces, v, w)]
        return pick[0], torch.stack(pick[1:], -1)


def first_places(frames: np.ndarray) -> np.ndarray:
    """Return the place where each of frames (N,) comes first.

    >>> first_places(np.array([7, 5, 7]))
    array([0, 1, 0])
    """
    _, first, places = np.unique(frames, return_index=True, return_inverse=True)
    return first[places]


def _rows(faces: Tensor) -> Tensor:
    """Return the numbers (N, 1, 1) of the bodies that anchors (N, S) lie on."""
    return torch.arange(len(faces), device=faces.device)[:, None, None]


def foot(s: Tensor, t: Tensor, r: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the weights v, w where a triangle's plane comes closest to a point, and a squared area [m^4].

    The area is that of the parallelogram; s, t, r as for `closest_on_triangle`.
    """
    aa, cc, m = (s * s).sum(-1), (t * t).sum(-1), (s * t).sum(-1)
    d, e = (s * r).sum(-1), (t * r).sum(-1)
    determinant = aa * cc - m * m
    return (cc * d - m * e) / determinant, (aa * e - m * d) / determinant, determinant


def closest_on_triangle(s: Tensor, t: Tensor, r: Tensor) -> tuple[Tensor, Tensor]:
    """Return the weights v, w of the second and third corner where a triangle comes closest to a point.

    s, t (..., 3): sides from the first corner; r (..., 3): from it to the point [m].
    """
    aa, cc, m = (s * s).sum(-1), (t * t).sum(-1), (s * t).sum(-1)
    d, e = (s * r).sum(-1), (t * r).sum(-1)
    v, w, determinant = foot(s, t, r)
    inside = (determinant > 0) & (v >= 0) & (w >= 0) & (v + w <= 1)
    # Where the foot is outside: the nearest of the three edges, each clamped to its ends.
    zero = torch.zeros_like(d)
    on_s, on_t = (d / aa).clamp(0, 1), (e / cc).clamp(0, 1)
    on_u = ((e - d + aa - m) / (aa + cc - 2 * m)).clamp(0, 1)
    edges_v, edges_w = torch.stack([on_s, zero, 1 - on_u]), torch.stack([zero, on_t, on_u])
    q = edges_v**2 * aa + edges_w**2 * cc + 2 * edges_v * edges_w * m - 2 * edges_v * d - 2 * edges_w * e
    best = q.argmin(0, keepdim=True)
    edge_v, edge_w = edges_v.gather(0, best)[0], edges_w.gather(0, best)[0]
    return torch.where(inside, v, edge_v), torch.where(inside, w, edge_w)


def normal_sums(positions: Tensor, corners: Tensor, around: Tensor) -> Tensor:
    """Return the sums of the normals, twice the area long, of the faces around each vertex, (N, P, 3) [m^2].

    positions: (N, P, 3) [m]. corners: (Q, 3) of the faces. around: (P, K) of `incident`.
    """
    a, b, c = (positions[:, corners[:, corner]] for corner in range(3))
    of_faces = torch.linalg.cross(b - a, c - a)
    # Gathered, not scattered: sums are then taken in one order on a GPU too.
    return (of_faces[:, around.clamp(min=0)] * (around >= 0)[..., None]).sum(-2)


def incident(faces: np.ndarray) -> np.ndarray:
    """Return the faces around each vertex, ascending: (Q, 3) -> (P, K) int64, rows filled up with -1."""
    starts, around = faces_around(faces, int(faces.max()) + 1)
    counts = np.diff(starts)
    table = np.full((len(counts), counts.max()), -1, np.int64)
    table[np.arange(counts.max()) < counts[:, None]] = around
    return table
