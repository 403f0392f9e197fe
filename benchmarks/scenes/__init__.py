"""Scenes: the visible tuples of declarations. Nothing is imported until a scene is built.

| module | scenes |
| --- | --- |
| sheets | small ones without a body, in SCENES |
| dressed_body | "<garment>/<motion>": a body in a garment, by GARMENT_SCENES |
| variations | declarations of FURTHER_SCENES: out of distribution, very long, other meshes and steps |
| hard_motions | out of distribution, very long |
| from_roll_out | the scene that a stored roll-out brings itself |

>>> [scene.name for scene in SCENES][:2]
['hanging_sheet', 'sheet_on_sphere']
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from benchmarks.declarations import DeclarationError, by_name
from benchmarks.presets import PRESETS
from benchmarks.scene import Scene
from benchmarks.scenes.variations import OUT_OF_DISTRIBUTION, meshes_and_steps, shapes, there_and_back


def _sheet(name: str, description: str, *, obstacle: bool = False) -> Scene:
    module, sizes = f"benchmarks.scenes.sheets:build_{name}", ("sheet_cells", "sheet_frames")
    return Scene(name=name, description=description, module=module, sizes=sizes, obstacle=obstacle)


SCENES = (
    _sheet("hanging_sheet", "a square sheet pinned at two corners, let go from the horizontal; no obstacle"),
    _sheet("sheet_on_sphere", "a square sheet dropped onto a resting sphere; contact without a body",
           obstacle=True),
    _sheet("flag", "a flag whose pole is swung to and fro; handles that move, no obstacle"),
    _sheet("free_fall", "a thrown sheet with no pins and its weight alone; the exact answer is known"),
)  # fmt: skip
FURTHER_SCENES = (
    *OUT_OF_DISTRIBUTION,
    *{scene.name: scene for preset in PRESETS for scene in meshes_and_steps(preset.dependence)}.values(),
)


def find_scene(name: str, garment: str = "tshirt") -> Scene:
    """Return the scene of that name, of those that depend on no motion of the run. Raises KeyError.

    >>> find_scene("hanging_sheet").obstacle
    False
    """
    return by_name("scene", (*SCENES, *further_scenes(garment)))[name]


def further_scenes(garment: str) -> tuple[Scene, ...]:
    """Return FURTHER_SCENES with that garment on the body.

    For another garment than the T-shirt those are left out that tailor one.
    """
    if garment == GARMENT_SCENES[0].garment:
        return FURTHER_SCENES
    kept = (scene for scene in FURTHER_SCENES if not scene.own_garment)
    return tuple(replace(scene, garment=garment) if scene.dressed else scene for scene in kept)


@dataclass(frozen=True)
class GarmentScenes:
    """Scenes of a garment of snug.garments: named "<garment>/<motion>" and "<garment>/<motion>@clip".

    dynamic: whether its motions are those that stop within a frame, instead of the run's own. self_contact:
    whether the cloth of simulations does not cross itself.
    """

    garment: str
    title: str
    dynamic: bool = False
    self_contact: bool = False

    def scene(self, motion: str, part: str = "whole") -> Scene:
        """Return the scene of a body in this garment doing that motion, or its liveliest part."""
        of = " (its liveliest part)" if part == "clip" else ""
        return Scene(
            name=f"{self.garment}/{motion}" + ("@clip" if part == "clip" else ""),
            description=f"a body in {self.title}: {motion}{of}",
            module="benchmarks.scenes.dressed_body:build_dressed_body",
            sizes=("settle_frames", "warm_up_frames"),
            garment=self.garment,
            motion=motion,
            part=part,
            self_contact=self.self_contact,
        )


GARMENT_SCENES = (
    GarmentScenes("tshirt", "a T-shirt"),
    GarmentScenes("tunic", "a flared tunic", dynamic=True),
    GarmentScenes("skirt", "a flared skirt", dynamic=True),
    GarmentScenes("tank_top", "a tank top"),
    GarmentScenes("long_sleeves", "a shirt with long sleeves"),
    GarmentScenes("trousers", "trousers"),
    GarmentScenes("shorts", "shorts"),
    GarmentScenes("dress", "a dress"),
)


def of_garment(garment: str, worn: tuple[GarmentScenes, ...] = GARMENT_SCENES) -> GarmentScenes:
    """Return the scenes of that garment. Raises DeclarationError."""
    known = {scenes.garment: scenes for scenes in worn}
    if garment not in known:
        raise DeclarationError(f"no garment is called '{garment}'; there are {', '.join(known)}")
    return known[garment]


def all_scenes(
    motions: Iterable[str], dynamic_motions: Iterable[str], worn: tuple[GarmentScenes, ...] = GARMENT_SCENES
) -> dict[str, Scene]:
    """Return every scene by name: those without a body, then dressed bodies in each motion and in its clip.

    motions: those of the T-shirt, which can do the others too; dynamic_motions: those of garments that swing.
    worn: the garments, the first in place of the T-shirt.
    """
    motions, dynamic = list(motions), list(dynamic_motions)
    first = worn[0].garment
    varied = [s for motion in motions[:1] for s in (there_and_back(motion, first), *shapes(motion, first))]
    every = list(dict.fromkeys((*motions, *dynamic)))
    dressed = [
        scenes.scene(motion, part)
        for scenes in worn
        for motion in (dynamic if scenes.dynamic else every)
        for part in ("whole", "clip")
    ]
    return by_name("scene", (*SCENES, *dressed, *varied, *further_scenes(first)))
