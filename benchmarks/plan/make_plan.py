"""From a study to a plan: everything is checked, and every file of a user read, before anything is done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from benchmarks.assets import read_inputs
from benchmarks.declarations import by_name
from benchmarks.method import installed
from benchmarks.methods import METHODS, find_method
from benchmarks.metrics import declared
from benchmarks.plan import user_files
from benchmarks.plan.cell import Cell
from benchmarks.plan.choose_cells import ReadStudy, choose_cells
from benchmarks.plan.motions import split_motions
from benchmarks.plan.plan import Plan
from benchmarks.plan.study import Study, StudyError, nearest
from benchmarks.provenance import usable_cores
from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from benchmarks.scene import Scene
from benchmarks.scenes import GarmentScenes, all_scenes
from benchmarks.validation.registry import CASES
from reference_sim.files.atomic_files import demand_writable_folder

WORKERS = 2  # the same everywhere, so that seconds of two runs can be compared; fewer cores, fewer workers


def make_plan(
    study: Study,
    *,
    folder: Path | None = None,
    workers: int | None = None,
    scheduler: str = "",
    scenes: Sequence[Scene] = (),
    **further: Any,
) -> Plan:
    """Return the plan of a study: cells, cases, motions and a user's inputs as read.

    Args:
        study: what is asked.
        folder: of the run; None: a new one.
        workers: processes side by side; None: as many as usual.
        scheduler: address of a cluster; empty: this machine.
        scenes: further scenes that no file declares.
        further: other fields of Plan: retry, fresh, command.

    Raises:
        ValueError: one line for the first thing that cannot be met, with what there is instead. Nothing has
            been created then.

    >>> from benchmarks.plan.study import option, read_study
    >>> study = read_study("default", [option("scenes", "flag"), option("methods", "simulation")])
    >>> [scene.name for scene in make_plan(study).scenes]
    ['flag']
    """
    folder = choose_folder(folder)
    check_machines(study, folder, scheduler)
    workers = min(WORKERS, usable_cores()) if workers is None else workers
    if workers < 1:
        raise StudyError(f"--workers {workers}: give a whole number, 1 or more")
    read = read_files(study, scenes)
    cells, cases = choose_cells(read)
    asked = {suite for cell in cells for suite in cell.suites} | {case.suite for case in cases}
    return Plan(
        preset=study.sizes,
        suites=tuple(part for part in study.parts if part in asked),
        cells=cells,
        cases=cases,
        metrics=choose_metrics(study),
        motions=read.motions,
        inputs=read.inputs,
        seeds=study.seeds,
        device=study.device,
        folder=folder,
        workers=workers,
        scheduler=scheduler,
        trained=study.trained,
        study=study.written,
        **further,
    )


def plan_scene(study: Study, name: str) -> Plan:
    """Return the plan of one scene by the simulation alone, in no folder: for export and check.

    Raises:
        ValueError: one line for the first thing that cannot be met.
    """
    read = read_files(study)
    if name not in read.scenes:
        raise StudyError(f"no scene '{name}'; {nearest(name, list(read.scenes))}")
    cell = Cell(read.scenes[name].at(study.sizes), find_method("simulation"), 0, ("speed",))
    return Plan(preset=study.sizes, cells=(cell,), motions=read.motions, inputs=read.inputs)


def read_files(study: Study, scenes: Sequence[Scene] = ()) -> ReadStudy:
    """Read all files of a user that a study names; `scenes` are further ones.

    Raises:
        ValueError: one line for the first file that cannot be read or named.
    """
    study, user_scenes, user_methods, user_cases = user_files.declarations_of(study)
    garment, self_contact = study.garment, study.self_contact
    if garment and garment.name in {name.split("/")[0] for name in all_scenes("-", "-")}:
        raise StudyError(f"{garment.path}: the project has scenes of that name: give the file another name")
    if self_contact and not installed("ipctk"):
        raise StudyError("self_contact: needs the package ipctk: pip install ipctk")
    inputs = read_inputs(study.body, garment, study.motions, study.motion_files)
    motions = split_motions(study, inputs.motions)
    of_file = [GarmentScenes(garment.name, f"a garment of {garment.path.name}")] if garment else []
    worn = (*of_file, *motions.worn[len(of_file) :])  # in place of the T-shirt
    motions = replace(motions, worn=tuple(replace(w, self_contact=self_contact) for w in worn))
    roles, dynamic = motions.roles(), motions.roles(dynamic=True)
    measured = all_scenes(
        dict.fromkeys((*motions.measured, *roles["test"], *roles["validation"])),
        dict.fromkeys((*motions.dynamic_measured, *dynamic["test"], *dynamic["validation"])),
        motions.worn,
    )
    known = by_name("scene", (*measured.values(), *scenes, *user_scenes))
    methods = by_name("method", (*METHODS, *user_methods))
    cases = by_name("known answer", (*CASES, *user_cases))
    return ReadStudy(study, inputs, motions, known, methods, tuple(cases.values()))


def choose_metrics(study: Study) -> tuple[str, ...]:
    """Return the modules of metrics that are not the project's. Raises ValueError."""
    names, metrics = user_files.resolve(user_files.METRICS, study.metrics)
    for name in set(names) - {metric.name for metric in metrics}:
        raise StudyError(f"metrics: {name}: is no file; those of the project are measured without it")
    homes = tuple(dict.fromkeys(metric.declared_in for metric in metrics))
    declared(homes)  # each name stands once
    return homes


def check_machines(study: Study, folder: Path, scheduler: str) -> None:
    """Raise ValueError for a device that this machine lacks, for networks of no folder, or of the run's own.

    Where a cluster works, also for what this machine alone has.
    """
    if study.device == "cuda":
        from snug.training.device import find_device  # loads torch

        find_device(study.device)
    trained = study.trained
    if trained and not trained.is_dir():
        raise StudyError(f"trained: {trained}: no such folder; without DIR the package's are taken")
    if trained and trained.resolve() == folder.resolve():  # where networks of another training are removed
        raise StudyError(f"trained: {trained}: the folder of this run itself: give another by --out")
    for field, given in (("rollouts", study.rollouts), ("trained", trained), ("device", study.device)):
        if scheduler and given and given != "cpu":
            what = f"{field}: a cluster has the cpu, and no file of this machine"
            raise StudyError(f"{what}; leave out --scheduler")


def choose_folder(folder: Path | None) -> Path:
    """Return the folder of the run, not created yet; one that holds a run is continued.

    Raises:
        StudyError: where it cannot be made, or holds other things.
    """
    if folder is None:
        folder = Path("reports", "runs", datetime.now().strftime("%Y-%m-%d_%H-%M-%S"))
    elif folder.exists() and not folder.is_dir():
        raise StudyError(f"--out {folder}: is a file; name a folder")
    elif RunFolder(folder).config_path.is_file():
        try:
            RunFolder(folder).read_config()
        except ResultsError as error:
            raise StudyError(f"--out {error}; name another folder") from None
    elif folder.is_dir() and any(folder.iterdir()):
        raise StudyError(f"--out {folder}: is not empty and holds no run; name a new folder")
    try:
        demand_writable_folder(folder)
    except ValueError as error:
        raise StudyError(f"--out {error}") from None
    return folder
