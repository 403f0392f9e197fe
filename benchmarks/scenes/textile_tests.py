"""Scenes of textile testing: the cantilever of ASTM D1388 and Cusick's drapemeter, for each fabric."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.fabrics.fabric import FABRICS, Fabric
from benchmarks.scene import BuiltScene, Scene

METRICS = ("energy", "fabric", "cost")
RINGS = 2  # cells of the preset's sheets that make a ring of the disc
COLUMNS = 2  # cells of the strip that make one of the preset's sheets


def textile_tests(fabrics: Sequence[Fabric]) -> tuple[Scene, ...]:
    """Declare both tests of each fabric."""
    return tuple(
        Scene(
            name=f"fabric/{test}/{fabric.name}",
            description=f"{title}: {1e3 * fabric.density:.0f} g/m2, "
            f"bending length {1e3 * fabric.bending_length:.1f} mm",
            module="benchmarks.scenes.textile_tests",
            sizes=("sheet_cells", "sheet_frames"),
            options={"test": test, "fabric": (fabric.name, fabric.density, fabric.warp, fabric.weft)},
            metrics=METRICS,
        )
        for test, title in (
            ("cantilever", "a strip that overhangs by twice its bending length"),
            ("drape", "a disc of 30 cm on a plate of 18 cm"),
        )
        for fabric in fabrics
    )


TEXTILE_TESTS = textile_tests(FABRICS)


def build(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int, test: str,
    fabric: tuple[str, float, float, float],
) -> BuiltScene:  # fmt: skip
    """Build the scene; no assets are needed."""
    from benchmarks.fabrics.disc import Disc, disc
    from benchmarks.fabrics.strip import Strip, cantilever
    from reference_sim.energies.bend_hinge import BendHinge
    from reference_sim.energies.gravity import Gravity
    from reference_sim.energies.stretch_stvk import StretchStVK

    specimen: Strip | Disc
    if test == "cantilever":
        specimen = cantilever(Fabric(*fabric), COLUMNS * sheet_cells)
    else:
        specimen = disc(Fabric(*fabric), sheet_cells // RINGS)
    cloth = specimen.cloth
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=1.0 / 30.0,
        frames=sheet_frames,
        settle=lambda: specimen.start,
        specimen=specimen,
    )
