"""Files of a scene: cloth, obstacle, motion and facts, for the export command and for external programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim import Trajectory
from reference_sim.files.atomic_files import new_folder
from reference_sim.material import GRAVITY
from reference_sim.trajectory import write_point_cache

if TYPE_CHECKING:
    from benchmarks.method import Method
    from benchmarks.scene import BuiltScene, Dressed, Scene

FINGERS = 30  # joints of SMPL-H's hands, which a garment never meets
# (x, y, z) with y up -> (x, -z, y) with z up.
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
FileList = list[tuple[str, str]]  # name of a file, its content


def write_scene_files(part: Path, scene: BuiltScene, facts: dict[str, Any]) -> FileList:
    """Write arrays, meshes and the facts, as scene.json; return what was written beside scene.json."""
    files = [*write_cloth(part, scene), *write_energies(part, scene), *write_obstacle(part, scene)]
    if scene.dressed is not None:
        files += write_motion(part, scene.dressed)
    (part / "scene.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    return files


def write_cloth(part: Path, scene: BuiltScene) -> FileList:
    """Write the rest mesh and all arrays of the cloth; return what was written."""
    cloth = scene.cloth
    write_obj(part / "rest.obj", cloth.rest_positions, cloth.faces, cloth.rest_uv)
    arrays: dict[str, Any] = {
        "rest_positions": cloth.rest_positions, "faces": cloth.faces, "masses": cloth.masses,
        "start_positions": scene.start, "start_velocities": scene.start_velocity,
        "pins": np.asarray(cloth.pins, dtype=np.int64),
    }  # fmt: skip
    content = (
        "rest_positions, start_positions, start_velocities (V,3), faces (F,3), masses (V,) [kg], pins (P,)"
    )
    if cloth.rest_uv is not None:
        arrays["rest_uv"] = cloth.rest_uv
        content += ", rest_uv [m], the flat rest state"
    if scene.pin_positions is not None:
        arrays["pin_positions"] = np.stack([scene.pin_positions(frame) for frame in range(scene.frames)])
        content += ", pin_positions (T,P,3)"
    if scene.kept is not None:
        arrays["kept"] = scene.kept
        content += ", kept (T,), the frames of the motion that a roll-out holds"
    np.savez(part / "cloth.npz", **arrays)
    return [("rest.obj", "rest mesh" + ", with its UV" * (cloth.rest_uv is not None)), ("cloth.npz", content)]


def write_energies(part: Path, scene: BuiltScene) -> FileList:
    """Write the elements of every energy term; return what was written."""
    arrays: dict[str, Any] = {
        f"{term.name}_{name}": value for term in scene.energies for name, value in term.arrays().items()
    }
    np.savez(part / "energies.npz", **arrays)
    content = "elements of each energy term: vertices, stiffness, rest state; formulas in docs/scene-files.md"
    return [("energies.npz", content)]


def write_obj(path: Path, positions: np.ndarray, faces: np.ndarray, uv: np.ndarray | None) -> None:
    """Write a mesh with all digits, so that reading gives the same numbers; UV of vertices or of corners."""
    lines = ["# metres, y up", *(f"v {x!r} {y!r} {z!r}" for x, y, z in positions.tolist())]
    places = faces + 1
    if uv is None:
        lines += [f"f {a} {b} {c}" for a, b, c in places.tolist()]
    else:
        texture = places if uv.ndim == 2 else np.arange(1, faces.size + 1).reshape(-1, 3)
        lines += [f"vt {u!r} {v!r}" for u, v in uv.reshape(-1, 2).tolist()]
        lines += [
            "f " + " ".join(f"{p}/{t}" for p, t in zip(corners, of_chart))
            for corners, of_chart in zip(places.tolist(), texture.tolist())
        ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_obstacle(part: Path, scene: BuiltScene) -> FileList:
    """Write the obstacle in every frame; return what was written, nothing without an obstacle."""
    obstacle = scene.obstacle
    if obstacle is None:
        return []
    times = np.arange(len(obstacle.positions)) * scene.dt
    write_point_cache(part / "obstacle.pc2", Trajectory(obstacle.positions, obstacle.faces, times))
    rest: dict[str, Any] = {}
    if scene.dressed is not None:
        rest["rest_positions"] = scene.dressed.body.shaped(scene.dressed.betas)
    fps = 1.0 / scene.dt
    np.savez(part / "obstacle.npz", positions=obstacle.positions, faces=obstacle.faces, fps=fps, **rest)
    content = "positions (T,B,3) of what the cloth touches, one frame where it stands still, faces"
    return [
        ("obstacle.npz", content + ", rest_positions (B,3), the body unposed" * bool(rest)),
        ("obstacle.pc2, obstacle.obj", "the same in float32"),
    ]


def write_motion(part: Path, worn: Dressed) -> FileList:
    """Write the poses in two layouts and the skinning of the garment; return what was written."""
    body, motion, garment = worn.body, worn.motion, worn.garment
    from snug.networks.dressed_body import DressedBody
    from snug.recipe import DEFAULT

    joints = body.joints(worn.betas)
    betas = np.zeros(body.shape_count) if worn.betas is None else np.asarray(worn.betas)
    frames = motion.frames
    earlier: dict[str, Any] = {}
    if (before := worn.before) is not None:
        earlier["poses_before"] = before.poses.reshape(before.frames, -1)
        earlier["trans_before"] = before.translations
    np.savez(
        part / "motion_smpl.npz", poses=motion.poses.reshape(frames, -1), trans=motion.translations,
        betas=betas, fps=motion.fps, **earlier,
    )  # fmt: skip
    from snug.body.skeleton import axis_angles, rotation_matrices

    poses = np.zeros((frames, 22 + FINGERS, 3))
    poses[:, :22] = motion.poses[:, :22]
    poses[:, 0] = axis_angles(Z_UP @ rotation_matrices(motion.poses[:, 0]))
    trans = (joints[0] + motion.translations) @ Z_UP.T - joints[0]
    np.savez(
        part / "motion_amass.npz", poses=poses.reshape(frames, -1), trans=trans, betas=np.pad(betas, (0, 6)),
        gender=np.array("neutral"), mocap_framerate=motion.fps,
    )  # fmt: skip
    smoothed = DressedBody(body, garment).weights(DEFAULT.smoothing).double().numpy()
    loops: dict[str, Any] = {f"loop_{name}": loop for name, loop in garment.loops.items()}
    np.savez(
        part / "skinning.npz", weights=garment.skinning_weights, smoothed_weights=smoothed,
        rest_positions=garment.rest_for(body, worn.betas), joints=joints, parents=body.parents,
        transforms=body.transforms(motion.poses, motion.translations, worn.betas),
        **loops,
    )  # fmt: skip
    content = "poses (T,72) [rad], trans (T,3), betas, fps: SMPL's 24 joints, y up"
    content += "; poses_before, trans_before, the motion until then" * bool(earlier)
    return [
        ("motion_smpl.npz", content),
        ("motion_amass.npz", "the same as AMASS writes it: poses (T,156), z up, fingers at rest"),
        (
            "skinning.npz",
            "weights (V,24) of the garment, smoothed_weights as method 'skinning' takes them, rest_positions "
            "(V,3) on this body, joints (24,3), parents (24,), transforms (T,24,3,4) of the joints, loops",
        ),
    ]


def facts_of(scene: BuiltScene) -> dict[str, Any]:
    """Return sizes, step, material and terms with their constants of the scene, in SI units."""
    material = scene.cloth.material
    return {
        "scene": scene.name,
        "units": "m, kg, s, rad",
        "up": "y",
        "frames": scene.frames,
        "dt": scene.dt,
        "fps": 1.0 / scene.dt,
        "substeps": scene.substeps,
        "warm_up_frames": scene.warm_up,
        "vertices": scene.cloth.vertex_count,
        "triangles": len(scene.cloth.faces),
        "before": 0 if scene.dressed is None or scene.dressed.before is None else scene.dressed.before.frames,
        "gravity": [0.0, -GRAVITY, 0.0],
        "material": {name: getattr(material, name) for name in material.__dataclass_fields__}
        | {"lame_lambda_N_per_m": material.lame_lambda, "lame_mu_N_per_m": material.lame_mu},
        "energies": {term.name: term.parameters() for term in scene.energies},
        "contact_region_m": None if scene.obstacle is None else scene.obstacle.region,
        "origin_heights": None if scene.origin_heights is None else scene.origin_heights.tolist(),
    }


def write_scene(
    folder: Path, declared: Scene, scene: BuiltScene, *, preset: str, score: str, simulation: Method | None
) -> None:
    """Write a scene, as declared and as built, into a new folder.

    Args:
        folder: has to be new or empty.
        declared: the entry of the scene.
        scene: the same scene, built.
        preset: the name of the preset whose sizes it has.
        score: the command that scores a roll-out of it; empty: none does.
        simulation: the method whose trajectory is written too; None: none.

    Raises:
        ValueError: where a simulation is asked for of a scene for networks alone.
        RuntimeError: where the garment does not settle.
    """
    if simulation is not None and declared.networks_only:
        raise ValueError(f"--reference: nobody simulates {declared.name}: it is for networks alone")
    with new_folder(folder) as part:
        facts = facts_of(scene) | {
            "description": declared.description, "preset": preset, "garment": declared.garment,
            "motion": declared.motion, "part": declared.part,
        }  # fmt: skip
        files = write_scene_files(part, scene, facts)
        files += _reference(part, scene, simulation) if simulation is not None else []
        (part / "README.txt").write_text(readme(scene, facts, files, score), encoding="utf-8")


def _reference(part: Path, scene: BuiltScene, method: Method) -> FileList:
    """Simulate the scene, and write the trajectory in three formats."""
    method.prepare(scene)
    trajectory = method.run()
    trajectory.save(part / "reference.vtkhdf")
    write_point_cache(part / "reference.pc2", trajectory)
    np.savez(
        part / "reference.npz", positions=trajectory.positions, faces=trajectory.faces, fps=1.0 / scene.dt
    )
    return [
        ("reference.vtkhdf, reference.npz", f"the simulation of the scene: {trajectory.status}"),
        ("reference.pc2, reference.obj", "the same in float32"),
    ]


def readme(scene: BuiltScene, facts: dict[str, Any], files: FileList, score: str) -> str:
    """Return the text of README.txt: content, units and order of each file, and how to be scored."""
    width = max(len(name) for name, _ in files)
    listed = [f"  {name:<{width}}  {content}" for name, content in files]
    # All digits: a roll-out is held to the scene's rate.
    rate, warm = np.format_float_positional(facts["fps"], trim="-"), facts["warm_up_frames"]
    lines = [
        f"Scene {scene.name}, preset {facts['preset']}: {facts['description']}.",
        "",
        "Units: metres, kilograms, seconds, radians, joules. World coordinates, right-handed, y up; a body",
        "faces +z in its rest pose. motion_amass.npz alone has z up. Gravity is 9.81 m/s^2 along -y.",
        "Order of vertices: that of rest.obj, the same in every file. Triangles wind outwards.",
        f"Time: {facts['frames']} frames at {rate} a second (dt {facts['dt']:.6g} s); frame 0 is the start:",
        f"start_positions and start_velocities. The first {warm} frames are simulated and not judged.",
        "npz files hold float64, and pc2 and obj beside it float32; rest.obj has all digits.",
        "",
        "Files:",
        "  scene.json" + " " * max(width - 8, 2) + "step, material, terms of the energy with their constants",
        *listed,
        "",
    ]
    if facts["before"]:
        lines += [
            f"The motion is a part: the {facts['before']} frames before it are poses_before and trans_before",
            "of motion_smpl.npz; the start has the velocities with which a simulation of them ends.",
            "",
        ]
    if scene.dressed is not None:
        lines += [
            "A vertex p at rest goes to sum_j w_j (R_j p + t_j), (R_j, t_j) = transforms. The motion is",
            "placed on the floor with its arms clear of the torso: --motions would place it anew.",
            "The zero of gravity's energy in a frame is origin_heights, the height of the pelvis.",
            "Contact: a sample of the cloth touches only faces of the body near its own place at rest:",
            f"those whose centroid at rest lies within {facts['contact_region_m']} m of the sample's.",
            "",
        ]
    if not score:
        lines.append("The scene is for networks of benchmarks.run alone: no roll-out of a file is scored.")
        return "\n".join(lines) + "\n"
    lines += [
        "Write positions (T,V,3) of all frames, the start included, as mine.npz:",
        f"  numpy.savez('mine.npz', positions=positions, fps={rate})",
        "and have them scored:",
        f"  {score}",
        "quasi_static=(T,V,3), the answer to each pose held still, adds the method's own dynamics.",
    ]
    return "\n".join(lines) + "\n"
