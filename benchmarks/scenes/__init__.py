"""The visible tuple of scenes: one line each. Nothing is imported until a scene is built."""

from __future__ import annotations

from collections.abc import Iterable

from ..clips import SUFFIX
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

PREFIX = "dressed/"


def dressed_scene(motion: str) -> Scene:
    """The scene of a body in a T-shirt doing the motion of that name."""
    return Scene(
        name=PREFIX + motion,
        description=f"a body in a T-shirt: {motion}",
        module="benchmarks.scenes.dressed_body",
        dressed=True,
    )


def all_scenes(motions: Iterable[str]) -> dict[str, Scene]:
    """Every scene by name: the small ones, then a dressed body for each motion and for its clip."""
    dressed = [dressed_scene(name) for motion in motions for name in (motion, motion + SUFFIX)]
    return {scene.name: scene for scene in (*SMALL_SCENES, *dressed)}
