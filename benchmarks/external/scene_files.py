"""Files of a scene for export and for programs: cloth, obstacle, motion and facts."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.external.other_methods import write_for
from reference_sim.files.atomic_files import new_folder
from reference_sim.material import GRAVITY
from reference_sim.trajectory import write_obj

if TYPE_CHECKING:
    from benchmarks.method import Method
    from benchmarks.scene import BuiltScene, Dressed, Scene

README = """\
Scene {scene}, sizes {preset}: {description}.

Units: metres, kilograms, seconds, radians, joules. World coordinates, right-handed, y up; a body
faces +z in its rest pose. Gravity is 9.81 m/s^2 along -y.
Order of vertices: that of rest.obj, the same in every file. Triangles wind outwards.
Time: {frames} frames at {rate} a second (dt {dt:.6g} s); frame 0 is the start:
start_positions and start_velocities. The first {warm_up_frames} frames are simulated and not judged.
All numbers are float64 with all digits.

Files, as far as the scene has what they hold:
  scene.json         step, material, terms of the energy with their constants
  rest.obj           rest mesh, with its UV
  cloth.npz          rest_positions, start_positions, start_velocities (V,3), faces (F,3), masses (V,)
                     [kg], pins (P,), pin_positions (T,P,3); rest_uv [m], the flat rest state; kept (T,),
                     the frames of the motion that a roll-out holds
  energies.npz       elements of each energy term: vertices, stiffness, rest state; formulas in
                     docs/method.md
  obstacle.npz       positions (T,B,3) of what the cloth touches, one frame where it stands still, faces;
                     rest_positions (B,3), the unposed body that the garment was made for
  motion_smpl.npz    poses (T,72) [rad], trans (T,3), betas, fps: SMPL's 24 joints, y up. Of a part of a
                     motion poses_before, trans_before, the frames until then: the start has the
                     velocities with which a simulation of them ends
  skinning.npz       weights (V,24) of the garment, smoothed_weights as method 'skinning' takes them,
                     rest_positions (V,3) on this body, joints (24,3), parents (24,), transforms
                     (T,24,3,4) of the joints, loops
  reference.vtkhdf, .npz   the simulation of the scene

With a body:
A vertex p at rest goes to sum_j w_j (R_j p + t_j), (R_j, t_j) = transforms. The motion is
placed on the floor with its arms clear of the torso: --motions would place it anew.
The zero of gravity's energy in a frame is origin_heights of scene.json, the height of the pelvis.
Contact: a sample of the cloth touches only faces of the body near its own place at rest:
those whose centroid at rest lies within {contact_region_m} m of the sample's.

Write positions (T,V,3) of all frames, the start included, as mine.npz:
  numpy.savez('mine.npz', positions=positions, fps={rate})
and have them scored, with the --set, --garment, --body and --motions of the export:
  python -m benchmarks.score mine.npz --scene {scene}
quasi_static=(T,V,3), the answer to each pose held still, adds the method's own dynamics.
"""


def write_scene_files(part: Path, scene: BuiltScene, facts: dict[str, Any]) -> None:
    """Write arrays, meshes and scene.json, the facts, into a folder, as README says."""
    cloth, obstacle, dressed = scene.cloth, scene.obstacle, scene.dressed
    write_obj(part / "rest.obj", cloth.rest_positions, cloth.faces, cloth.rest_uv)
    pinned = scene.pin_positions
    _write_arrays(
        part / "cloth.npz", rest_positions=cloth.rest_positions, faces=cloth.faces, masses=cloth.masses,
        start_positions=scene.start, start_velocities=scene.start_velocity, rest_uv=cloth.rest_uv,
        pins=np.asarray(cloth.pins, dtype=np.int64), kept=scene.kept,
        pin_positions=None if pinned is None else np.stack([pinned(frame) for frame in range(scene.frames)]),
    )  # fmt: skip
    arrays: dict[str, Any] = {
        f"{term.name}_{name}": value for term in scene.energies for name, value in term.arrays().items()
    }
    _write_arrays(part / "energies.npz", **arrays)
    if obstacle is not None:
        _write_arrays(
            part / "obstacle.npz", positions=obstacle.positions, faces=obstacle.faces, fps=1.0 / scene.dt,
            rest_positions=None if dressed is None else dressed.body.rest_vertices(),
        )  # fmt: skip
    if dressed is not None:
        write_motion(part, dressed)
    (part / "scene.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")


def _write_arrays(path: Path, **arrays: Any) -> None:
    """Write an npz of the arrays that there are."""
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})


def write_motion(part: Path, dressed: Dressed) -> None:
    """Write the poses, and the skinning of the garment."""
    from snug.networks.dressed_body import DressedBody
    from snug.recipe import DEFAULT

    body, motion, garment, before = dressed.body, dressed.motion, dressed.garment, dressed.before
    joints, frames = body.joints(dressed.betas), motion.frames
    betas = np.zeros(body.shape_count) if dressed.betas is None else np.asarray(dressed.betas)
    _write_arrays(
        part / "motion_smpl.npz", poses=motion.poses.reshape(frames, -1), trans=motion.translations,
        betas=betas, fps=motion.fps,
        poses_before=None if before is None else before.poses.reshape(before.frames, -1),
        trans_before=None if before is None else before.translations,
    )  # fmt: skip
    smoothed = DressedBody(body, garment).weights(DEFAULT.smoothing).double().numpy()
    _write_arrays(
        part / "skinning.npz", weights=garment.skinning_weights, smoothed_weights=smoothed,
        rest_positions=garment.rest_for(body, dressed.betas), joints=joints, parents=body.parents,
        transforms=body.transforms(motion.poses, motion.translations, dressed.betas),
        **{f"loop_{name}": loop for name, loop in garment.loops.items()},
    )  # fmt: skip


def facts_of(scene: BuiltScene) -> dict[str, Any]:
    """Return sizes, step, material, and terms with constants of the scene, in SI units."""
    material = scene.cloth.material
    return {
        "scene": scene.name,
        "frames": scene.frames,
        "dt": scene.dt,
        "fps": 1.0 / scene.dt,
        "substeps": scene.substeps,
        "warm_up_frames": scene.warm_up,
        "vertices": scene.cloth.vertex_count,
        "gravity": [0.0, -GRAVITY, 0.0],
        "material": asdict(material)
        | {"lame_lambda_N_per_m": material.lame_lambda, "lame_mu_N_per_m": material.lame_mu},
        "energies": {term.name: term.parameters() for term in scene.energies},
        "contact_region_m": None if scene.obstacle is None else scene.obstacle.region,
        "origin_heights": None if scene.origin_heights is None else scene.origin_heights.tolist(),
    }


def write_scene(
    folder: Path, declared: Scene, scene: BuiltScene, *, preset: str, simulation: Method | None,
    reader: str = "",
) -> None:  # fmt: skip
    """Write a scene, as declared and as built by a preset, into a new or empty folder.

    So is the trajectory of `simulation`, and what the method `reader` reads, in a folder of its name.

    Raises:
        ValueError: where a reader's scene has no body.
        RuntimeError: the garment does not settle, or the simulation ends early.
    """
    with new_folder(folder) as part:
        facts = facts_of(scene) | {
            "description": declared.description, "preset": preset, "garment": declared.garment,
            "motion": declared.motion, "part": declared.part,
        }  # fmt: skip
        write_scene_files(part, scene, facts)
        if reader:
            write_for(reader, part / reader, scene)
        if simulation is not None:
            simulation.prepare(scene)
            trajectory = simulation.run()
            if trajectory.frames < scene.frames or trajectory.status == "diverged":
                raise RuntimeError(f"{scene.name}: {trajectory.status}: {trajectory.reason}")
            trajectory.save(part / "reference.vtkhdf")
            positions, faces = trajectory.positions, trajectory.faces
            np.savez(part / "reference.npz", positions=positions, faces=faces, fps=1.0 / scene.dt)
        rate = np.format_float_positional(facts["fps"], trim="-")  # all digits: a roll-out is held to it
        (part / "README.txt").write_text(README.format(rate=rate, **facts), encoding="utf-8")
