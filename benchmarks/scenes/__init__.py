"""The visible tuple of scenes: one line each. Nothing is imported until a scene is built."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ..results import CLIP
from ..scene import Scene

SMALL_SCENES = (
    Scene(
        name="hanging_sheet",
        description="a square sheet pinned at two corners, let go from the horizontal; no obstacle",
        module="benchmarks.scenes.hanging_sheet",
    ),
    Scene(
        name="sheet_on_sphere",
        description="a square sheet dropped onto a resting sphere; contact without a body",
        module="benchmarks.scenes.sheet_on_sphere",
        obstacle=True,
    ),
    Scene(
        name="flag",
        description="a flag whose pole is swung to and fro; handles that move, no obstacle",
        module="benchmarks.scenes.flag",
    ),
    Scene(
        name="twisted_strip",
        description="a strip whose two ends turn against each other, one turn in all; no obstacle",
        module="benchmarks.scenes.twisted_strip",
    ),
    Scene(
        name="free_fall",
        description="a thrown sheet with no pins and its weight alone; the exact answer is known",
        module="benchmarks.scenes.free_fall",
    ),
)


@dataclass(frozen=True)
class Wear:
    """A garment of snug.garments.GARMENT_TEMPLATES, and the name that its scenes have before the motion's.

    swings: whether its motions are those that stop within a frame, instead of the run's own.
    """

    prefix: str
    garment: str
    words: str
    swings: bool = False


TSHIRT = "tshirt"
WORN = (
    Wear("dressed/", TSHIRT, "a T-shirt"),
    Wear("tunic/", "tunic", "a flared tunic", swings=True),
    Wear("skirt/", "skirt", "a flared skirt", swings=True),
)


def worn_in(scene: str) -> Wear:
    """What a body wears in the scene of that name. Raises KeyError for a scene without one."""
    return {wear.prefix: wear for wear in WORN}[scene.partition("/")[0] + "/"]


def motion_of(scene: str) -> str:
    """The motion, whole, of the dressed scene of that name."""
    return scene.partition("/")[2].removesuffix(CLIP)


def dressed_scene(motion: str, garment: str = TSHIRT) -> Scene:
    """The scene of a body in that garment doing the motion of that name."""
    wear = next(wear for wear in WORN if wear.garment == garment)
    return Scene(
        name=wear.prefix + motion,
        description=f"a body in {wear.words}: {motion}",
        module="benchmarks.scenes.dressed_body",
        garment=garment,
    )


def all_scenes(motions: Iterable[str], swings: Iterable[str]) -> dict[str, Scene]:
    """Every scene by name: the small ones, then dressed bodies in each test motion and in its clip.

    motions: those of the T-shirt, which can do the others too; swings: those of garments that swing.
    """
    swings = list(swings)
    chosen = {False: [*motions, *swings], True: swings}
    dressed = [
        dressed_scene(name, wear.garment)
        for wear in WORN
        for motion in chosen[wear.swings]
        for name in (motion, motion + CLIP)
    ]
    return {scene.name: scene for scene in (*SMALL_SCENES, *dressed)}
