"""Methods by vertex block descent and XPBD of NVIDIA's newton: see benchmarks.engines.newton_cloth.

Sub-steps are those of newton's examples: a frame is not the minimum of one step of ours, and its energy gap
says so. Pins move evenly over the sub-steps of a frame, as in the reference. Copies into and out of newton
are on the clock.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.engines.engine import FAR
from benchmarks.engines.newton_cloth import NewtonCloth
from benchmarks.method import Method
from benchmarks.scene import BuiltScene
from reference_sim.trajectory import Trajectory


@dataclass
class NewtonSolver(Method):
    """Method of one solver of newton on a scene without contact."""

    solver: str
    iterations: int
    substeps: int

    def prepare(self, scene: BuiltScene) -> None:
        """Build the model and let it compile, by one frame that is thrown away."""
        self.scene = scene
        self.newton = NewtonCloth(scene.cloth, self.solver, iterations=self.iterations)
        self.newton.advance(scene.start, np.zeros_like(scene.start), scene.dt / self.substeps)

    def run(self) -> Trajectory:
        """Advance all frames; stop where a vertex is not finite or flew away."""
        import newton

        scene, pins = self.scene, self.scene.cloth.pins
        x = scene.start
        v = scene.start_velocity
        positions, seconds, status, reason = [x], [0.0], "ok", ""
        clock = time.perf_counter()
        for frame in range(1, scene.frames):
            held = x[pins]
            target = held if scene.pin_positions is None else scene.pin_positions(frame)
            for j in range(1, self.substeps + 1):
                if scene.pin_positions is not None:
                    share = j / self.substeps
                    x = x.copy()
                    x[pins] = (1 - share) * held + share * target
                x, v = self.newton.advance(x, v, scene.dt / self.substeps)
            if not (np.isfinite(x).all() and np.abs(x).max() < FAR):
                status, reason = "diverged", f"frame {frame}: a vertex is nowhere, or {FAR:g} m away"
                break
            positions.append(x)
            before, clock = clock, time.perf_counter()
            seconds.append(clock - before)
        return Trajectory(
            positions=np.array(positions),
            faces=scene.cloth.faces,
            times=scene.dt * np.arange(len(positions)),
            frame_seconds=np.array(seconds),
            status=status,
            reason=reason,
            provenance={
                "method": f"newton {newton.__version__} {self.solver}",
                "iterations": self.iterations,
                "substeps": self.substeps,
            },
        )


def make(*, models: Path, seed: int, solver: str, iterations: int, substeps: int) -> NewtonSolver:
    """Make the solver "VBD" or "XPBD" of newton."""
    return NewtonSolver(solver, iterations, substeps)
