"""Build a data set: its sequences are tasks of the runner, one for each motion."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from benchmarks import provenance
from benchmarks.assets.assets import embedded_motions, open_assets
from benchmarks.assets.inputs import FEWEST_FRAMES, read_inputs
from benchmarks.cell import TaskId
from benchmarks.declarations import by_name
from benchmarks.method import MethodEntry
from benchmarks.methods.catalogue.all_methods import METHODS
from benchmarks.plan.make_plan import WORKERS, check_garment_name, choose_states, scenes_of_file
from benchmarks.plan.options import split
from benchmarks.plan.plan import Motions, Plan, PlanError
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.runner.execute_plan import executor_of
from benchmarks.runner.lock import held
from benchmarks.runner.loop import Runner
from benchmarks.runner.schedule import Schedule
from benchmarks.scenes import of_garment
from benchmarks.tasks.sequence import SimulateSequence
from benchmarks.tasks.task import Outcome
from snug.garments.options import demand_garment_file, is_garment_file, make_garment_file
from snug.motion.motion import Motion
from snug.motion.options import parse_motion_options
from snug.recipes.recipe import DEFAULT
from snug.training.simulated_data import INDEX, DataSet, SimulatedSequence, settings_of

LONGEST = 1_000_000  # frames of a sequence


def build_data_set(options: argparse.Namespace, command_line: Sequence[str]) -> DataSet:
    """Simulate what the folder lacks. Raises ValueError, one line, before anything is written."""
    plan, entry = plan_sequences(options, command_line)
    _existing(plan.folder)  # a folder of other things is refused before any work
    garment = plan.motions.first_garment
    motions = plan.inputs.motions.values()
    assets = open_assets(plan.preset, motions, [garment], inputs=plan.inputs)
    settings = settings_of(assets.body, assets.garments[garment]) | {
        "frames_per_second": _rate(motions), "method": entry.name, "settle_frames": plan.preset.settle_frames,
    }  # fmt: skip
    tasks = sequence_tasks(plan, entry)
    with held(plan.folder):
        before = _existing(plan.folder)  # read where nobody else writes it
        if before:
            before.check(settings)
        commands = tuple(dict.fromkeys((*(before.commands if before else ()), plan.command)))
        folder = RunFolder(plan.folder)
        folder.remove_parts()
        hardware = provenance.hardware_line(provenance.hardware())
        origin = {"commit": provenance.commit(), "hardware": hardware}
        runner = Runner(tasks, Cache(folder, only=plan.only, origin=origin))
        kept = before.sequences if before else ()
        DataSet(plan.folder, settings, _lines(tasks, {}, kept), commands).write()
        try:
            runner.run(executor_of(plan, folder, assets))
        finally:
            data = DataSet(plan.folder, settings, _lines(tasks, runner.known(), kept), commands)
            data.write()
    if runner.reused:
        print(f"{len(runner.reused)} sequences were there", file=sys.stderr)
    return data


def plan_sequences(options: argparse.Namespace, command_line: Sequence[str]) -> tuple[Plan, MethodEntry]:
    """Return the plan of these motions, and the method that simulates them. Raises ValueError, one line."""
    fewest = {"sequences": 1, "frames": FEWEST_FRAMES, "vertices": 1, "settle": 2, "workers": 1}
    for name, least in fewest.items():
        value = getattr(options, name)
        if value is not None and not least <= value <= LONGEST:
            raise PlanError(f"--{name} {value}: give a whole number from {least} to {LONGEST}")
    methods = {entry.name: entry for entry in METHODS if not (entry.trained or entry.needs_body)}
    if options.method not in methods:
        raise PlanError(f"--method {options.method}: no solver is called so; see benchmarks.run --list")
    garment_file = None
    if is_garment_file(options.garment):
        garment_file = make_garment_file(options.garment, options)
        check_garment_name(garment_file)
        worn = (scenes_of_file(garment_file),)
    else:
        demand_garment_file(options)
        worn = (of_garment(options.garment),)
    if why := methods[options.method].skip(worn[0].scene("")):
        raise PlanError(f"--method {options.method}: {why}")
    motions = choose_sequences(options)
    preset = replace(
        find_preset("quick"),
        garment_vertices=options.vertices,
        frames=LONGEST,
        train_frames=LONGEST,
        settle_frames=options.settle,
    )
    if options.scheduler:
        from benchmarks.process.cluster_address import check_scheduler

        check_scheduler(options.scheduler)
    inputs = read_inputs(Path(options.body) if options.body else None, garment_file)
    rest = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    rest.add_argument("-o", "--out")
    plan = Plan(
        preset=preset, suites=(), cells=(), cases=(), seeds=(), device="cpu", folder=Path(options.out),
        motions=Motions(train=tuple(motions), files=tuple(motions), worn=worn),
        inputs=replace(inputs, motions=motions), only=choose_states(split(options.only), fresh=False),
        scheduler=options.scheduler or "",
        workers=options.workers or min(WORKERS, provenance.usable_cores()),
        command=shlex.join(["python", "-m", "benchmarks.dataset", *rest.parse_known_args(command_line)[1]]),
    )  # fmt: skip
    return plan, methods[options.method]


def choose_sequences(options: argparse.Namespace) -> dict[str, Motion]:
    """Return name -> motion of each sequence. Raises ValueError for names that come twice, and for none."""
    from snug.motion import library
    from snug.motion.files import load_motions
    from snug.training.augmentation.mixed_clips import CLIP_FRAMES, SHARED_SEED, make_mixed_clips

    reading, given = parse_motion_options(options), list[Motion]()
    for path in options.motions or ["library"]:
        given += embedded_motions(library.TRAIN) if path == "library" else load_motions(path, options=reading)
    count = len(given) if options.sequences is None else options.sequences
    if more := max(0, count - len(given)):
        turn, lifted = DEFAULT.mixed_turn, DEFAULT.mixed_lift
        given += make_mixed_clips(given, more * CLIP_FRAMES, turn=turn, lifted=lifted, seed=SHARED_SEED)
    if not 0 <= options.first < count:
        raise PlanError(f"--from {options.first}: give a whole number below {count}, that of the sequences")
    motions: dict[str, Motion] = by_name("motion", given[:count])
    chosen = list(motions.values())[options.first :]
    cut = [motion.cut(0, options.frames) if options.frames else motion for motion in chosen]
    for motion in cut:
        if motion.frames < FEWEST_FRAMES:
            raise PlanError(
                f"motion {motion.name}: {motion.frames} frames; at least {FEWEST_FRAMES} are needed"
            )
    return {motion.name: motion for motion in cut}


def sequence_tasks(plan: Plan, entry: MethodEntry) -> list[SimulateSequence]:
    """Return one task for each motion; the machine is no input of it."""
    schedule, garment, tasks = Schedule(plan), plan.motions.first_garment, []
    for name, motion in plan.inputs.motions.items():
        task = schedule.data(name, garment, entry)
        given = {field.name: getattr(task, field.name) for field in fields(task)}
        inputs = {name: value for name, value in task.inputs.items() if name != "machine"}
        modules = (*task.modules, "benchmarks.tasks.sequence")
        units = motion.frames + plan.preset.settle_frames
        tasks.append(
            SimulateSequence(**given | {"label": name, "inputs": inputs, "modules": modules, "units": units})
        )
    return tasks


def _existing(folder: Path) -> DataSet | None:
    """Return the data set to continue. Raises ValueError for a folder that holds other things."""
    if folder.is_dir() and any(folder.iterdir()):
        if not (folder / INDEX).exists():
            raise PlanError(f"--out {folder}: is not empty and holds no data set; name a new folder")
        return DataSet.read(folder)
    return None


def _rate(motions: Iterable[Motion]) -> float:
    rates = sorted({float(motion.fps) for motion in motions})
    if len(rates) != 1:
        raise PlanError(f"the motions have {rates} frames per second; give those of one rate")
    return rates[0]


def _lines(
    tasks: Sequence[SimulateSequence], outcomes: Mapping[TaskId, Outcome], kept: Sequence[SimulatedSequence]
) -> tuple[SimulatedSequence, ...]:
    """Return the index: existing lines, and the outcome of each task, in the order of the first request."""
    lines = {line.name: line for line in kept}
    for task in tasks:
        name, outcome = task.scene.motion, outcomes.get(task.id)
        lines[name] = (
            _line(name, outcome) if outcome and outcome.origin else lines.get(name, SimulatedSequence(name))
        )
    return tuple(lines.values())


def _line(name: str, outcome: Outcome) -> SimulatedSequence:
    facts = {name: outcome.origin[name] for name in ("hardware", "commit")}
    facts |= {"reason": outcome.reason, "seconds": round(outcome.seconds, 3)}
    if outcome.failed or not outcome.files:
        return SimulatedSequence(name, status=outcome.status, **facts)
    trajectory, motion, vertices = outcome.files
    result = outcome.result
    return SimulatedSequence(
        name, trajectory, motion, vertices, outcome.digests, result["frames"], result["status"],
        usable=result["whole"], **facts | {"reason": result["reason"]},
    )  # fmt: skip
