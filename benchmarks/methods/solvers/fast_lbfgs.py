"""The compiled truncated solver: L-BFGS in float32 on planes that slide (reference_sim.minimise.compiled)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.scene import BuiltScene
from reference_sim import Trajectory
from reference_sim.minimise.compiled.minimiser import CompiledLBFGS
from reference_sim.minimise.compiled.sliding_obstacle import SlidingObstacle


class FastSimulation(Simulation):
    """A simulation whose obstacle slides; each run begins with an exact search, whatever was run before."""

    def prepare(self, scene: BuiltScene) -> None:
        if scene.obstacle is not None:
            scene = replace(scene, obstacle=SlidingObstacle(scene.obstacle))
        super().prepare(scene)

    def run(self) -> Trajectory:
        assert self.scene is not None
        if isinstance(self.scene.obstacle, SlidingObstacle):
            self.scene.obstacle.start_again()
        return super().run()


def make(*, models: Path, seed: int, iterations: int) -> FastSimulation:
    """Each step by so many iterations."""
    return FastSimulation(options={"method": CompiledLBFGS, "max_iterations": iterations})
