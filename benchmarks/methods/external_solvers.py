"""Vertex block descent and XPBD as NVIDIA's newton has them: peers on their own energies, in float32.

Membrane and hinges become newton's as solver_speed.newton_peer says: close to ours at small strain, not at
large. Sub-steps are those of newton's examples, so a frame is not the minimum of one step of ours, and its
energy gap says so. Copies into and out of newton are on the clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reference_sim import Trajectory

from ..method import Method
from ..scene import BuiltScene


@dataclass
class NewtonSolver(Method):
    """One solver of newton on one scene without contact."""

    solver: str
    iterations: int
    substeps: int

    def prepare(self, scene: BuiltScene) -> None:
        """Build the model and let it compile, by one frame that nobody looks at."""
        from ..solver_speed.newton_peer import Peer

        self.scene = scene
        self.peer = Peer(scene.cloth, self.solver, iterations=self.iterations, substeps=self.substeps)
        self.peer.advance(scene.start, np.zeros_like(scene.start), scene.dt)

    def run(self) -> Trajectory:
        scene = self.scene
        x = scene.start
        v = np.zeros_like(x) if scene.start_velocity is None else scene.start_velocity
        positions, status, reason = [x], "ok", ""
        for frame in range(1, scene.frames):
            if scene.pin_positions is not None:
                x = x.copy()
                x[scene.cloth.pins] = scene.pin_positions(frame)
            advance = self.peer.advance(x, v, scene.dt)
            if advance.diverged:
                status, reason = "diverged", f"frame {frame}: a vertex is nowhere, or 100 m away"
                break
            x, v = advance.x, advance.v
            positions.append(x)
        return Trajectory(
            positions=np.array(positions),
            faces=scene.cloth.faces,
            times=scene.dt * np.arange(len(positions)),
            frame_seconds=np.full(len(positions), np.nan),
            status=status,
            reason=reason,
            provenance=self._provenance(),
            frame_fields={},
        )

    def _provenance(self) -> dict[str, Any]:
        import newton

        return {
            "method": f"newton {newton.__version__} {self.solver}",
            "iterations": self.iterations,
            "substeps": self.substeps,
        }


def make(*, models: Path, seed: int, solver: str, iterations: int, substeps: int) -> NewtonSolver:
    """The solver "VBD" or "XPBD" of newton."""
    return NewtonSolver(solver, iterations, substeps)
