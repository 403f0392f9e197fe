"""Cache of a recurrent network's state after each training frame, which windows start from.

A window of three frames says nothing of the state before it. Drawn from noise alone it is unlike any state of
a roll-out, and the network learns to shake it off; cached when the frame before last ended a window,
it is that of a roll-out, but for what the network has learned since. (With windows of three there are three
such roll-outs of a motion, from its first, its second and its third frame.)
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from snug.training.process_group import ALONE, Group


class HiddenStateCache:
    """States (L, F + 1, H) after each frame, zero where it never ended a window.

    The last row stands for the time before a motion, when a roll-out has a state of zero.

    Args:
        first: rows at which motions begin, and the number of all frames at the end (TrainingSet.first).
        shape: layers L and width H of a state.
        device: where the states lie.
    """

    def __init__(self, first: np.ndarray, shape: tuple[int, int], device: torch.device) -> None:
        frames = int(first[-1])
        before = np.arange(frames) - 1
        before[first[:-1]] = frames
        self.before = torch.as_tensor(before, device=device)
        self.states = torch.zeros(shape[0], frames + 1, shape[1], device=device)

    def at(self, frames: np.ndarray) -> Tensor:
        """Return the states (L, N, H) before frames (N,)."""
        return self.states[:, self.before[torch.as_tensor(frames, device=self.before.device)]]

    def keep(self, frames: np.ndarray, states: Tensor, group: Group = ALONE) -> None:
        """Cache states (L, N, H) after frames (N,); in a group each process gives its own."""
        rows = group.gathered(torch.as_tensor(frames, device=self.before.device)).cpu().numpy()
        # Of a frame that comes twice the first: which of two writes lands last is not a GPU's to choose.
        once = torch.as_tensor(np.unique(rows, return_index=True)[1], device=states.device)
        after = group.gathered(states.detach().transpose(0, 1)).transpose(0, 1)
        self.states[:, torch.as_tensor(rows, device=states.device)[once]] = after[:, once]
