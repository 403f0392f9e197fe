"""The case that matters: a T-shirt on a moving body."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from reference_sim import Trajectory, simulate

from ..metrics.geometry import penetration
from ..parts import Row
from ..presets import find_preset
from ..scene import BuiltScene
from ..wardrobe import Wardrobe, embedded_motions, open_wardrobe

CASES = ("walk, 1000", "run, 1000", "jump, 1000", "walk, 4400")
FRAMES = 60


def dressed(case: str) -> BuiltScene:
    """The scene of "motion, vertices", cut to FRAMES frames."""
    from ..scenes.dressed_body import build

    motion, vertices = case.split(", ")
    preset = dataclasses.replace(find_preset("quick"), garment_vertices=int(vertices), frames=FRAMES)
    wardrobe: Wardrobe = open_wardrobe(preset, embedded_motions([motion]))
    return build(f"dressed/{motion}", preset, wardrobe)


def walk(
    scene: BuiltScene, *, frames: int | None = None, start: np.ndarray | None = None, **options: Any
) -> Trajectory:
    """Simulate a dressed scene, from its settled start or another one (V, 3) [m]."""
    return simulate(
        scene.cloth,
        scene.energies,
        dt=scene.dt,
        frames=frames or scene.frames,
        obstacle=scene.obstacle,
        start=scene.start if start is None else start,
        **options,
    )


def measure(case: str, repeats: int) -> list[Row]:
    """Median and worst frame, convergence, depth under the skin, and where the hem ends up."""
    scene = dressed(case)
    assert scene.obstacle is not None
    walk(scene, frames=2)  # compiles
    medians, worst = [], []
    for _ in range(repeats if scene.cloth.vertex_count < 2000 else min(repeats, 3)):
        trajectory = walk(scene)
        medians.append(np.median(trajectory.frame_seconds[1:]))
        worst.append(trajectory.frame_seconds.max())
    fields = trajectory.frame_fields
    depth = penetration([trajectory.positions], scene.obstacle)[0].depth
    return [
        ("frame, median", 1e3 * float(np.median(medians)), "ms"),
        ("frame, worst", 1e3 * float(np.median(worst)), "ms"),
        ("iterations, median", float(np.median(fields["iterations"][1:])), ""),
        ("iterations, worst", float(fields["iterations"].max()), ""),
        ("converged frames", f"{int(fields['converged'].sum())} of {trajectory.frames}", ""),
        ("vertices below the skin", 100 * float((depth > 0).mean()), "%"),
        ("vertices deeper than 5 mm", 100 * float((depth > 5e-3).mean()), "%"),
        ("depth, 99.9th percentile", 1e3 * float(np.quantile(depth, 0.999)), "mm"),
    ]
