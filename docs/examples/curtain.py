"""A square sheet that hangs from one whole edge, in a wind, and is let go from the horizontal."""

from wind import Wind

from benchmarks import BuiltScene, Scene
from benchmarks.meshes import square_sheet
from reference_sim import Cloth, Material
from reference_sim.energies import BendHinge, Gravity, StretchStVK

SIZES = ("sheet_cells", "sheet_frames")
SCENES = (Scene(name="curtain", description="a square sheet that hangs from one edge", sizes=SIZES),)


def build(scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int) -> BuiltScene:
    """Return the sheet with so many cells along an edge [1] and so many frames."""
    positions, faces = square_sheet(sheet_cells, 0.4)
    cloth = Cloth(positions, faces, Material(), pins=list(range(sheet_cells + 1)))
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), Wind(cloth)),
        dt=1.0 / 30.0,
        frames=sheet_frames,
        settle=lambda: cloth.rest_positions,
    )
