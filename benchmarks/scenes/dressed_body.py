"""Scene of a body in a garment, doing one motion. The simulator sees the body as a moving mesh.

Before the motion starts the garment settles: the body, already facing and standing as in the first frame,
moves its limbs from the T-pose into the first pose, then holds still for a while. A part of a motion
begins with the positions and velocities that a simulation from the motion's own first frame has there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.assets import Assets
from benchmarks.scene import BuiltScene, Dressed, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.energy import Energy
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.obstacle import Obstacle
from reference_sim.time_loop import simulate
from reference_sim.trajectory import Trajectory
from snug.garments.garment import piece_of_faces
from snug.garments.templates import find_template
from snug.motion.library import make_motion
from snug.motion.motion import transition

if TYPE_CHECKING:
    from benchmarks.presets import Dependence
    from snug.body.parametric_body import Body

# A piece has fallen off whose vertices are all as far from where the body carries them.
FALLEN = 0.3  # [m]
# Frames of stillness after the limbs have arrived, as a share of those of the approach.
HOLD = 0.5
DISTANCE, STIFFNESS = 1e-3, 100.0  # of self-contact: [m], two thicknesses of the cloth; [Pa]
SHORT = 0.25  # share of a motion's frames that is left out at most


def build_dressed_body(
    scene: Scene,
    assets: Assets,
    *,
    settle_frames: int,
    warm_up_frames: int,
    betas: tuple[float, ...] = (),
) -> BuiltScene:
    """Build the scene of a garment and a motion, or of the clip of it.

    warm_up_frames: at the beginning, not judged; fewer where the motion is short. betas: see shape_of,
    which says what is raised.
    """
    body, garment = assets.body, assets.garments[scene.garment]
    motion = assets.motion(scene.motion, scene.part)
    before = assets.cut_before(scene.motion, scene.part)
    dressed = Dressed(body, garment, motion, shape_of(body, betas, scene.name), before)

    def settle() -> np.ndarray:
        if before is None:
            return drape(cloth, terms, dressed, settle_frames)
        start = drape(cloth, terms, replace(dressed, motion=before), settle_frames)
        way, aim = before.followed_by(motion.cut(0, 1)), "reach the first frame of the clip"
        x = _simulate(cloth, terms, replace(dressed, motion=way), start, aim)
        return np.stack([x[-1], (x[-1] - x[-2]) * way.fps])

    cloth = garment.cloth()
    energies = declare_energies(cloth)
    minimised = with_self_contact(energies) if scene.self_contact else ()
    terms = minimised or energies
    warm_up = max(2, min(warm_up_frames, int(SHORT * motion.frames)))
    return dress(
        scene, dressed, cloth=cloth, energies=energies, settle=settle, minimised=minimised,
        warm_up=warm_up,
    )  # fmt: skip


def dress(scene: Scene, dressed: Dressed, **fields: Any) -> BuiltScene:
    """Return the scene of a garment on a moving body, with further fields of BuiltScene."""
    return BuiltScene(
        name=scene.name, dressed=dressed, origin_heights=dressed.pelvis[:, 1], **_pose(dressed), **fields
    )


def _pose(dressed: Dressed) -> dict[str, Any]:
    """Return dt, frames, obstacle and pins of a motion, for a scene and for `simulate`."""
    body, garment, motion, betas = dressed.body, dressed.garment, dressed.motion, dressed.betas
    posed = body.vertices(motion.poses, motion.translations, betas)
    handles = garment.pin_positions(body, motion.poses, motion.translations, betas)
    return {
        "dt": 1.0 / motion.fps,
        "frames": motion.frames,
        # Which faces a vertex may touch is a matter of the body that the garment was made for.
        "obstacle": Obstacle(posed, body.faces, rest_positions=body.rest_vertices()),
        "pin_positions": handles.__getitem__ if len(garment.pins) else None,
    }


def shape_of(body: Body, betas: tuple[float, ...], scene: str) -> np.ndarray | None:
    """Return the shape (S,) whose first coefficients are `betas`, the others zero; None, the mean, for none.

    Raises ValueError for a body with fewer shapes.
    """
    if not betas:
        return None
    if body.shape_count < len(betas):
        raise ValueError(f"the body has {body.shape_count} shapes, {scene} needs {len(betas)}")
    return np.pad(betas, (0, body.shape_count - len(betas)))


def declare_energies(cloth: Cloth) -> tuple[Energy, ...]:
    """Return the paper's terms of a garment; inertia comes with the time step."""
    return (StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactPenalty(cloth))


def with_self_contact(energies: tuple[Energy, ...]) -> tuple[Energy, ...]:
    """Return the terms and the barrier of their cloth against itself, a term of the simulation alone.

    Raises:
        ImportError: ipctk is not installed.
        ValueError: a triangle of the mesh is less than DISTANCE high; the message names it.
    """
    from reference_sim.energies.contact_barrier import ContactBarrier

    return (*energies, ContactBarrier(energies[0].cloth, distance=DISTANCE, stiffness=STIFFNESS))


def drape(cloth: Cloth, energies: tuple[Energy, ...], dressed: Dressed, frames: int) -> np.ndarray:
    """Simulate the cloth to rest on the body in the motion's first pose: positions (V,3) [m].

    Raises RuntimeError when the simulation of the approach did not stay finite, or a piece of the garment
    fell off, and ValueError for a garment that crosses itself where it may not.
    """
    body, garment, motion, betas = dressed.body, dressed.garment, dressed.motion, dressed.betas
    first = motion.poses[0]
    t_pose = np.zeros_like(first)
    t_pose[0] = first[0]
    approach = transition(t_pose, first, frames)
    poses = np.concatenate([approach, np.repeat(first[None], int(HOLD * frames), axis=0)])
    translations = np.repeat(motion.translations[:1], len(poses), axis=0)
    # The garment, unposed on that body, goes where the root takes a body in T-pose: a rigid motion.
    root = body.transforms(t_pose[None], translations[:1], betas)[0, 0]
    start = garment.rest_for(body, betas) @ root[:, :3].T + root[:, 3]
    way = replace(dressed, motion=replace(motion, poses=poses, translations=translations))
    x = _simulate(cloth, energies, way, start, "come to rest in the first pose")[-1]
    pinned_garment = replace(garment, pins=np.arange(len(x)))
    carried = pinned_garment.pin_positions(body, first[None], translations[:1], betas)[0]
    off = np.linalg.norm(x - carried, axis=1)
    pieces = piece_of_faces(cloth.faces)
    gap = max(off[cloth.faces[pieces == piece]].min() for piece in range(pieces.max() + 1))
    if gap > FALLEN:
        raise RuntimeError(
            f"garment {garment.name} fell off while it settled for {motion.name}: a piece ended "
            f"{gap:.1f} m from its place; shoulders or a waistband hold a piece"
        )
    return x


def _simulate(
    cloth: Cloth, energies: tuple[Energy, ...], dressed: Dressed, start: np.ndarray, aim: str
) -> np.ndarray:
    """Simulate every frame of the motion, (T,V,3) [m]. Raises RuntimeError naming the missed `aim`."""
    motion = dressed.motion
    trajectory: Trajectory = simulate(cloth, energies, start=start, **_pose(dressed))
    # A step that diverges ends a simulation: a garment is left half-way, on a body that moved on.
    if trajectory.frames < motion.frames:
        raise RuntimeError(
            f"the garment did not {aim} of {motion.name}: {trajectory.reason}; the pose may leave it no room"
        )
    return trajectory.positions


WARM_UP = 2  # it starts at rest, and few frames are simulated


def build_dependence(
    scene: Scene, assets: Assets, *, dependence: Dependence, vertices: int = 0, substeps: int = 1
) -> BuiltScene:
    """Build the scene with so many `vertices`, by default those of the middle mesh, and `substeps` a frame.

    Numbers of two meshes are reported and never judged.
    """
    garment = find_template(scene.garment).tailor(assets.body, vertices=vertices or dependence.middle)
    motion = make_motion(scene.motion).cut(0, dependence.frames)
    tailored = replace(assets, garments={scene.garment: garment}, motions={scene.motion: motion})
    built = build_dressed_body(
        scene, tailored, settle_frames=dependence.settle_frames, warm_up_frames=WARM_UP
    )
    return replace(built, substeps=substeps)
