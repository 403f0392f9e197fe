"""Scene of a thrown sheet under its weight alone: backward Euler's own discrete answer is exact.

    x_n = x_0 + n dt v_0 + g dt^2 n (n+1)/2

The parabola of the continuous problem is not the answer: at 30 frames per second it is 0.16 m away after
one second. With weight alone every vertex moves alike, so that strain and bending have nothing to do and
are not declared.
"""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import square_sheet
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.gravity import Gravity
from reference_sim.material import GRAVITY, Material

VELOCITY = np.array([0.7, 2.0, -0.3])  # [m/s]


def build(scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int) -> BuiltScene:
    """Build the scene with its exact answer; no assets are needed."""
    positions, faces = square_sheet(sheet_cells, 0.4)
    cloth = Cloth(positions, faces, Material())
    dt, frames = 1.0 / 30.0, sheet_frames
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(Gravity(cloth),),
        dt=dt,
        frames=frames,
        settle=lambda: np.stack([positions, np.broadcast_to(VELOCITY, positions.shape)]),
        exact=exact_fall(positions, VELOCITY, dt, frames),
    )


def exact_fall(start: np.ndarray, velocity: np.ndarray, dt: float, frames: int) -> np.ndarray:
    """Return the exact steps (T,V,3) [m] of backward Euler from start (V,3) [m] with one velocity (3,) [m/s].

    >>> import numpy as np
    >>> fall = exact_fall(np.zeros((1, 3)), np.zeros(3), 0.1, 3)[:, 0, 1]
    >>> [round(float(height), 4) for height in fall]
    [0.0, -0.0981, -0.2943]
    """
    n = np.arange(frames)[:, None, None]
    fall = np.array([0.0, -GRAVITY, 0.0]) * dt**2 * n * (n + 1) / 2
    return start + n * dt * velocity + fall
