"""A roll-out that another program has made, from its file: judged as a method, and never timed as one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reference_sim import Trajectory

from ..method import Method
from ..roll_out_files import StoredRollOut, read_roll_out
from ..roll_out_fit import fitted
from ..roll_out_option import RollOutError, Stated
from ..scene import BuiltScene


@dataclass
class Stored(Method):
    """The positions of a file, once they have been found to belong to the scene."""

    path: str
    stated: Stated

    def prepare(self, scene: BuiltScene) -> None:
        """Read the file and compare it with the scene. Raises RollOutError."""
        self.scene = scene
        try:
            self.stored, self.done = fitted(read_roll_out(self.path), scene, self.stated)
        except RollOutError as error:
            raise RollOutError(str(error) if self.path in str(error) else f"{self.path}: {error}") from None

    def run(self) -> Trajectory:
        """What the file holds."""
        return self._trajectory(self.stored.positions, self.stored)

    def quasi_static(self) -> Trajectory | None:
        """What the file says of poses held still; None where it says nothing."""
        held = self.stored.quasi_static
        return None if held is None else self._trajectory(held, self.stored)

    def _trajectory(self, positions: np.ndarray, stored: StoredRollOut) -> Trajectory:
        finite, changes = bool(np.isfinite(positions).all()), "; ".join(self.done)
        # Whoever claims nothing is held to nothing where a frame that claims to have converged is judged.
        claims = np.zeros(len(positions)) if stored.converged is None else stored.converged[: len(positions)]
        return Trajectory(
            positions=positions,
            faces=np.asarray(self.scene.cloth.faces),
            times=np.arange(len(positions)) * self.scene.dt,
            status="ok" if finite else "diverged",
            reason=changes if finite else f"{self.path}: holds a position that is not finite",
            provenance={"method": "stored roll-out", "file": Path(self.path).name, "changes": changes},
            frame_fields={"converged": claims},
        )


def make(*, models: Path, seed: int, path: str, digest: str, **stated: object) -> Stored:
    """The roll-out of that file; digest is of its content, for the cache. It has no seed and no model."""
    return Stored(path, Stated(**stated))  # type: ignore[arg-type]
