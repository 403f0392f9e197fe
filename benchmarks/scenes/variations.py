"""Declarations of scenes besides the test motions: out of distribution, very long, other meshes and steps.

Their metrics leave costs out, so nothing here is timed and several run side by side.
"""

from __future__ import annotations

from random import Random
from typing import Any

from benchmarks.presets import Dependence
from benchmarks.scene import Scene

WALK = "walk"  # made by code, without a role; walks of recordings train: what breaks here breaks next to them
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
    drawn = {str(place): tuple(random.uniform(-3, 3) for _ in range(10)) for place in range(1, SHAPES + 1)}
    return [
        Scene(
            name=f"shapes/{name}",
            description=f"{motion} (its liveliest part) on "
            + (f"body shape {name} of {SHAPES} unseen ones" if betas else "the mean body"),
            module="benchmarks.scenes.dressed_body:build_dressed_body",
            sizes=("settle_frames", "warm_up_frames"),
            options={"betas": betas},
            garment=garment,
            motion=motion,
            part="clip",
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


def there_and_back(motion: str, garment: str = "tshirt") -> Scene:
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
