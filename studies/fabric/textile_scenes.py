"""Scenes and metrics of textile tests: a strip and a disc of each fabric, and what is read off them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks import BuiltScene, Metric, RollOut, Scene
from fabrics import FABRICS, Fabric, users_fabrics
from reference_sim.energies import BendHinge, Gravity, StretchStVK
from specimens import BENDING_LENGTH, DRAPE, Cantilever, Disc, cantilever, disc

RINGS = 2  # cells of a sheet of these sizes that make a ring of the disc
COLUMNS = 2  # cells of the strip that make one of such a sheet
ERROR = "fabric/error"

SCENES = tuple(
    Scene(
        name=f"fabric/{test}/{fabric.name}",
        description=f"{title}: {1e3 * fabric.density:.0f} g/m2, "
        f"bending length {1e3 * fabric.bending_length:.1f} mm",
        sizes=("sheet_cells", "sheet_frames"),
        options={"test": test, "fabric": (fabric.name, fabric.density, fabric.warp, fabric.weft)},
        metrics=("energy", "cost"),
    )
    for test, title in (
        ("cantilever", "a strip that overhangs by twice its bending length"),
        ("drape", "a disc of 30 cm on a plate of 18 cm"),
    )
    for fabric in (*FABRICS, *users_fabrics())
)

METRICS = (
    Metric(
        name=BENDING_LENGTH, unit="mm", title="Bending length", table="fabric",
        definition="bending length of the elastica whose chord has the strip's angle, at the last frame",
    ),
    Metric(
        name=DRAPE, unit="%", title="Drape coefficient", table="fabric",
        definition="shadow less the plate, over the specimen less the plate (areas), at the last frame",
    ),
    Metric(
        name=ERROR, unit="%", title="Error of the test", table="fabric", lower_is_better=True,
        definition="of a bending length: its distance from (rigidity / weight)^(1/3), over that; of a "
        "drape coefficient: its difference from the reference's, in points",
    ),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class TextileScene(BuiltScene):
    """Built scene with the specimen, which measures itself."""

    tested: Cantilever | Disc


def build(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int, test: str,
    fabric: tuple[str, float, float, float],
) -> TextileScene:  # fmt: skip
    """Build the scene; no assets are needed."""
    tested: Cantilever | Disc
    if test == "cantilever":
        tested = cantilever(Fabric(*fabric), COLUMNS * sheet_cells)
    else:
        tested = disc(Fabric(*fabric), sheet_cells // RINGS)
    cloth = tested.cloth
    return TextileScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)),
        dt=1.0 / 30.0,
        frames=sheet_frames,
        settle=lambda: tested.start,
        tested=tested,
    )


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return what the specimen reads off the last frame, and its error where the exact answer is known."""
    scene, last = roll_out.scene, _last(roll_out)
    if not isinstance(scene, TextileScene) or last is None:
        return {}
    error = scene.tested.error(last)
    return scene.tested.measure(last) | ({} if error is None else {ERROR: error})


def compare(roll_out: RollOut, reference: RollOut) -> dict[str, float]:
    """Return the error to the reference, where no exact answer is known."""
    scene, last, rest = roll_out.scene, _last(roll_out), _last(reference)
    if not isinstance(scene, TextileScene) or last is None or rest is None:
        return {}
    if scene.tested.error(last) is not None:
        return {}
    values, expected = scene.tested.measure(last), scene.tested.measure(rest)
    return {ERROR: max(abs(values[name] - expected[name]) for name in values)}


def _last(roll_out: RollOut) -> np.ndarray | None:
    """Return the last frame (V, 3) [m]; None where the roll-out ended before it."""
    whole = len(roll_out.positions) == roll_out.scene.frames
    return roll_out.positions[-1] if whole else None
