"""Scenes: the visible tuples of declarations. Nothing is imported until a scene is built.

>>> [scene.name for scene in SCENES][:2]
['hanging_sheet', 'sheet_on_sphere']
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from random import Random
from typing import Any

from benchmarks.declarations import DeclarationError, by_name
from benchmarks.presets import PRESETS, Dependence
from benchmarks.scene import Scene


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

# Scenes besides the test motions leave costs out: nothing is timed there, and several run side by side.
# Made by code, without a role; walks of recordings train: what breaks here breaks next to them.
WALK = "walk"
ORDINARY = "out_of_distribution/ordinary"


def _scene(name: str, description: str, change: str, **options: Any) -> Scene:
    fitted = "betas" in options  # to a body of another shape: a start of its own
    name = f"out_of_distribution/{name}"
    return Scene(
        name=name,
        description=description,
        module="benchmarks.scenes.hard_motions:build_hard_motion",
        sizes=("settle_frames",),
        options={"change": change, **options},
        garment="tshirt",
        motion=WALK,
        part="whole",
        metrics=("extrapolation",),
        start_of="" if fitted or name == ORDINARY else ORDINARY,
        counterpart="" if name == ORDINARY else ORDINARY,
    )


def _shapes(place: int, word: str, plus: str, minus: str) -> tuple[Scene, ...]:
    """Declare shape coefficient `place` at +5 and at -5."""
    return tuple(
        _scene(f"{word}_{beta:+.0f}", f"shape coefficient {place} at {beta:+.0f}: {title}; the shirt's rest "
               "shape stays", "from_t_pose", betas=(*(0.0,) * place, beta))
        for beta, title in ((5.0, plus), (-5.0, minus))
    )  # fmt: skip


_SPLITS = {"left_hip": (0.0, 0.0, 80.0), "right_hip": (0.0, 0.0, -80.0)}
_CROSSED = {"left_shoulder": (0.0, -115.0, 0.0), "right_shoulder": (0.0, 115.0, 0.0)}

OUT_OF_DISTRIBUTION = (
    _scene("ordinary", "the walk as it is: what the others are compared with", "ordinary"),
    _scene("walk_x4", "the walk four times faster", "faster", times=4),
    _scene("run_x4", "a run four times faster", "another_faster", times=4, other="run"),
    _scene("jumping_jack_x4", "jumping jacks four times faster", "another_faster", times=4,
           other="jumping_jack"),
    _scene("splits", "both legs out to the sides by 80 degrees", "posed", degrees=_SPLITS),
    _scene("arms_crossed", "both arms stretched forward and across each other", "posed", degrees=_CROSSED),
    *_shapes(0, "height", "2.2 m tall", "1.2 m tall"),
    *_shapes(1, "girth", "stout", "thin"),
    _scene("root_glitch", "the whole body one metre aside for a single frame", "root_jumps"),
    _scene("limb_glitch", "the left arm turned by 180 degrees for a single frame", "limb_flips"),
    _scene("membrane_x10", "cloth ten times as stiff in its plane as the one trained on", "ordinary",
           material={"young_modulus": 10.0}),
    _scene("bending_x100", "hinges a hundred times as stiff as those trained on", "ordinary",
           material={"bending_stiffness": 100.0}),
    Scene(
        name="out_of_distribution/long",
        description="the walk in a loop without a reset; networks alone",
        module="benchmarks.scenes.hard_motions:build_long_motion",
        sizes=("loop_frames",),
        garment="tshirt",
        motion=WALK,
        part="loop",
        networks_only=True,
        metrics=("extrapolation", "roll_out"),
        counterpart=ORDINARY,
    ),
)  # fmt: skip


SHAPES, SHAPE_SEED = 12, 2022  # of body shapes that no training has drawn


def shapes(motion: str, garment: str = "tshirt") -> list[Scene]:
    """Declare the liveliest part of a motion on the mean body and on SHAPES bodies drawn as in training.

    The garment's rest state stays that of the mean body, in training, simulation and metrics alike.
    """
    random = Random(SHAPE_SEED)
    drawn = {
        str(place): tuple(random.uniform(-3, 3) for _ in range(10)) for place in range(1, SHAPES + 1)
    }
    return [
        replace(
            GarmentScenes(garment, "").scene(motion, "clip"),
            name=f"shapes/{name}",
            description=f"{motion} (its liveliest part) on "
            + (f"body shape {name} of {SHAPES} unseen ones" if betas else "the mean body"),
            options={"betas": betas},
            metrics=("energy", "geometry", "body_shape"),
        )
        for name, betas in {"mean": (), **drawn}.items()
    ]


FRAME_RATE = 30


def meshes_and_steps(sizes: Dependence) -> list[Scene]:
    """Declare the T-shirt on several meshes at one step a frame, and on the middle one at several."""
    meshes = [
        _dependence(f"mesh/{count}", f"the walk by a T-shirt of about {count} vertices", vertices=count)
        for count in sizes.meshes
    ]
    steps = [
        _dependence(f"dt/{FRAME_RATE * count}", f"the same at {FRAME_RATE * count} steps a second",
                    substeps=count)
        for count in sizes.substeps if count > 1
    ]  # fmt: skip
    return [*meshes, *steps]


def _dependence(name: str, description: str, **options: int) -> Scene:
    return Scene(
        name=f"dependence/{name}",
        description=description,
        module="benchmarks.scenes.dressed_body:build_dependence",
        sizes=("dependence",),
        options=options,
        garment="tshirt",
        motion=WALK,
        part="start",
        own_garment=True,
        metrics=("energy", "curvature", "geometry", "mesh"),
    )


def declare_return(motion: str, garment: str = "tshirt") -> Scene:
    """Declare a motion forwards and backwards for a thousand frames."""
    return Scene(
        name=f"{garment}/there_and_back",
        description=f"{motion} forwards and backwards for a thousand frames; networks alone",
        module="benchmarks.scenes.hard_motions:build_long_motion",
        garment=garment,
        motion=motion,
        part="loop",
        networks_only=True,
        metrics=("roll_out",),
    )


FURTHER_SCENES = (
    *OUT_OF_DISTRIBUTION,
    *{scene.name: scene for preset in PRESETS for scene in meshes_and_steps(preset.dependence)}.values(),
)


def find_scene(name: str, garment: str = "tshirt") -> Scene:
    """Return the scene of that name, of those that depend on no motion of the run. Raises KeyError.

    >>> find_scene("hanging_sheet").obstacle
    False
    """
    return by_name("scene", (*SCENES, *dress_scenes(garment)))[name]


def dress_scenes(garment: str) -> tuple[Scene, ...]:
    """Return FURTHER_SCENES with that garment on the body, but for those that tailor another."""
    scenes = (s for s in FURTHER_SCENES if not s.own_garment or s.garment == garment)
    return tuple(replace(scene, garment=garment) for scene in scenes)


@dataclass(frozen=True)
class GarmentScenes:
    """Scenes of a garment of snug.garments: named "<garment>/<motion>" and "<garment>/<motion>@clip".

    dynamic: whether its motions are those that stop within a frame, instead of the run's own.
    self_contact: whether the cloth of simulations does not cross itself.
    """

    garment: str
    title: str
    dynamic: bool = False
    self_contact: bool = False

    def scene(self, motion: str, part: str = "whole") -> Scene:
        """Return the scene of a body in this garment doing that motion, or its liveliest part."""
        note = " (its liveliest part)" if part == "clip" else ""
        return Scene(
            name=f"{self.garment}/{motion}" + ("@clip" if part == "clip" else ""),
            description=f"a body in {self.title}: {motion}{note}",
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


def find_garment(garment: str, garments: tuple[GarmentScenes, ...] = GARMENT_SCENES) -> GarmentScenes:
    """Return the scenes of that garment. Raises DeclarationError."""
    index = {scenes.garment: scenes for scenes in garments}
    if garment not in index:
        raise DeclarationError(f"no garment is called '{garment}'; there are {', '.join(index)}")
    return index[garment]


def all_scenes(
    motions: Iterable[str],
    dynamic_motions: Iterable[str],
    garments: tuple[GarmentScenes, ...] = GARMENT_SCENES,
) -> dict[str, Scene]:
    """Return every scene by name: those without a body, then dressed bodies in each motion and in its clip.

    motions: those of the T-shirt, which can do the others too; dynamic_motions: those of garments that
    swing.
    garments: the first is in place of the T-shirt.
    """
    motions, dynamic = list(motions), list(dynamic_motions)
    first = garments[0].garment
    varied = [
        s for motion in motions[:1] for s in (declare_return(motion, first), *shapes(motion, first))
    ]
    every = list(dict.fromkeys((*motions, *dynamic)))
    dressed = [
        scenes.scene(motion, part)
        for scenes in garments
        for motion in (dynamic if scenes.dynamic else every)
        for part in ("whole", "clip")
    ]
    return by_name("scene", (*SCENES, *dressed, *varied, *dress_scenes(first)))
