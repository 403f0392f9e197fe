"""Reference solver, to its full tolerance: every other method is compared with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.method import Method
from benchmarks.scene import BuiltScene
from reference_sim.time_loop import simulate
from reference_sim.trajectory.trajectory import Trajectory


@dataclass
class Simulation(Method):
    """Simulation whose steps are minimised to a tolerance, or stopped after `max_iterations` a step."""

    options: dict[str, Any]
    scene: BuiltScene | None = None
    announced: bool = False

    def prepare(self, scene: BuiltScene) -> None:
        """Settle the start, and compile the kernels by simulating two frames that are thrown away."""
        self.scene = scene
        self._simulate(frames=min(2, scene.frames))

    def run(self) -> Trajectory:
        """Simulate all frames."""
        assert self.scene is not None
        # Hours at the paper's scale: a bar with the time left, a microsecond of a frame's milliseconds.
        # Once: short runs are done again until enough time is measured.
        label = self.scene.name if self.scene.dressed and not self.announced else None
        self.announced = True
        return self._simulate(frames=self.scene.frames, progress=label)

    def _simulate(self, *, frames: int, progress: str | None = None) -> Trajectory:
        scene = self.scene
        assert scene is not None
        # Solvers that stop early are approximations of the declared terms; some know no others.
        approximate = "max_iterations" in self.options
        return simulate(
            scene.cloth,
            scene.energies if approximate else scene.simulated_energies,
            dt=scene.dt,
            frames=frames,
            obstacle=scene.obstacle,
            start=scene.start,
            velocity=scene.start_velocity,
            pin_positions=scene.pin_positions,
            progress=progress,
            **self.options | {"substeps": scene.substeps * self.options.get("substeps", 1)},
        )


def make(*, models: Path, seed: int, **options: Any) -> Simulation:
    """Make a simulation with the reference's tolerance and time step, or with those in the options."""
    return Simulation(options=options)
