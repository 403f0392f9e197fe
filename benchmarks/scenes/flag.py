"""Scene of a flag under gravity whose pole is swung to and fro: its pinned edge alone moves it."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import square_sheet
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import Material

SIZE = 0.4  # [m]
SWING = 0.15  # [m] to either side
PERIOD = 1.0  # [s]


def build(scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int) -> BuiltScene:
    """Build the scene; no assets are needed."""
    flat, faces = square_sheet(sheet_cells, SIZE)
    positions = np.stack([flat[:, 0], -flat[:, 2], flat[:, 1]], axis=1)  # upright, in the plane of x and y
    pole = np.arange(sheet_cells + 1)  # the edge at the smallest x
    cloth = Cloth(positions, faces, Material(), pins=pole)
    dt = 1.0 / 30.0

    def handles(frame: int) -> np.ndarray:
        """Return the pole in a frame, (P,3) [m]: it starts from rest, so that the first frame has no jolt."""
        phase = 2.0 * np.pi * frame * dt / PERIOD
        return positions[pole] + [0.0, 0.0, SWING * np.sin(phase) * (1.0 - np.cos(min(phase, np.pi))) / 2.0]

    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=dt,
        frames=sheet_frames,
        settle=lambda: positions,
        pin_positions=handles,
    )
