"""All frames of the training motions in a row, and the sub-sequences cut from them.

A cache holds a recurrent network's state after each frame, which windows start from. A window of three
frames says nothing of the state before it. Drawn from noise alone it is unlike any state of a roll-out,
and the network learns to shake it off; cached when the frame before last ended a window, it is that of a
roll-out, but for what the network has learned since.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from snug.body.skinning import joint_transforms
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.recipe import Recipe
from snug.training.device import CPU, compile_for

# Smallest spread by which an input is divided: rotations are numbers up to 1 in size, and one that hardly
# moved in training, as the necks of clips made by tables, must not explode on a motion where it does.
STD_FLOOR = 0.2
CONSTANT = 1e-5  # spread below which an input did not move at all, but for rounding


class TrainingError(ValueError):
    """Training that cannot start or go on; the message names the cause."""


@dataclass
class Batch:
    """Sub-sequences of one step. frames (N, T) are row numbers of the training set."""

    frames: np.ndarray
    features: Tensor  # (N, T, D)
    rest: Tensor  # (N, 1, V, 3) or (V, 3) [m], the unposed garment
    transforms: Tensor  # (N, T, 24, 3, 4)
    lead: Tensor  # (N, T, 3) [m]
    lag: Tensor  # (N, T, 3) [m]
    betas: Tensor | None = None  # (N, S) shape numbers, None on the mean body


class TrainingSet:
    """All frames of the motions, preprocessed for one recipe.

    Everything that a batch is made of lies on `device`; only row numbers are kept in numpy.

    Args:
        features: set of inputs, see DressedBody.features.
        sequences: False for a static network, whose frames need no past.
        shapes: shape numbers (M, S), one row for each motion; None: all on the mean body.

    Raises:
        TrainingError: when no motion is long enough for a window, or their frame rates differ.
    """

    def __init__(
        self,
        dressed: DressedBody,
        motions: Sequence[Motion],
        recipe: Recipe,
        *,
        features: str,
        sequences: bool,
        device: torch.device = CPU,
        shapes: np.ndarray | None = None,
    ) -> None:
        rates = {float(motion.fps) for motion in motions}
        if len(rates) != 1:
            raise TrainingError(
                f"training motions need one frame rate, these have {sorted(rates)}: resample them"
            )
        self.dt = 1.0 / rates.pop()
        self.dressed, self.recipe, self.device = dressed, recipe, device
        self._ends_in_shape = features == "motion"
        self.names = [motion.name for motion in motions]
        self.first = np.cumsum([0, *(motion.frames for motion in motions)])
        self.shapes = shapes
        pairs = list(zip(motions, [None] * len(motions) if shapes is None else shapes))
        inputs = [dressed.features(m, recipe, betas, feature_set=features) for m, betas in pairs]
        self.features = torch.cat(inputs).to(device)
        self.transforms = torch.cat([dressed.transforms(m.poses, betas) for m, betas in pairs]).to(device)
        pelvises = [dressed.pelvis(motion) for motion in motions]
        self.lead = torch.cat([_lead(pelvis) for pelvis in pelvises]).to(device)
        # p_{t-1} - p_t of each frame, (F, 3) [m]; zero in a motion's first.
        lag = np.concatenate([-np.diff(pelvis, axis=0, prepend=pelvis[:1]) for pelvis in pelvises])
        self.lag = torch.as_tensor(lag, dtype=torch.float32).to(device)
        self.rest = dressed.rest().to(device)
        self._rest_directions: Tensor | None = None
        body = dressed.body
        self._skeleton = (  # float64 until the chain is done
            torch.as_tensor(body.joint_template, device=device),
            torch.as_tensor(body.joint_directions, device=device),
        )
        self._repose = compile_for(_repose, device)
        self.window = recipe.window if sequences else 1
        stride = recipe.window_stride if sequences else 1
        spans = zip(self.first[:-1], self.first[1:] - self.window + 1)
        self.starts = np.concatenate([np.arange(*span, stride) for span in spans])
        if len(self.starts) == 0:
            raise TrainingError(f"no training motion has {self.window} frames: give longer motions")

    @property
    def frames(self) -> int:
        """Number of all frames."""
        return int(self.first[-1])

    def motion_of(self, frames: ArrayLike) -> np.ndarray:
        """Return the places of the motions that row numbers belong to."""
        return np.searchsorted(self.first, frames, side="right") - 1

    def name_frame(self, frame: int) -> str:
        """Name a row number by motion and frame."""
        motion = int(self.motion_of(frame))
        return f"motion {self.names[motion]!r} frame {frame - self.first[motion]}"

    def input_statistics(self) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and spread (D,) of the inputs; for the shape numbers those of the recipe's U(-r, r).

        An input that never varies gets an infinite spread: the network then never reads it, for the
        weights behind it stay as random as they began.
        """
        mean = self.features.mean(0).cpu().numpy()
        std = self.features.std(0, correction=0).cpu().numpy()
        std = np.where(std < CONSTANT, np.inf, np.maximum(std, STD_FLOOR))
        shapes = self.dressed.body.shape_count
        if shapes and self.recipe.shape_range and self._ends_in_shape:
            mean[-shapes:], std[-shapes:] = 0.0, self.recipe.shape_range / np.sqrt(3.0)
        return mean, std

    def at(self, frames: np.ndarray, betas: np.ndarray | None = None) -> Batch:
        """Return rows (N, T), those of a line from one motion, as tensors.

        Each line is on the body of its motion, or of its shape in betas (N, S).
        """
        rows = torch.as_tensor(frames, device=self.device)
        shapes = None if betas is None else torch.as_tensor(betas, device=self.device)
        batch = replace(self.gather(rows, shapes), frames=frames)
        if betas is not None or self.shapes is None:
            return batch
        drawn = self.shapes[self.motion_of(frames[:, 0])]
        return self._dress(batch, torch.as_tensor(drawn, device=self.device))

    def gather(self, rows: Tensor, betas: Tensor | None = None) -> Batch:
        """Return rows (N, T) on the device, each line on the mean body or that of shape numbers (N, S).

        The batch does not know its frames.
        """
        parts = (self.transforms[rows], self.lead[rows], self.lag[rows])
        batch = Batch(np.empty(0, np.int64), self.features[rows], self.rest, *parts)
        if betas is None:
            return batch
        reposed = self._repose(self.dressed.parents, *self._skeleton, batch.transforms, betas.double())
        repeated = betas.float()[:, None].expand(-1, rows.shape[1], -1)
        inputs = torch.cat([batch.features[..., : -betas.shape[1]], repeated], -1)
        return self._dress(replace(batch, transforms=reposed, features=inputs), betas)

    def gather_past(self, frames: np.ndarray, count: int) -> Tensor:
        """Return the features (N, count, D) before rows (N,), in place of missing ones a motion's first."""
        first = self.first[self.motion_of(frames)]
        rows = np.maximum(frames[:, None] - np.arange(count, 0, -1), first[:, None])
        return self.features[torch.as_tensor(rows, device=self.device)]

    def frames_of(self, windows: np.ndarray) -> np.ndarray:
        """Return the row numbers (N, T) of windows (N,)."""
        return self.starts[windows][:, None] + np.arange(self.window)

    def batch(self, windows: np.ndarray, betas: np.ndarray | None = None) -> Batch:
        """Return windows (N,) as tensors, see `at`."""
        return self.at(self.frames_of(windows), betas)

    def _dress(self, batch: Batch, betas: Tensor) -> Batch:
        """Return the batch with the unposed garments of shapes (N, S)."""
        shapes = betas.float()
        if self._rest_directions is None:
            self._rest_directions = self.dressed.rest_directions.to(self.device)
        rest = self.rest + torch.einsum("ns,svi->nvi", shapes, self._rest_directions)
        return replace(batch, rest=rest[:, None], betas=shapes)


def _repose(
    parents: Sequence[int], template: Tensor, directions: Tensor, transforms: Tensor, betas: Tensor
) -> Tensor:
    """Return the same poses on other skeletons; rotations are read from the transforms of the mean body.

    Joints (24, 3) and their directions (24, 3, 10), both float64; transforms (N, T, 24, 3, 4) float32;
    betas (N, 10) float64.
    """
    joints = (template + torch.einsum("jis,ns->nji", directions, betas))[:, None]
    world = transforms[..., :3].double()
    relative = world[:, :, [max(parent, 0) for parent in parents]].transpose(-1, -2) @ world
    relative[:, :, 0] = world[:, :, 0]
    home = (-joints[..., 0, :]).expand(*transforms.shape[:2], 3)
    joints = joints.expand(*transforms.shape[:2], *joints.shape[-2:])
    return joint_transforms(relative, joints, parents, home).float()


def _lead(pelvis: np.ndarray) -> Tensor:
    """Return 2 p_{t-1} - p_{t-2} - p_t of each frame, (T, 3) [m]; zero without two earlier frames."""
    lead = np.zeros_like(pelvis)
    lead[2:] = 2 * pelvis[1:-1] - pelvis[:-2] - pelvis[2:]
    return torch.as_tensor(lead, dtype=torch.float32)


class HiddenStateCache:
    """States (L, F + 1, H) after each frame, zero where it never ended a window.

    The last row stands for the time before a motion, when a roll-out has a state of zero. `first` (M +
    1,): rows at which motions begin, and the number of all frames.
    """

    def __init__(self, first: np.ndarray, shape: tuple[int, int], device: torch.device) -> None:
        frames = int(first[-1])
        past = np.arange(frames) - 1
        past[first[:-1]] = frames
        self.before = torch.as_tensor(past, device=device)
        self.states = torch.zeros(shape[0], frames + 1, shape[1], device=device)

    def at(self, frames: np.ndarray) -> Tensor:
        """Return the states (L, N, H) before frames (N,)."""
        return self.states[:, self.before[torch.as_tensor(frames, device=self.before.device)]]

    def keep(self, frames: np.ndarray, states: Tensor) -> None:
        """Cache states (L, N, H) after frames (N,)."""
        # Of a frame that comes twice the first: which of two writes lands last is not a GPU's to choose.
        once = torch.as_tensor(np.unique(frames, return_index=True)[1], device=states.device)
        self.states[:, torch.as_tensor(frames, device=states.device)[once]] = states.detach()[:, once]
