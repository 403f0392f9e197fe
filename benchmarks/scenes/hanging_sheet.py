"""Scene of a square sheet pinned at two corners and let go from the horizontal, without an obstacle."""

from __future__ import annotations

from benchmarks.meshes import square_sheet
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import Material

SIZE = 0.4  # [m]


def build(scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int) -> BuiltScene:
    """Build the scene; no assets are needed."""
    positions, faces = square_sheet(sheet_cells, SIZE)
    # Tilted by half a degree: a flat sheet hanging flat is a saddle, from which symmetry alone would choose.
    positions[:, 1] += 0.01 * positions[:, 0]
    cloth = Cloth(positions, faces, Material(), pins=(0, sheet_cells))
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=1.0 / 30.0,
        frames=sheet_frames,
        settle=lambda: cloth.rest_positions,
    )
