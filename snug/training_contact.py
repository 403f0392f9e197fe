"""Contact planes of batches of a training set, from anchors that are renewed as the network learns."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.energies import ContactPenalty
from snug.contact import Anchors, Patch
from snug.loss import Planes
from snug.parallel import ALONE, Group
from snug.skinning import skin
from snug.tensor_anchors import TensorAnchors
from snug.training_set import Batch, TrainingSet

# rows (N T,) into the positions and normals (R, P, 3) that follow: the body's patch in the frames of a batch.
Posed = tuple[np.ndarray, Any, Any]


class TrainingContact:
    """Anchors of all training frames. With `kernels` in numpy and numba, else in torch on the set's device.

    refresh: see Recipe.contact_refresh. one_shape: all on the mean body; the kernels then pose it once for
    all frames. A group shares the searching, and every process of it keeps all anchors.
    """

    def __init__(
        self,
        data: TrainingSet,
        contact: ContactPenalty,
        *,
        refresh: float,
        one_shape: bool,
        kernels: bool = True,
        group: Group = ALONE,
    ) -> None:
        body, device = data.dressed.body, data.device
        self.data, self.contact, self.refresh = data, contact, refresh
        self.kernels, self.group = kernels, group
        self.patch = Patch.around(contact.rest_samples, body.shaped(), body.faces)
        frames = data.frames
        self.anchors: Anchors | TensorAnchors
        self.anchors = Anchors(self.patch, frames) if kernels else TensorAnchors(self.patch, frames, device)
        vertices = self.patch.body_vertices
        self.weights, self.template, self.directions = (
            torch.as_tensor(array[vertices], dtype=torch.float32, device=device)
            for array in (body.skinning_weights, body.template, body.shape_directions)
        )
        self.stencils = torch.as_tensor(contact.stencils, device=device)
        self.sample_weights = torch.as_tensor(contact.weights, dtype=torch.float32, device=device)
        self._mean_shape: tuple[np.ndarray, np.ndarray] | None = None
        if one_shape and kernels:
            self._mean_shape = self._posed_everywhere()
        self._searched = np.zeros(frames, bool)
        self._credit = 0.0

    def _posed_everywhere(self) -> tuple[np.ndarray, np.ndarray]:
        """Patch positions and normals (F, P, 3) of every frame: one body shape, computed once."""
        corners = torch.cat([self.template, torch.ones(len(self.template), 1)], 1)  # (P, 4)
        # sum_j w_pj T_j (p, 1) as one matrix product over (j, 4): several times faster than blending first.
        spread = (self.weights[:, :, None] * corners[:, None]).flatten(1)  # (P, 96)
        positions = np.empty((self.data.frames, *self.template.shape), np.float32)
        for frame, transform in enumerate(self.data.transforms):
            positions[frame] = (spread @ transform.transpose(-1, -2).flatten(0, 1)).numpy()
        return positions, self.patch.normals(positions)

    def posed(self, batch: Batch) -> Posed:
        """The body where the frames of a batch have it."""
        if self._mean_shape is not None:
            return batch.frames.ravel(), *self._mean_shape
        rest = self.template
        if batch.betas is not None:
            rest = (rest + torch.einsum("vis,ns->nvi", self.directions, batch.betas))[:, None]
        positions = skin(rest, self.weights, batch.transforms).flatten(0, 1)
        rows = np.arange(len(positions))
        if isinstance(self.anchors, TensorAnchors):
            return rows, positions, self.anchors.normals(positions)
        return rows, positions.numpy(), self.patch.normals(positions.numpy())

    def planes(self, batch: Batch, posed: Posed) -> Planes:
        """What the loss takes: of the remembered anchors, points and normals (N, T, S, 3), or, with kernels,
        the energy itself.
        """
        flat = batch.frames.ravel()
        if isinstance(self.anchors, Anchors):
            anchors = self.anchors
            return lambda x: anchors.energy(self.contact, x, flat, *posed)
        points, normals = self.anchors.planes(flat, *posed)
        shape = (*batch.frames.shape, *points.shape[1:])
        return points.reshape(shape), normals.reshape(shape)

    def renew(self, frames: np.ndarray, posed: Posed, x: Tensor) -> None:
        """Search the longest-kept anchors of a batch anew.

        frames (N, T): of the whole batch. posed and the predicted vertices x (n, T, V, 3): of the windows
        that this process works on.
        """
        self._credit += self.refresh * frames.size
        count = int(self._credit)
        self._credit -= count
        self.search(self.anchors.oldest(frames.ravel(), count), frames, posed, x)

    def search(
        self, places: np.ndarray, frames: np.ndarray, posed: Posed, x: Tensor, *, forget: bool = False
    ) -> None:
        """Search the anchors of some places (n,) among the frames (N T,) of a batch; else as `renew`.

        forget: see Anchors.renew.
        """
        flat, (rows, positions, _) = frames.ravel(), posed
        vertices = x.detach().flatten(0, 1)
        share = len(vertices)
        for place in places:
            owner, mine = divmod(int(place), share)
            if owner == self.group.rank:
                samples = self._samples(vertices[mine])
                self.anchors.renew(int(flat[place]), samples, positions[rows[mine]], forget=forget)
            self._send(int(flat[place]), owner)

    def _samples(self, vertices: Tensor) -> Any:
        if self.kernels:
            return (self.contact.sample_matrix @ vertices.numpy()).astype(np.float32)
        return (vertices[self.stencils] * self.sample_weights[..., None]).sum(-2)

    def _send(self, frame: int, owner: int) -> None:
        self._searched[frame], self.anchors.age[frame] = True, 0
        for table in (self.anchors.faces, self.anchors.barycentric):
            self.group.sent(torch.as_tensor(table[frame]), owner)  # shares memory with the row

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """What a resumed run needs: anchors that were ever searched, ages of all, a search not yet due."""
        searched = torch.as_tensor(np.flatnonzero(self._searched))
        faces, barycentric = (torch.as_tensor(t) for t in (self.anchors.faces, self.anchors.barycentric))
        there = searched.to(faces.device)
        return {
            "searched": searched, "faces": faces[there], "barycentric": barycentric[there],
            "age": torch.as_tensor(self.anchors.age.copy()),
        }, {"credit": self._credit}  # fmt: skip

    def resume(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        """The inverse of `state`."""
        searched = tensors["searched"].numpy()
        self._searched[searched] = True
        for table, name in ((self.anchors.faces, "faces"), (self.anchors.barycentric, "barycentric")):
            held = torch.as_tensor(table)  # shares memory
            held[torch.as_tensor(searched, device=held.device)] = tensors[name].to(held.device)
        self.anchors.age[:] = tensors["age"].numpy()
        self._credit = facts["credit"]
