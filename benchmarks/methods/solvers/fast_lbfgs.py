"""L-BFGS compiled as a whole, in float32, on contact planes that slide (reference_sim.minimise.compiled)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.scene import BuiltScene
from reference_sim.minimise.compiled.minimiser import CompiledLBFGS
from reference_sim.minimise.compiled.sliding_obstacle import SlidingObstacle
from reference_sim.trajectory.trajectory import Trajectory


class FastSimulation(Simulation):
    """Simulation whose obstacle slides; each run begins with an exact search, whatever was run before."""

    def prepare(self, scene: BuiltScene) -> None:
        """Let the obstacle slide and prepare the simulation."""
        if scene.obstacle is not None:
            scene = replace(scene, obstacle=SlidingObstacle(scene.obstacle))
        super().prepare(scene)

    def run(self) -> Trajectory:
        """Simulate all frames from an exact search on."""
        assert self.scene is not None
        if isinstance(self.scene.obstacle, SlidingObstacle):
            self.scene.obstacle.start_again()
        return super().run()


def make(*, models: Path, seed: int, iterations: int) -> FastSimulation:
    """Make a simulation whose every step is `iterations` of compiled L-BFGS."""
    return FastSimulation(options={"method": CompiledLBFGS, "max_iterations": iterations})
