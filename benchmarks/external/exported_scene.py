"""Folder of an exported scene: its files, the reference simulation and the README that explains them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.external.scene_files import FileList, facts_of, write_scene_files
from reference_sim.files.atomic_files import new_folder
from reference_sim.trajectory import write_point_cache

if TYPE_CHECKING:
    from benchmarks.method import Method
    from benchmarks.scene import BuiltScene, Scene


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
