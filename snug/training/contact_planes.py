"""Contact planes of batches of a training set: from cached anchors, or at the nearest body vertices.

Anchors are queried anew as the network learns: the middle frames of a few windows in a step are searched,
for skin that no walk would reach. Their anchors are propagated to the frames around them that show almost
the same pose: farther off the thigh is elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.energies import ContactPenalty
from snug.body.skinning import add_pose_correctives, skin
from snug.kernels.skinning import FastSkin
from snug.training.contact_cache import ContactCache, Patch
from snug.training.contact_cache_torch import (
    Anchors,
    TensorContactCache,
    first_places,
    incident,
    normal_sums,
)
from snug.training.device import compile_for
from snug.training.physics_loss import Planes
from snug.training.training_set import Batch, TrainingSet

# Patches in the frames of a batch: rows (N T,) into positions and normals (R, P, 3), arrays or tensors.
Posed = tuple[np.ndarray, Any, Any]
POSED_TOGETHER = 64  # frames whose bodies are posed by one call
MARKED = 25  # every so many vertices of the patch there is a mark


class BodyPatches:
    """The patch of a body, its `vertices` (P,), in every frame of a training set.

    normals: vertex normals (N, P, 3) of positions (N, P, 3). kernels: pose arrays, else tensors by torch on
    the set's device. fixed: whether each frame has one body for good; kernels pose it once.
    """

    def __init__(
        self, data: TrainingSet, vertices: np.ndarray, normals: Callable[[Any], Any], *,
        kernels: bool, fixed: bool,
    ) -> None:  # fmt: skip
        body, device = data.dressed.body, data.device
        self.data, self.kernels, self.normals = data, kernels, normals

        def part(array: np.ndarray) -> Tensor:
            return torch.as_tensor(array[vertices], dtype=torch.float32, device=device)

        self.weights, self.template = part(body.skinning_weights), part(body.template)
        self.directions, correctives = part(body.shape_directions), body.pose_directions
        self.correctives = None if correctives is None else part(correctives)
        self._pose = compile_for(self._pose_by_torch, device)
        self.kept = self._pose_everywhere() if fixed and self.kernels else None

    def pose(self, batch: Batch) -> Posed:
        """Return the body in the poses of a batch."""
        if self.kept is not None:
            return batch.frames.ravel(), *self.kept
        rows = np.arange(batch.transforms.shape[0] * batch.transforms.shape[1])
        if not self.kernels:
            return rows, *self._pose(self._shape_patches(batch), batch.transforms)
        # the first frames of all windows, then the second ones
        by_time = rows.reshape(batch.transforms.shape[1::-1]).T.ravel()
        return by_time, *self._pose_by_kernels(self._shape_patches(batch), batch.transforms)

    @cached_property
    def marks(self) -> np.ndarray:
        """Some vertices of the patch in every frame, (F, M, 3) [m], by which poses are compared."""
        weights = self.weights[::MARKED].cpu()
        return np.concatenate([
            skin(self._correct(rest.cpu(), part, MARKED), weights, part).numpy()
            for rest, frames in self._list_patches()
            for part in self.data.transforms[frames].cpu().split(POSED_TOGETHER)
        ])  # fmt: skip

    def _shape_patches(self, batch: Batch) -> Tensor:
        """Return the unposed patches of a batch, (P, 3) or one for each window (N, 1, P, 3)."""
        if batch.betas is None:
            return self.template
        # (P, 3, N), as FastSkin reads it
        moved = torch.tensordot(self.directions, batch.betas, ([2], [1]))
        return (self.template[..., None] + moved).permute(2, 0, 1)[:, None]

    def _correct(self, rest: Tensor, transforms: Tensor, every: int = 1) -> Tensor:
        """Return patch positions (..., P, 3), or every so many of them, with pose correctives."""
        rest = rest[..., ::every, :]
        if self.correctives is None:
            return rest
        parents, directions = self.data.dressed.parents, self.correctives[::every].to(rest.device)
        return add_pose_correctives(rest, directions, transforms, parents)

    def _pose_by_torch(self, rest: Tensor, transforms: Tensor) -> tuple[Tensor, Tensor]:
        """Pose rest (..., P, 3) by transforms (N, T, J, 3, 4); return positions and normals (N T, P, 3)."""
        positions = skin(self._correct(rest, transforms), self.weights, transforms).flatten(0, 1)
        return positions, self.normals(positions)

    def _pose_by_kernels(self, rest: Tensor, transforms: Tensor) -> tuple[np.ndarray, np.ndarray]:
        """Pose rest (P, 3) or (N, 1, P, 3) by (N, T, J, 3, 4); return positions, normals (T N, P, 3)."""
        points = self._correct(rest, transforms).expand(*transforms.shape[:2], -1, -1)
        posed = FastSkin.apply(points, self.weights, transforms)
        positions = posed.transpose(0, 1).flatten(0, 1).contiguous().numpy()
        return positions, self.normals(positions)

    def _pose_everywhere(self) -> tuple[np.ndarray, np.ndarray]:
        """Compute patch positions and normals (F, P, 3) of every frame."""
        shape = self.data.frames, *self.template.shape
        positions, normals = np.empty(shape, np.float32), np.empty(shape, np.int8)
        for rest, frames in self._list_patches():
            for start in range(frames.start, frames.stop, POSED_TOGETHER):
                chunk = slice(start, min(start + POSED_TOGETHER, frames.stop))
                transforms = self.data.transforms[None, chunk]
                positions[chunk], normals[chunk] = self._pose_by_kernels(rest, transforms)
        return positions, normals

    def _list_patches(self) -> Iterator[tuple[Tensor, slice]]:
        """Yield unposed patches (P, 3) and the frames of each: motion by motion, or one for all frames."""
        shapes, first = self.data.shapes, self.data.first
        if shapes is None:
            yield self.template, slice(0, self.data.frames)
            return
        for betas, start, stop in zip(shapes, first[:-1], first[1:]):
            moved = self.directions @ torch.as_tensor(betas).to(self.directions)
            yield self.template + moved, slice(int(start), int(stop))


class NearestVertices:
    """Tangent planes at the body vertices nearest to the garment's; nothing is kept between steps.

    As SNUG's authors have published it (github.com/isantesteban/snug, losses/physics.py, lines 138 to 148;
    layers.py, lines 38 to 56; normals in smpl.py): all vertices of the body, normals weighted by area. Planes
    hold still while the loss is differentiated.
    """

    def __init__(self, data: TrainingSet) -> None:
        body = data.dressed.body
        self.faces, self.around = (
            torch.as_tensor(array, device=data.device).long()
            for array in (body.faces, incident(body.faces))
        )
        vertices = np.arange(len(body.template))
        self.bodies = BodyPatches(data, vertices, self._normals, kernels=False, fixed=False)

    def planes(self, batch: Batch, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return points and normals (N, T, V, 3) of garments x (N, T, V, 3) in the poses of a batch [m]."""
        from scipy.spatial import cKDTree

        _, *posed = self.bodies.pose(batch)
        # What is no number, the loss says.
        garments = np.nan_to_num(x.detach().flatten(0, 1).cpu().numpy())
        nearest = [
            cKDTree(body, balanced_tree=False, compact_nodes=False).query(garment)[1]
            for body, garment in zip(posed[0].cpu().numpy(), garments)
        ]
        index = torch.as_tensor(np.stack(nearest), device=x.device)[..., None].expand(-1, -1, 3)
        points, normals = (of_body.gather(1, index).view_as(x) for of_body in posed)
        return points, normals

    def _normals(self, positions: Tensor) -> Tensor:
        return torch.nn.functional.normalize(normal_sums(positions, self.faces, self.around), dim=-1)


# Frames searched after a step, as a share of the batch's, at most one of each window.
REFRESH = 0.01
# Frames before and after a searched one that may take over its anchors; at the start.
REACH, FIRST_REACH = 3, 7
# m: how far a mark of the body may have moved from a frame to one that takes over its anchors; at the
# start.
NEAR, FIRST_NEAR = 0.03, 0.07


class TrainingContact:
    """Anchors of all training frames, and the steps since each frame's were last searched or propagated.

    fixed: see BodyPatches; kernels: in numpy and numba, else in torch on the set's device.
    """

    def __init__(self, data: TrainingSet, contact: ContactPenalty, *, fixed: bool, kernels: bool) -> None:
        body, device = data.dressed.body, data.device
        self.data, self.contact = data, contact
        self.kernels, self.age = kernels, np.zeros(data.frames, np.int64)
        self.patch = Patch(contact.rest_samples, body.rest_vertices(), body.faces)
        frames = data.frames
        self.cache = (
            ContactCache(self.patch, frames)
            if kernels
            else TensorContactCache(self.patch, frames, device)
        )
        vertices, normals = self.patch.body_vertices, self.cache.normals
        self.bodies = BodyPatches(data, vertices, normals, kernels=kernels, fixed=fixed)
        self.stencils = torch.as_tensor(contact.stencils, device=device)
        self.sample_weights = torch.as_tensor(contact.weights, dtype=torch.float32, device=device)
        self._changed = np.zeros(frames, bool)
        self._before: tuple[np.ndarray | Tensor, ...] | None = None
        self._credit = 0.0

    def planes(self, batch: Batch, posed: Posed, x: Tensor | None = None) -> Planes:
        """Return points and normals (N, T, S, 3) at the cached anchors, or, with kernels, the energy itself.

        x (N, T, V, 3): vertices that the anchors first walk to, until `settle` decides whether for good;
        None where they have just been searched.
        """
        walk = x is not None
        if walk:
            numbers = np.unique(batch.frames)
            self._before = self.age.copy(), numbers, *(table[numbers] for table in self._tables())
        if isinstance(self.cache, ContactCache):
            cache, (of_body, *body) = self.cache, posed
            rows = of_body.reshape(batch.frames.shape)
            inputs = batch.frames, rows, *body
            return lambda lanes, into: cache.energy(self.contact, lanes, into, *inputs, walk=walk)
        flat = batch.frames.ravel()
        frames = torch.as_tensor(flat, device=self.data.device)
        if x is not None:
            first = torch.as_tensor(first_places(flat), device=self.data.device)
            self.cache.place(frames, self.walk(frames, first, posed, x))
        points, normals = self.cache.planes_at(*self.cache.anchors(frames), *posed[1:])
        return points.unflatten(0, batch.frames.shape), normals.unflatten(0, batch.frames.shape)

    def walk(self, frames: Tensor, first: Tensor, posed: Posed, x: Tensor) -> Anchors:
        """Return where the anchors of frames (N T,) walk to vertices x (N, T, V, 3); keep and await nothing.

        first (N T,): see snug.training.contact_cache_torch.first_places.
        """
        assert isinstance(self.cache, TensorContactCache)
        samples = self._samples(x.detach().flatten(0, 1))
        return self.cache.walk(samples, frames, first, *posed[1:], reach=self.contact.margin)

    def search_first(self, weights: Tensor) -> None:
        """Search where the skinned template touches, in enough frames to propagate to all others.

        It comes before training: a thigh found only later meets, with joules, a network that has settled.
        """
        data, frame, start = self.data, 0, 0
        while start < data.frames:
            source, frame = frame, self._slice_around(start, FIRST_REACH, FIRST_NEAR).stop - 1
            batch = data.at(np.array([[frame]]))
            x = skin(batch.rest, weights, batch.transforms)
            rows, positions, _ = self.bodies.pose(batch)
            self.cache.faces[frame] = self.cache.faces[source]  # a good place to begin
            self.cache.requery(frame, self._samples(x[0, 0]), positions[rows[0]])
            end = self._slice_around(frame, FIRST_REACH, FIRST_NEAR).stop
            self._propagate(frame, np.arange(start, end))
            start = end
        self._changed[:] = False  # a resumed run makes these anchors again

    def requery(self, frames: np.ndarray, posed: Posed, x: Tensor) -> None:
        """Search some windows (N, T) with vertices (N, T, V, 3) anew, those searched longest ago."""
        self._credit += REFRESH * frames.size
        count = int(self._credit)
        self._credit -= count
        window = frames.shape[1]
        middle = frames[:, window // 2]
        self.age[middle] += 1
        oldest = np.argsort(-self.age[middle], kind="stable")[:count]
        self.search(oldest * window + window // 2, frames, posed, x)
        searched = np.unique(middle[oldest])
        for frame in searched:
            around = self._slice_around(int(frame), REACH, NEAR)
            self._propagate(int(frame), np.setdiff1d(np.arange(around.start, around.stop), searched))

    def _slice_around(self, frame: int, reach: int, shift: float) -> slice:
        """Return the frames around one, of the same motion and at most `reach` off.

        They end where a mark has moved by `shift` [m].
        """
        first = self.data.first
        motion = int(self.data.motion_of(frame))
        start = max(frame - reach, int(first[motion]))
        stop = min(frame + reach + 1, int(first[motion + 1]))
        marks = self.bodies.marks
        moved = np.linalg.norm(marks[start:stop] - marks[frame], axis=2).max(axis=1)
        ends = (start + np.flatnonzero(moved > shift)).tolist()
        starts, stops = (f + 1 for f in ends if f < frame), (f for f in ends if f > frame)
        return slice(max([start, *starts]), min([stop, *stops]))

    def _propagate(self, frame: int, others: np.ndarray) -> None:
        """Copy the anchors of a frame to others (n,), as if they had been searched."""
        for table in self._tables():
            table[others] = table[[frame]]  # a copy: torch writes no tensor onto itself
        self.age[others], self._changed[others] = 0, True

    def settle(self, frames: np.ndarray, *, trusted: bool) -> None:
        """Keep the anchors' places since `planes` if the prediction is trusted, else put them back."""
        if self._before and not trusted:
            age, rows, *before = self._before
            self.age[:] = age
            for table, values in zip(self._tables(), before):
                table[rows] = values
        self._before = None
        self._changed[frames.ravel()] = True

    def search(
        self, places: np.ndarray, frames: np.ndarray, posed: Posed, x: Tensor, *, exact: bool = False
    ) -> None:
        """Search the anchors of some places (n,) among the frames (N, T); exact: see ContactCache.requery."""
        flat, (rows, positions, _) = frames.ravel(), posed
        vertices, window = x.detach(), frames.shape[1]
        for place in places.tolist():
            samples = self._samples(vertices[divmod(place, window)])
            self.cache.requery(int(flat[place]), samples, positions[rows[place]], exact=exact)
            self.age[flat[place]] = 0

    def _samples(self, vertices: Tensor) -> Any:  # as the cache's, an array or a tensor
        """Return contact samples (S, 3) of vertices (V, 3); of tensors also (..., S, 3) of (..., V, 3)."""
        if self.kernels:
            return (self.contact.sample_matrix @ vertices.numpy()).astype(np.float32)
        return (vertices[..., self.stencils, :] * self.sample_weights[..., None]).sum(-2)

    def _tables(self) -> tuple[Any, Any]:  # arrays or tensors, written to in place
        """Return faces (F, S) and barycentric coordinates (F, S, 2) of all anchors."""
        return self.cache.faces, self.cache.barycentric

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return the state for a checkpoint: changed anchors, ages of all, a search not yet due."""
        changed = torch.as_tensor(np.flatnonzero(self._changed))
        faces, barycentric = (torch.as_tensor(table) for table in self._tables())
        rows = changed.to(faces.device)
        return {
            "changed": changed, "faces": faces[rows], "barycentric": barycentric[rows],
            "age": torch.as_tensor(self.age.copy()),
        }, {"credit": self._credit}  # fmt: skip

    def resume(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        """Continue from a `state`."""
        changed = tensors["changed"].numpy()
        self._changed[changed] = True
        for table, name in zip(self._tables(), ("faces", "barycentric")):
            view = torch.as_tensor(table)  # shares memory
            view[torch.as_tensor(changed, device=view.device)] = tensors[name].to(view.device)
        self.age[:] = tensors["age"].numpy()
        self._credit = facts["credit"]
