"""Learning from simulated motions: their file, and the losses with respect to them.

The file is HDF5: attribute `settings` says of what body and garment the simulations are (`settings_of`);
a group for each motion, called by its place, has attributes `name` and `fps`, and poses (T,24,3) [rad],
translations (T,3) [m] and vertices (T,V,3) [m] from the pelvis, float32.
`python -m benchmarks.export GARMENT/training-motions` writes such a file.

Two losses are distances from the simulated vertices:

    VertexTargets  vertices: mean over vertices of |x - x_simulated|^2                        [cm^2]
    BandTargets    low, high: mean over vertices of |offset - simulated offset|_1 in a band   [cm]

The first trains the supervised baselines, SNUG's own network, and Santesteban 2019; the second TailorNet.
Beside the first a recipe may have energies of the predicted vertices [J] (snug.training.physics_loss),
weighed by Recipe.physics_weight [cm^2/J].
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import h5py
import numpy as np
import torch
from torch import Tensor

from reference_sim.cloth import edge_table
from reference_sim.files.atomic_files import replacing
from snug.body.skinning import unskin
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.garment_network import GarmentNetwork
from snug.networks.tailornet import FrequencyMixture
from snug.training.training_set import Batch, TrainingError, TrainingSet

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment

Trajectories = Mapping[str, np.ndarray]  # motion name -> simulated world vertices (T, V, 3) [m]

DATA_SET_FORMAT = 2
# decimals of positions [m] that count: another processor may tailor the last bits otherwise
MICROMETRES = 6


class DataSetError(ValueError):
    """A file that holds no simulated motions, or not the ones that are wanted; the message names it."""


def read_data_set(path: Path, body: Body, garment: Garment) -> tuple[list[Motion], dict[str, np.ndarray]]:
    """Return the motions of a file, and their simulated world vertices (T, V, 3) [m] by name.

    Raises:
        DataSetError: no file of simulated motions, or simulations of another body or garment.
    """
    if not path.is_file():
        raise DataSetError(f"{path}: no such file; python -m benchmarks.export writes one")
    motions, trajectories = list[Motion](), dict[str, np.ndarray]()
    try:
        with h5py.File(path) as data:
            if (number := int(data.attrs["format"])) != DATA_SET_FORMAT:
                raise DataSetError(f"{path}: format {number}; this version reads {DATA_SET_FORMAT}")
            settings = dict(json.loads(data.attrs["settings"]))
            for name, value in settings_of(body, garment).items():
                if (stored := settings.get(name)) != value:
                    values = f": {stored} there, {value} here" if isinstance(value, str | int) else ""
                    raise DataSetError(f"{path}: simulations of another {name}{values}")
            for group in (data[str(place)] for place in range(len(data))):
                motion = Motion(
                    str(group.attrs["name"]), group["poses"][:], group["translations"][:],
                    float(group.attrs["fps"]), "simulated",
                )  # fmt: skip
                pelvis = body.joints()[0] + motion.translations
                motions.append(motion)
                trajectories[motion.name] = group["vertices"][:] + pelvis[:, None]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError) as error:
        if isinstance(error, DataSetError):
            raise
        reason = " ".join(f"{type(error).__name__} {error}".split())[:200]
        raise DataSetError(f"{path}: no file of simulated motions ({reason})") from None
    return motions, trajectories


def write_data_set(
    path: Path, body: Body, garment: Garment, simulations: Iterable[tuple[Motion, np.ndarray]]
) -> None:
    """Write simulated motions and their world positions (T, V, 3) [m] to a file, whole or not at all."""
    joint = body.joints()[0]
    with replacing(path) as temporary, h5py.File(temporary, "w") as data:
        data.attrs["format"] = DATA_SET_FORMAT
        data.attrs["settings"] = json.dumps(settings_of(body, garment))
        for place, (motion, positions) in enumerate(simulations):
            pelvis = joint + motion.translations
            vertices = (positions - pelvis[:, None]).astype(np.float32)
            group = data.create_group(str(place))
            group.attrs.update(name=motion.name, fps=motion.fps)
            group["poses"], group["translations"] = motion.poses, motion.translations
            group["vertices"] = vertices


def settings_of(body: Body, garment: Garment) -> dict[str, Any]:
    """Return the facts that must be equal for simulations to be of one cloth: a garment on a body."""
    weights = np.round(garment.skinning_weights[garment.pins], MICROMETRES)
    mesh = [np.round(garment.rest_positions, MICROMETRES), garment.faces, garment.pins, weights]
    if garment.rest_uv is not None:
        mesh.append(np.round(garment.rest_uv, MICROMETRES))
    skin = [body.template, body.skinning_weights, body.joint_template]
    if body.pose_directions is not None:
        skin.append(body.pose_directions)
    return {
        "garment": garment.name,
        "vertices": len(garment.rest_positions),
        "mesh": _digest(mesh),
        "material": asdict(garment.material),
        "body": _digest([*(np.round(array, MICROMETRES) for array in skin), body.faces]),
    }


def _digest(arrays: Sequence[np.ndarray]) -> str:
    """Return a digest of shapes and values; a zero has no sign."""
    digest = hashlib.sha256()
    for array in arrays:
        plain = np.asarray(array, np.float64) + 0.0
        digest.update(repr(plain.shape).encode() + plain.tobytes())
    return digest.hexdigest()[:16]


CM2_PER_M2 = 1e4
CM_PER_M = float(np.sqrt(CM2_PER_M2))
SMOOTHING_SHARE = 0.15  # of the way to the neighbours' mean, in one sweep
SMOOTHING_SWEEPS = 80  # at 1000 vertices


def band_loss(predicted: Tensor, target: Tensor) -> Tensor:
    """Return the mean L1 distance (N, T) [cm] of one band, (N, T, V, 3) [m], from its target."""
    return CM_PER_M * (predicted - target).abs().sum(-1).mean(-1)


class VertexTargets:
    """Simulated vertices (F, V, 3) [m] relative to the pelvis, all frames of the set's motions in a row.

    weights: skinning weights (V, J) of the prediction, on the device of the set. Raises TrainingError for
    a motion without a fitting trajectory.
    """

    def __init__(
        self,
        data: TrainingSet,
        motions: Sequence[Motion],
        trajectories: Trajectories | None,
        weights: Tensor,
    ) -> None:
        self.weights = weights
        self.vertices = relative_vertices(data.dressed, motions, trajectories).to(data.device)

    def distances(self, x: Tensor, batch: Batch) -> dict[str, Tensor]:
        """Return the mean squared distance of vertices x (N, T, V, 3) [m], name -> (N, T) [cm^2]."""
        missed = x - self.vertices[torch.as_tensor(batch.frames)]
        return {"vertices": CM2_PER_M2 * missed.square().sum(-1).mean(-1)}


class BandTargets(VertexTargets):
    """Simulated vertices, unposed and taken apart into two bands; arguments as for VertexTargets."""

    def __init__(self, data: TrainingSet, *arguments: Any) -> None:
        super().__init__(data, *arguments)
        vertices, transforms = self.vertices.cpu(), data.transforms.cpu()
        offsets = unskin(vertices, self.weights.cpu(), transforms) - data.dressed.rest()
        low = smooth_offsets(offsets.numpy(), data.dressed.garment.faces)
        self.low = torch.as_tensor(low, dtype=torch.float32).to(data.device)
        self.high = offsets.to(data.device) - self.low

    def terms(self, network: GarmentNetwork, batch: Batch, state: Tensor | None) -> dict[str, Tensor]:
        """Return the loss of both bands of the unposed offsets, name -> (N, T)."""
        rows = torch.as_tensor(batch.frames)
        low, high = cast(FrequencyMixture, network).bands(batch.features, state)
        return {"low": band_loss(low, self.low[rows]), "high": band_loss(high, self.high[rows])}


TARGETS = {"vertices": VertexTargets, "bands": BandTargets}  # by snug.kinds.Kind.targets


def smooth_offsets(offsets: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the low band of offsets (T, V, 3) [m]: diffused by sweeps with the uniform Laplacian.

    A vertex of an opening moves towards its neighbours along the opening alone, so that openings do not
    shrink. Sweeps in proportion to the vertices reach the same length on any mesh.
    """
    from scipy.sparse import coo_array, diags_array  # a network of another kind trains without scipy

    count = offsets.shape[1]
    edges, sides, _ = edge_table(faces, count)
    border = (sides < 0).any(axis=1)
    on_rim = np.zeros(count, dtype=bool)
    on_rim[edges[border]] = True
    pairs = np.concatenate([edges, edges[:, ::-1]])
    pairs = pairs[np.tile(border, 2) | ~on_rim[pairs[:, 0]]]
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()
    mean = diags_array(1.0 / links.sum(axis=1)) @ links
    flat = np.ascontiguousarray(offsets.transpose(1, 0, 2)).reshape(count, -1)
    for _ in range(max(1, round(SMOOTHING_SWEEPS * count / 1000))):
        flat = (1 - SMOOTHING_SHARE) * flat + SMOOTHING_SHARE * (mean @ flat)
    return flat.reshape(count, len(offsets), 3).transpose(1, 0, 2)


def relative_vertices(
    dressed: DressedBody, motions: Sequence[Motion], trajectories: Trajectories | None
) -> Tensor:
    """Return the simulated vertices of all frames of all motions, (F, V, 3) [m], relative to the pelvis.

    Raises:
        TrainingError: for a missing or unfit trajectory, or a number that is not finite.
    """
    if not trajectories:
        raise TrainingError(
            "supervised training needs trajectories: a simulation of each training motion"
        )
    relative = []
    for motion in motions:
        trajectory = f"simulated trajectory of motion {motion.name!r}"
        if motion.name not in trajectories:
            raise TrainingError(f"no {trajectory}: simulate it, or leave it out")
        positions = np.asarray(trajectories[motion.name])
        expected = (motion.frames, dressed.vertices, 3)
        if positions.shape != expected:
            raise TrainingError(f"{trajectory} has shape {positions.shape}, expected {expected}")
        if not (finite := np.isfinite(positions).all(axis=(1, 2))).all():
            raise TrainingError(f"{trajectory} is not finite at frame {int(np.argmin(finite))}")
        relative.append(torch.as_tensor(positions - dressed.pelvis(motion)[:, None]).float())
    return torch.cat(relative)
