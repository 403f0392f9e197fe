"""A request: everything that a user asks of a run, before any of it is checked or read."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.presets import Preset, find_preset
from snug.motion.options import MotionFileOptions

if TYPE_CHECKING:
    from benchmarks.external.roll_out_option import RollOutOption
    from benchmarks.scene import Scene
    from snug.garments.options import GarmentFile


@dataclass(frozen=True, kw_only=True)
class Request:
    """A request of a command; `benchmarks.plan.make_plan.make_plan` makes the plan of it.

    command: the command line, for run.json. preset: the sizes of everything.
    suites, scenes, methods, metrics: names, patterns, and paths of files that declare some; empty: all that
    the suites list. further_scenes: scenes that no suite lists and no file declares. one_scene: exactly one
    scene is asked for, and no case of its name. roll_outs: stored ones, as methods.
    motions: paths, or "library"; motion_options: how to read them; test_motions, validation_motions: names of
    those that have these roles; split: the role that is measured, "test" or "validation".
    fabrics: a user's file of measured fabrics, for suite fabric; gauge: a user's copy of GAUGE, for it too.
    self_contact: whether the cloth of dressed scenes' simulations does not cross itself.
    body, garment: a user's own files; None: the package's. seeds: of trainings; device: where they run.
    folder: of the run; None: a new one. only: states of what the folder holds in which a task is done again;
    empty: the usual ones; fresh: nothing of the folder is reused. workers: processes side by side; None: as
    many as usual. scheduler: address of a cluster; empty: this machine. trained: folder of pretrained
    networks; None: networks are trained.
    """

    command: str = ""
    preset: Preset = field(default_factory=lambda: find_preset("quick"))
    suites: tuple[str, ...] = ()
    scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    metrics: tuple[str, ...] = ()
    further_scenes: tuple[Scene, ...] = ()
    one_scene: bool = False
    roll_outs: tuple[RollOutOption, ...] = ()
    motions: tuple[str, ...] = ()
    motion_options: MotionFileOptions = field(default_factory=MotionFileOptions)
    test_motions: tuple[str, ...] = ()
    validation_motions: tuple[str, ...] = ()
    split: str = "test"
    fabrics: Path | None = None
    gauge: Path | None = None
    self_contact: bool = False
    body: Path | None = None
    garment: GarmentFile | None = None
    seeds: tuple[int, ...] = (0,)
    device: str = "cpu"
    folder: Path | None = None
    only: tuple[str, ...] = ()
    fresh: bool = False
    workers: int | None = None
    scheduler: str = ""
    trained: Path | None = None
