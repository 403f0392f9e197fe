"""Scene of the mesh and time-step study: the T-shirt of a given size, at a given time step.

How much of every headline number is the mesh's or the time step's: numbers of two meshes are two definitions
of the energy, of contact and of curvature, so they are reported and never judged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from benchmarks.scene import BuiltScene, Scene
from benchmarks.scenes import dressed_body
from snug.garments.templates import find_template
from snug.motion.library import make_motion

if TYPE_CHECKING:
    from benchmarks.assets import Assets
    from benchmarks.presets import Dependence

WARM_UP = 2  # it starts at rest, and few frames are simulated


def build(
    scene: Scene, assets: Assets, *, dependence: Dependence, vertices: int = 0, substeps: int = 1
) -> BuiltScene:
    """Build the scene; `vertices` of the garment, by default the middle mesh, and `substeps` of a frame."""
    garment = find_template(scene.garment).tailor(assets.body, vertices=vertices or dependence.middle)
    motion = make_motion(scene.motion).cut(0, dependence.frames)
    tailored = replace(assets, garments={scene.garment: garment}, motions={scene.motion: motion})
    built = dressed_body.build(
        scene, tailored, settle_frames=dependence.settle_frames, warm_up_frames=WARM_UP
    )
    return replace(built, substeps=substeps)
