"""Rows of a training history as curves that TensorBoard shows: an extra, loaded only when asked for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


class TensorBoardError(ValueError):
    """No curves can be written; the message says what to install."""


class TensorBoardLog:
    """Curves of one training, in a folder; a resumed run adds a file, and TensorBoard joins them.

    Raises TensorBoardError where TensorBoard is not installed.
    """

    def __init__(self, folder: str | Path) -> None:
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError as error:
            raise TensorBoardError(
                "--tensorboard: TensorBoard is missing; pip install 'neural-garment-benchmark[tensorboard]'"
            ) from error
        self._writer = SummaryWriter(str(folder))

    def write(self, row: Mapping[str, float]) -> None:
        """Write one row: every number but the step, under its own name."""
        step = int(row["step"])
        for name, value in row.items():
            if name != "step":
                self._writer.add_scalar(name if "/" in name else f"training/{name}", value, step)
        self._writer.flush()

    def close(self) -> None:
        """End the file."""
        self._writer.close()
