"""The files of an exported scene, and the text that explains them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.methods import find_method
from reference_sim import Trajectory
from reference_sim.files.atomic_files import new_folder
from reference_sim.material import GRAVITY
from reference_sim.trajectory.point_cache import write_point_cache

if TYPE_CHECKING:
    from benchmarks.assets.assets import Assets
    from benchmarks.plan.plan import Plan
    from benchmarks.scene import BuiltScene, Dressed

FINGERS = 30  # joints of SMPL-H's hands, which a garment never meets
# (x, y, z) with y up -> (x, -z, y) with z up.
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def write_scene(
    folder: Path, plan: Plan, scene: BuiltScene, assets: Assets | None, *, score: str, reference: bool
) -> None:
    """Write everything into a new folder. score: the command that judges.

    Raises ValueError where --reference is asked of a scene that nobody simulates, RuntimeError where the
    garment does not settle.
    """
    declared = plan.scenes[0]
    if reference and declared.networks_only:
        raise ValueError(f"--reference: nobody simulates {declared.name}: it is for networks alone")
    with new_folder(folder) as part:
        files = [*_cloth(part, scene), *_obstacle(part, scene)]
        if scene.dressed is not None:
            files += _motion(part, scene.dressed)
        files += _reference(part, scene) if reference else []
        facts = description(plan, scene)
        (part / "scene.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
        (part / "README.txt").write_text(readme(scene, facts, files, score), encoding="utf-8")


def write_for_program(folder: Path, scene: BuiltScene) -> None:
    """The same into a new folder, for a program that reads no README: arrays, meshes and scene.json."""
    folder.mkdir()
    _cloth(folder, scene)
    _obstacle(folder, scene)
    if scene.dressed is not None:
        _motion(folder, scene.dressed)
    (folder / "scene.json").write_text(json.dumps(facts_of(scene), indent=2) + "\n", encoding="utf-8")


Listed = list[tuple[str, str]]  # name of a file, what is in it


def _cloth(part: Path, scene: BuiltScene) -> Listed:
    """The rest mesh, and all arrays of the cloth."""
    cloth = scene.cloth
    _write_obj(part / "rest.obj", cloth.rest_positions, cloth.faces, cloth.rest_uv)
    arrays: dict[str, Any] = {
        "rest_positions": cloth.rest_positions, "faces": cloth.faces, "masses": cloth.masses,
        "start_positions": scene.start, "start_velocities": scene.start_velocity,
        "pins": np.asarray(cloth.pins, dtype=np.int64),
    }  # fmt: skip
    said = "rest_positions, start_positions, start_velocities (V,3), faces (F,3), masses (V,) [kg], pins (P,)"
    if cloth.rest_uv is not None:
        arrays["rest_uv"] = cloth.rest_uv
        said += ", rest_uv [m], the flat rest state"
    if scene.pin_positions is not None:
        arrays["pin_positions"] = np.stack([scene.pin_positions(frame) for frame in range(scene.frames)])
        said += ", pin_positions (T,P,3)"
    if scene.kept is not None:
        arrays["kept"] = scene.kept
        said += ", kept (T,), the frames of the motion that a roll-out holds"
    np.savez(part / "cloth.npz", **arrays)
    return [("rest.obj", "rest mesh" + ", with its UV" * (cloth.rest_uv is not None)), ("cloth.npz", said)]


def _write_obj(path: Path, positions: np.ndarray, faces: np.ndarray, uv: np.ndarray | None) -> None:
    """All digits, so that reading gives the same numbers; UV of vertices or of corners."""
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


def _obstacle(part: Path, scene: BuiltScene) -> Listed:
    """What is touched, in every frame."""
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
    said = "positions (T,B,3) of what the cloth touches, one frame where it stands still, faces"
    return [
        ("obstacle.npz", said + ", rest_positions (B,3), the body unposed" * bool(rest)),
        ("obstacle.pc2, obstacle.obj", "the same in float32"),
    ]


def _motion(part: Path, worn: Dressed) -> Listed:
    """Poses in two layouts, and what skins the garment."""
    body, motion, garment = worn.body, worn.motion, worn.garment
    from snug.networks.dressed_body import DressedBody
    from snug.recipes.recipe import DEFAULT

    joints = body.joints(worn.betas)
    betas = np.zeros(body.shape_count) if worn.betas is None else np.asarray(worn.betas)
    frames = motion.frames
    np.savez(
        part / "motion_smpl.npz", poses=motion.poses.reshape(frames, -1), trans=motion.translations,
        betas=betas, fps=motion.fps,
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
    return [
        ("motion_smpl.npz", "poses (T,72) [rad], trans (T,3), betas, fps: SMPL's 24 joints, y up"),
        ("motion_amass.npz", "the same as AMASS writes it: poses (T,156), z up, fingers at rest"),
        (
            "skinning.npz",
            "weights (V,24) of the garment, smoothed_weights as method 'skinning' takes them, rest_positions "
            "(V,3) on this body, joints (24,3), parents (24,), transforms (T,24,3,4) of the joints, loops",
        ),
    ]


def _reference(part: Path, scene: BuiltScene) -> Listed:
    method = find_method("simulation").make(models=part, seed=0)
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


def description(plan: Plan, scene: BuiltScene) -> dict[str, Any]:
    """What scene.json holds."""
    declared = plan.scenes[0]
    said = {"description": declared.description, "preset": plan.preset.name}
    said |= {"garment": declared.garment, "motion": declared.motion, "part": declared.part}
    return facts_of(scene) | said


def facts_of(scene: BuiltScene) -> dict[str, Any]:
    """Of it what the scene itself knows: sizes, step, material, terms with their constants. SI units."""
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


def readme(scene: BuiltScene, facts: dict[str, Any], files: Listed, score: str) -> str:
    """README.txt: what lies where, in which units and order, and how to be scored."""
    width = max(len(name) for name, _ in files)
    listed = [f"  {name:<{width}}  {said}" for name, said in files]
    rate, warm = f"{facts['fps']:g}", facts["warm_up_frames"]
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
            f"The motion is a part: {facts['before']} frames came before it; the start has their velocities.",
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
    lines += [
        "Write positions (T,V,3) of all frames, the start included, as mine.npz:",
        f"  numpy.savez('mine.npz', positions=positions, fps={rate})",
        "and have them scored:",
        f"  {score}",
        "quasi_static=(T,V,3), the answer to each pose held still, adds the method's own dynamics.",
    ]
    return "\n".join(lines) + "\n"
