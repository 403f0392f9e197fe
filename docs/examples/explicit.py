"""Semi-implicit Euler with many small steps: no minimisation at all."""

from dataclasses import dataclass

import numpy as np

from benchmarks import BuiltScene, Method, MethodEntry
from reference_sim import Potential, Trajectory

WORDS, OPTIONS = "semi-implicit Euler, 200 steps a frame", {"substeps": 200}
METHODS = (
    MethodEntry(
        name="explicit-200", description=WORDS, options=OPTIONS, role="solver", needs_no_obstacle=True
    ),
)


@dataclass
class Explicit(Method):
    """Many small explicit steps a frame."""

    substeps: int

    def prepare(self, scene: BuiltScene) -> None:
        """Keep the scene, and compile the kernels of its energies."""
        self.scene = scene
        self.potential = Potential(scene.energies)
        self.potential.gradient(scene.start)

    def run(self) -> Trajectory:
        """Compute all frames; say so where they are not finite."""
        scene, cloth = self.scene, self.scene.cloth
        dt = scene.dt / self.substeps
        inverse_masses = (cloth.free / cloth.masses)[:, None]
        positions = np.empty((scene.frames, cloth.vertex_count, 3))
        x, velocity = scene.start.copy(), scene.start_velocity.copy()
        for frame in range(scene.frames):
            if frame and scene.pin_positions is not None:
                x[cloth.pins] = scene.pin_positions(frame)
            for _ in range(self.substeps if frame else 0):
                velocity -= dt * inverse_masses * self.potential.gradient(x)
                x += dt * velocity
            positions[frame] = x
        times = np.arange(scene.frames) * scene.dt
        if np.isfinite(positions).all():
            return Trajectory(positions, cloth.faces, times)
        return Trajectory(positions, cloth.faces, times, status="diverged", reason="use more steps")


def make(*, models: object, seed: int, substeps: int) -> Explicit:
    """Return a fresh method, with the options of its entry."""
    return Explicit(substeps)
