"""Methods that do wrong, each in its own way: what the harness must survive and say."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np

from benchmarks.method import Method
from reference_sim.trajectory import Trajectory


class Misbehaving(Method):
    """Skips all physics; `how` says what it does instead of its work."""

    def __init__(self, how: str) -> None:
        self.how = how

    def prepare(self, scene) -> None:
        self.scene = scene
        if self.how == "raise":
            raise RuntimeError("broken on\npurpose")

    def run(self) -> Trajectory:
        scene = self.scene
        still = np.repeat(np.asarray(scene.start)[None], scene.frames, axis=0)
        getattr(self, f"_{self.how}", lambda _: None)(still)
        if self.how == "late":  # a frame too many
            still = np.concatenate([still[:1], still])
        return Trajectory(
            positions=still, faces=np.asarray(scene.cloth.faces), times=np.arange(len(still)) * scene.dt,
            frame_seconds=np.full(len(still), 1e-6), status="ok",
        )  # fmt: skip

    def batch(self, copies: int):
        """Many at once: "torn" raises."""

        def compute() -> np.ndarray:
            still = np.zeros((self.scene.frames, copies, len(self.scene.start), 3))
            if self.how == "torn":
                raise RuntimeError("no two bodies")
            return still

        return compute

    def quasi_static(self) -> Trajectory | None:
        if self.how == "unheld":
            raise OSError("no room left for the held poses")
        if self.how == "astray":
            still = np.zeros((self.scene.frames, 2, 3))
            return Trajectory(still, self.scene.cloth.faces, np.arange(len(still)) * self.scene.dt)
        return None

    def _early(self, positions) -> None:
        """Comes back at once and goes on working in a thread."""

        def work() -> None:
            end = time.perf_counter() + 0.4
            while time.perf_counter() < end:
                positions[-1] += 1e-6

        threading.Thread(target=work, daemon=True).start()


def make(*, models: Path, seed: int, how: str) -> Misbehaving:
    return Misbehaving(how)
