"""A square sheet pinned at two corners and let go from the horizontal. No obstacle, no body."""

from __future__ import annotations

from reference_sim import Cloth, Material
from reference_sim.energies import BendHinge, Gravity, StretchStVK

from ..presets import Preset
from ..scene import BuiltScene
from .sheet import square_sheet

SIZE = 0.4  # [m]


def build(name: str, preset: Preset, wardrobe: object = None) -> BuiltScene:
    """The built scene; the wardrobe is not looked at."""
    positions, faces = square_sheet(preset.sheet_cells, SIZE)
    # Tilted by half a degree: a flat sheet hanging flat is a saddle, from which symmetry alone would choose.
    positions[:, 1] += 0.01 * positions[:, 0]
    cloth = Cloth(positions, faces, Material(), pins=(0, preset.sheet_cells))
    return BuiltScene(
        name=name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=1.0 / 30.0,
        frames=preset.sheet_frames,
        settle=lambda: cloth.rest_positions,
    )
