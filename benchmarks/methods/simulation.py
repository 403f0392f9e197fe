"""Reference solver, to its full tolerance or stopped early: every other method is compared with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.declarations import load_function
from benchmarks.method import Method
from benchmarks.scene import BuiltScene
from reference_sim.time_loop import TimeStepper
from reference_sim.trajectory import Trajectory

# Options of quasi-static solutions. With this time step [s] and no velocities inertia weighs a thousandth
# of what it weighs in a frame: a hem that swings once in a second comes within 3 % of its static place,
# and there is still one minimum to go to. The tolerance [mean vertex weights] is for hems in millimetres.
STATIC: dict[str, Any] = {"dt": 1.0, "quasi_static": True, "tolerance": 1e-4}


@dataclass
class Simulation(Method):
    """Simulation whose steps are minimised to a tolerance, or stopped after `max_iterations` a step.

    options: of a TimeStepper. change: makes the simulated scene from the given one.
    """

    options: dict[str, Any] = field(default_factory=dict)
    change: Callable[[BuiltScene], BuiltScene] | None = None
    scene: BuiltScene = field(init=False)
    stepper: TimeStepper = field(init=False)
    announced: bool = field(default=False, init=False)

    def prepare(self, scene: BuiltScene) -> None:
        """Settle the start, set the solver up, and compile by two frames thrown away."""
        self.scene = scene = self.change(scene) if self.change else scene
        # Solvers that stop early are approximations of the declared terms, and a function that makes a
        # minimiser knows no terms that join a step late.
        declared_alone = "max_iterations" in self.options or callable(self.options.get("method"))
        self.stepper = TimeStepper(
            scene.cloth,
            scene.energies if declared_alone else scene.simulated_energies,
            obstacle=scene.obstacle,
            **{"dt": scene.dt}
            | self.options
            | {"substeps": scene.substeps * self.options.get("substeps", 1)},
        )
        self._simulate(frames=min(2, scene.frames))

    def run(self) -> Trajectory:
        """Simulate all frames, with the solver as it was when it was set up."""
        self.stepper.minimiser.start_again()
        # Hours at the paper's scale: a bar with the time left, a microsecond of a frame's milliseconds.
        # Once: short runs are done again until enough time is measured.
        label = self.scene.name if self.scene.dressed and not self.announced else None
        self.announced = True
        return self._simulate(frames=self.scene.frames, progress=label)

    def _simulate(self, *, frames: int, progress: str | None = None) -> Trajectory:
        scene = self.scene
        trajectory = self.stepper.simulate(
            frames=frames,
            start=scene.start,
            velocity=scene.start_velocity,
            pin_positions=scene.pin_positions,
            progress=progress,
        )
        # Also of slow steps.
        return replace(trajectory, times=scene.dt * np.arange(float(trajectory.frames)))


def make_simulation(*, models: Path, seed: int, **options: Any) -> Simulation:
    """Make a simulation with the reference's tolerance and time step, or with those in the options.

    method: as of a TimeStepper, or "module:class" of a minimiser.
    """
    if ":" in options.get("method", ""):
        options["method"] = load_function(options["method"], "")
    return Simulation(options)
