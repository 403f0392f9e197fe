"""The dynamic metrics of a dressed scene: what its hem is measured in, and the simulator's static answer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .metrics.dynamics import HemMotion, stop_frame
from .results import RunFolder

if TYPE_CHECKING:
    from reference_sim import Trajectory

    from .scene import BuiltScene

# With this time step [s] and no velocities inertia weighs a thousandth of what it weighs in a frame: a hem
# that swings once in a second comes within 3 % of its static place, and there is still one minimum to go to.
SLOW = 1.0
TOLERANCE = 1e-4  # mean vertex weights: the hem is measured in millimetres


def hem_motion(scene: BuiltScene, simulated: np.ndarray, run: RunFolder) -> HemMotion | None:
    """What to measure hems of this scene in; None where there is no body, or the garment names no hem.

    simulated: the reference's positions (T,V,3) [m]. Its static answer is solved for here, once: off every
    clock, and kept beside the other trajectories.
    """
    if scene.dressed is None or "hem" not in scene.dressed.garment.loops:
        return None
    from snug.skeleton import rotation_matrices

    body, motion = scene.dressed.body, scene.dressed.motion
    return HemMotion(
        axes=rotation_matrices(motion.poses[:, 0]),
        origins=body.joints()[0] + motion.translations,
        stop=stop_frame(motion.poses, motion.translations),
        hem=scene.dressed.garment.hem,
        simulated=simulated,
        quasi_static=held_simulation(scene, run.held_path(scene.name, "simulation")).positions,
        dt=scene.dt,
    )


def held_simulation(scene: BuiltScene, path: Path) -> Trajectory:
    """The simulator's answer to each frame held still, from `path` where it lies there whole."""
    from reference_sim import simulate
    from reference_sim.trajectory import TrajectoryError

    path.parent.mkdir(parents=True, exist_ok=True)

    def solve(resume: bool) -> Trajectory:
        return simulate(
            scene.cloth, scene.energies, dt=SLOW, frames=scene.frames, obstacle=scene.obstacle,
            start=scene.start, quasi_static=True, tolerance=TOLERANCE, path=path, resume=resume,
            pin_positions=scene.pin_positions,
        )  # fmt: skip

    try:
        return solve(resume=True)
    except TrajectoryError:  # of another start, garment or motion
        return solve(resume=False)
