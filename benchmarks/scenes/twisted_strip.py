"""Scene of a strip whose two ends turn against each other, one turn in all: large rotations, folds."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import sheet
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import Material

LENGTH, WIDTH = 0.4, 0.12  # [m]
TURN = np.pi  # of each end, against the other
CLOSER = 0.1  # share of the length by which the ends approach, so that the strip may fold


def build(scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int) -> BuiltScene:
    """Build the scene; no assets are needed."""
    across = max(2, sheet_cells // 2)
    positions, faces = sheet((round(across * LENGTH / WIDTH), across), (LENGTH, WIDTH))
    ends = np.flatnonzero(np.abs(np.abs(positions[:, 0]) - LENGTH / 2) < 1e-9)
    cloth = Cloth(positions, faces, Material(), pins=ends)
    side = np.sign(positions[ends, 0])
    frames = sheet_frames

    def handles(frame: int) -> np.ndarray:
        """Return both ends in a frame, turned about the strip's axis and moved together, smoothly."""
        share = 0.5 - 0.5 * np.cos(np.pi * frame / (frames - 1))
        angle = TURN * share * side
        rest = positions[ends]
        return np.stack(
            [
                rest[:, 0] * (1.0 - CLOSER * share),
                rest[:, 1] * np.cos(angle) - rest[:, 2] * np.sin(angle),
                rest[:, 1] * np.sin(angle) + rest[:, 2] * np.cos(angle),
            ],
            axis=1,
        )

    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=1.0 / 30.0,
        frames=frames,
        settle=lambda: positions,
        pin_positions=handles,
    )
