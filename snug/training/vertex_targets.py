"""Losses against simulated vertices: squared distances of posed ones, or L1 of unposed offsets in two bands.

    vertices: mean over vertices of |x - x_simulated|^2                              [cm^2] (VertexTargets)
    low, high: mean over vertices of |offset - simulated offset|_1 in each band      [cm]   (BandTargets)

The first trains the supervised baseline, SNUG's own network, and Santesteban 2019; the second TailorNet.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
import torch
from torch import Tensor

from reference_sim.geometry.topology import edge_uses
from snug.body.skinning import skin, unskin
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import GarmentNetwork
from snug.networks.tailornet import FrequencyMixture

if TYPE_CHECKING:
    from snug.training.training_set import Batch, TrainingSet

Trajectories = Mapping[str, np.ndarray]  # motion name -> simulated world vertices (T, V, 3) [m]

CM2_PER_M2 = 1e4
CM_PER_M = float(np.sqrt(CM2_PER_M2))
SMOOTHING_SHARE = 0.15  # of the way to the neighbours' mean, in one sweep
SMOOTHING_SWEEPS = 80  # at 1000 vertices


class TargetError(ValueError):
    """Simulated vertices that do not fit the motions: the message names the motion and what differs."""


def vertex_loss(x: Tensor, target: Tensor) -> Tensor:
    """Return the mean squared distance (N, T) [cm^2] of vertices (N, T, V, 3) [m] from their targets."""
    return CM2_PER_M2 * (x - target).square().sum(-1).mean(-1)


def band_loss(predicted: Tensor, target: Tensor) -> Tensor:
    """Return the mean L1 distance (N, T) [cm] of one band, (N, T, V, 3) [m], from its target."""
    return CM_PER_M * (predicted - target).abs().sum(-1).mean(-1)


class VertexTargets:
    """Simulated vertices (F, V, 3) [m] relative to the pelvis, all training frames in a row, on a device.

    Args:
        data: the training set, of the same motions.
        motions: whose frames stand in a row.
        trajectories: motion name -> simulated world vertices (T, V, 3) [m].
        weights: skinning weights (V, J) of the prediction, on the device of the set.

    Raises:
        TargetError: for a motion without a fitting trajectory.
    """

    def __init__(
        self, data: TrainingSet, motions: Sequence[Motion], trajectories: Trajectories | None, weights: Tensor
    ) -> None:
        self.weights = weights
        self.vertices = relative_vertices(data.dressed, motions, trajectories).to(data.device)

    def terms(
        self,
        network: GarmentNetwork,
        batch: Batch,
        state: Tensor | None,
        posed_by: Callable[..., Tensor] = skin,
    ) -> dict[str, Tensor]:
        """Return parts of the loss of each window and frame, name -> (N, T). posed_by: skin, or its equal."""
        offsets, _ = network(batch.features, state)
        x = posed_by(offsets + batch.rest, self.weights, batch.transforms)
        return {"vertices": vertex_loss(x, self.vertices[torch.as_tensor(batch.frames)])}


class BandTargets(VertexTargets):
    """Simulated vertices, unposed and taken apart into two bands; arguments as for VertexTargets."""

    def __init__(
        self, data: TrainingSet, motions: Sequence[Motion], trajectories: Trajectories | None, weights: Tensor
    ) -> None:
        super().__init__(data, motions, trajectories, weights)
        vertices, transforms = self.vertices.cpu(), data.transforms.cpu()
        offsets = unskin(vertices, weights.cpu(), transforms) - data.dressed.rest()
        low = smooth_offsets(offsets.numpy(), np.asarray(data.dressed.garment.faces))
        self.low = torch.as_tensor(low, dtype=torch.float32).to(data.device)
        self.high = offsets.to(data.device) - self.low

    def terms(
        self,
        network: GarmentNetwork,
        batch: Batch,
        state: Tensor | None,
        posed_by: Callable[..., Tensor] = skin,
    ) -> dict[str, Tensor]:
        """Return the loss of both bands of the unposed offsets, name -> (N, T)."""
        rows = torch.as_tensor(batch.frames)
        low, high = cast(FrequencyMixture, network).bands(batch.features, state)
        return {"low": band_loss(low, self.low[rows]), "high": band_loss(high, self.high[rows])}


TARGETS = {"vertices": VertexTargets, "bands": BandTargets}  # by snug.kinds.Kind.targets


def smooth_offsets(offsets: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the low band of offsets (T, V, 3) [m]: diffused by sweeps with the uniform Laplacian.

    A vertex of an opening moves towards its neighbours along the opening alone, so that openings do not
    shrink. Sweeps in proportion to the vertices reach the same length on any mesh. The rest shape, which no
    band holds, is not smoothed.
    """
    from scipy.sparse import coo_array, diags_array  # a network of another kind trains without scipy

    count = offsets.shape[1]
    edges, uses = edge_uses(faces)
    on_rim = np.zeros(count, dtype=bool)
    on_rim[edges[uses == 1]] = True
    pairs = np.concatenate([edges, edges[:, ::-1]])
    rim = np.concatenate([uses == 1] * 2)
    pairs = pairs[rim | ~on_rim[pairs[:, 0]]]
    near = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()
    mean = diags_array(1.0 / near.sum(axis=1)) @ near
    flat = np.ascontiguousarray(offsets.transpose(1, 0, 2)).reshape(count, -1)
    for _ in range(max(1, round(SMOOTHING_SWEEPS * count / 1000))):
        flat = (1 - SMOOTHING_SHARE) * flat + SMOOTHING_SHARE * (mean @ flat)
    return flat.reshape(count, len(offsets), 3).transpose(1, 0, 2)


def relative_vertices(
    dressed: DressedBody, motions: Sequence[Motion], trajectories: Trajectories | None
) -> Tensor:
    """Return the simulated vertices of all frames of all motions, (F, V, 3) [m], relative to the pelvis.

    Raises:
        TargetError: for a missing or unfit trajectory, or a number that is not finite.
    """
    if not trajectories:
        raise TargetError("supervised training needs trajectories: a simulation of each training motion")
    relative = []
    for motion in motions:
        if motion.name not in trajectories:
            raise TargetError(
                f"no simulated trajectory for motion {motion.name!r}: simulate it, or leave it out"
            )
        positions = np.asarray(trajectories[motion.name])
        expected = (motion.frames, dressed.vertices, 3)
        if positions.shape != expected:
            raise TargetError(
                f"trajectory of motion {motion.name!r} has shape {positions.shape}, expected {expected}"
            )
        if not (finite := np.isfinite(positions).all(axis=(1, 2))).all():
            frame = int(np.argmin(finite))
            raise TargetError(f"trajectory of motion {motion.name!r} is not finite at frame {frame}")
        relative.append(torch.as_tensor(positions - dressed.pelvis(motion)[:, None]).float())
    return torch.cat(relative)
