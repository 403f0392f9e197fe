"""What is simulated before anything is compared: settled garments, and the motions that networks learn from.

Functions for workers, each of (wardrobe, tell, ...); see benchmarks.workers.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .presets import Preset
from .results import RunFolder, replacing
from .scene import BuiltScene, Scene
from .wardrobe import Wardrobe

if TYPE_CHECKING:
    from .workers import Tell


@dataclass(frozen=True)
class Settled:
    """A garment at its start: seconds of wall time. files: of the start and the posed body, in the folder."""

    seconds: float
    files: tuple[str, ...]


@dataclass(frozen=True)
class Simulated:
    """A simulated training motion: seconds of wall time, settling included, and how it ended.

    files: its trajectory, in the run's folder.
    """

    motion: str
    seconds: float
    frames: int
    whole: bool
    status: str
    reason: str
    files: tuple[str, ...]


def settle(wardrobe: Wardrobe, tell: Tell, scene: Scene, preset: Preset, folder: Path) -> Settled:
    """Settle the garment of a dressed scene, write start and body."""
    import numpy as np

    clock = time.perf_counter()
    run = RunFolder(folder)
    built = scene.build(preset, wardrobe)
    assert built.obstacle is not None
    with replacing(run.body_path(scene.name)) as temporary:
        np.save(temporary, built.obstacle.positions)
    write_body(run, built)
    with replacing(run.start_path(scene.name)) as temporary:
        np.save(temporary, built.start)
    tell(preset.settle_frames)
    paths = (run.start_path(scene.name), run.body_path(scene.name))
    return Settled(time.perf_counter() - clock, tuple(map(run.relative, paths)))


def write_body(run: RunFolder, scene: BuiltScene) -> None:
    """trajectories/<scene>/body.vtkhdf, to look at the garments upon."""
    import numpy as np

    from reference_sim import Trajectory

    assert scene.obstacle is not None
    Trajectory(
        positions=scene.obstacle.positions.astype(np.float32),  # for the eye: half the size
        faces=scene.obstacle.faces,
        times=np.arange(scene.frames) * scene.dt,
        frame_seconds=np.full(scene.frames, np.nan),
        provenance={"what": "the body of this scene"},
    ).save(run.trajectory_path(scene.name, "body"))


def simulate_motion(wardrobe: Wardrobe, tell: Tell, scene: Scene, preset: Preset, folder: Path) -> Simulated:
    """Settle and simulate the training motion of a dressed scene, write its trajectory."""
    from reference_sim import simulate

    clock = time.perf_counter()
    built = scene.build(preset, wardrobe)
    start = built.start
    tell(preset.settle_frames)
    trajectory = simulate(
        built.cloth, built.energies, dt=built.dt, frames=built.frames, obstacle=built.obstacle, start=start,
        pin_positions=built.pin_positions,
    )  # fmt: skip
    seconds = time.perf_counter() - clock
    run = RunFolder(folder)
    path = run.trajectory_path(scene.name, "simulation")
    path.parent.mkdir(parents=True, exist_ok=True)
    trajectory.save(path)
    tell(built.frames)
    whole = trajectory.frames == built.frames
    motion = scene.name.split("/", 1)[1]
    return Simulated(
        motion, seconds, trajectory.frames, whole, trajectory.status, trajectory.reason, (run.relative(path),)
    )
