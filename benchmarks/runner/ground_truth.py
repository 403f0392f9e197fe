"""Simulations beside the cells: settled garments, training motions, quasi-static solutions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from benchmarks.method import MethodEntry
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cells import build_scene
from benchmarks.runner.task import Context, Needed, Outcome
from benchmarks.scene import BuiltScene, Scene
from reference_sim.files.atomic_files import replacing

if TYPE_CHECKING:
    import numpy as np

    from reference_sim import Trajectory
    from snug.motion.motion import Motion


# Places to a metre of the body in its file, which is for the eye: half the size again.
GRID = 2.0**13


def settle_start(scene: Scene, context: Context, outcomes: Needed) -> Outcome:
    """Write the garment settled in the first pose of a scene, and the posed body.

    Where a scene has `start_of`, its start is what settled in that scene.
    """
    import numpy as np

    from reference_sim import Trajectory
    from reference_sim.files.array_file import write_array

    built, run, shared = scene.build(context.assets), context.folder, scene.start_of
    assert built.obstacle is not None
    Trajectory(
        positions=np.round(built.obstacle.positions * GRID).astype(np.float32) / np.float32(GRID),
        faces=built.obstacle.faces,
        times=np.arange(built.frames) * built.dt,
        provenance={"what": "the body of this scene"},
    ).save(run.trajectory_path(scene.name, "body"))
    with replacing(run.start_path(scene.name)) as temporary:
        write_array(temporary, np.load(run.start_path(shared)) if shared else built.start_state)
    return Outcome(files=files_of_start(scene, run))


def files_of_start(scene: Scene, run: RunFolder) -> tuple[str, ...]:
    """Return the names of the files that `settle_start` writes."""
    paths = run.start_path(scene.name), run.trajectory_path(scene.name, "body")
    return tuple(map(run.relative, paths))


def simulate_motion(scene: Scene, entry: MethodEntry, context: Context, outcomes: Needed) -> Outcome:
    """Write the simulation of a training motion, settling included; a whole one teaches."""
    built, run = scene.build(context.assets), context.folder
    trajectory = simulate_scene(built, entry, run)
    path = run.trajectory_path(scene.name, entry.name)
    # Without its times: the same simulation has the same bytes wherever it is done.
    replace(trajectory, frame_seconds=trajectory.frame_seconds[:0]).save(path)
    result = {
        "motion": scene.motion,
        "frames": trajectory.frames,
        "whole": trajectory.frames == built.frames,
        "status": trajectory.status,
        "reason": trajectory.reason,
    }
    return Outcome(result=result, files=(run.relative(path),))


def simulate_clips(
    scene: Scene,
    entry: MethodEntry,
    motions: tuple[str, ...],
    part: int,
    turns: float,
    context: Context,
    outcomes: Needed,
) -> Outcome:
    """Write the vertices of clips whose simulation, settled as a motion's, is whole and converged.

    The clips are mixed from `motions`: those that `part` + 1 augmented frames for each original one have,
    and `part` have not; `turns`: see make_shared_clips. The scene is that of any motion in the garment.
    """
    import numpy as np

    from snug.training.augmentation import make_shared_clips

    assets, run = context.assets, context.folder
    assert assets is not None
    arrays: dict[str, Any] = {}
    left_out: dict[str, str] = {}
    sources = assets.pick(motions)
    vertices = len(assets.garments[scene.garment].rest_positions)
    before, clips = (
        make_shared_clips(sources, share, turns=turns, vertices=vertices) for share in (part, part + 1)
    )
    for clip in clips[len(before) :]:
        positions, reason = simulate_clip(clip, scene, entry, context)
        if reason:
            left_out[clip.name] = reason
        else:
            arrays[clip.name] = positions.astype(np.float32)  # as networks see it
    path = run.curves_path(clips_of(scene.garment, motions, turns), f"{entry.name}-{part}")
    with replacing(path) as temporary:
        np.savez(temporary, **arrays)
    return Outcome(result={"clips": list(arrays), "left_out": left_out}, files=(run.relative(path),))


def clips_of(garment: str, motions: tuple[str, ...], turns: float) -> str:
    """Return the name of the clips mixed from so many motions, with that share of the turns."""
    return f"{garment}/mixed-{len(motions)}-turns-{turns:g}"


def simulate_clip(
    clip: Motion, scene: Scene, entry: MethodEntry, context: Context
) -> tuple[np.ndarray, str]:
    """Return positions (T,V,3) [m] of a clip, and why no network learns from them, or empty."""
    import numpy as np

    assets = context.assets
    assert assets is not None
    assets = replace(assets, motions={clip.name: clip}, clips={})
    built = replace(scene, name=f"{scene.garment}/{clip.name}", motion=clip.name).build(assets)
    try:
        trajectory = simulate_scene(built, entry, context.folder)
    except RuntimeError as error:  # a pose that leaves the cloth no room
        return np.empty(0), str(error) or type(error).__name__
    usable = trajectory.status == "converged" or entry.truncated
    whole = trajectory.frames == clip.frames and np.isfinite(trajectory.positions).all()
    return trajectory.positions, "" if usable and whole else f"{trajectory.status}: {trajectory.reason}"


def simulate_scene(scene: BuiltScene, entry: MethodEntry, folder: RunFolder) -> Trajectory:
    """Return the trajectory of a scene by a method that needs no network."""
    method = entry.make(models=folder.models, seed=0)
    method.prepare(replace(scene, dressed=None))  # so that it shows no bar beside that of all tasks
    return method.run()


def simulate_quasi_static(scene: Scene, context: Context, outcomes: Needed) -> Outcome:
    """Write the quasi-static solution of each frame: dynamics are measured against it."""
    import numpy as np

    from benchmarks.methods.simulation import STATIC
    from reference_sim import simulate

    built = build_scene(scene, context)
    path = context.folder.quasi_static_path(scene.name)
    trajectory = simulate(
        built.cloth, built.simulated_energies, frames=built.frames, obstacle=built.obstacle,
        start=built.start, pin_positions=built.pin_positions, **STATIC,
    )  # fmt: skip
    if trajectory.frames < built.frames or not np.isfinite(trajectory.positions).all():
        reason = f"ended after {trajectory.frames} of {built.frames} frames: {trajectory.reason}"
        return Outcome("diverged", reason, failed=True)
    trajectory.save(path)
    count = int((trajectory.frame_fields["converged"] == 0.0).sum())
    result = {"status": trajectory.status, "frames_not_converged": count}
    return Outcome(result=result, files=(context.folder.relative(path),))
