"""From words to a plan: every word of a request is checked before anything is done."""

from __future__ import annotations

import argparse
import os
import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from benchmarks.external.roll_out_option import parse as parse_roll_out
from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.methods import METHODS
from benchmarks.performance.microbenchmark import SUITE
from benchmarks.plan import plug_ins as outside
from benchmarks.plan.motion_roles import choose_motions
from benchmarks.plan.options import PROGRAM
from benchmarks.plan.plan import DEFAULT_ONLY, STATES, Motions, OwnBody, OwnGarment, Plan, PlanError
from benchmarks.plan.selection import MEASURED, Request, choose, choose_suites, names_no_motion
from benchmarks.presets import find_preset
from benchmarks.provenance import usable_cores
from benchmarks.results.run_folder import ResultsError, RunFolder
from benchmarks.scenes import GARMENT_SCENES, all_scenes
from snug.garments.options import demand_garment_file, make_garment_file
from snug.motion.options import parse_motion_options

WORKERS = 2  # the same everywhere, so that seconds of two runs can be compared; fewer cores, fewer workers


def make_plan(options: argparse.Namespace, words: Sequence[str]) -> Plan:
    """Check every word of the request. Raises ValueError with one line for the first wrong one."""
    preset = find_preset(options.preset)
    suites = choose_suites(split(options.suite))
    seeds = parse_seeds(options.seeds)
    check_device(options.device)
    folder = choose_folder(options.out)
    only = choose_states(split(options.only), fresh=options.fresh)
    workers = min(WORKERS, usable_cores()) if options.workers is None else options.workers
    if workers < 1:
        raise PlanError(f"--workers {workers}: give a whole number, 1 or more")
    known_scenes = {*all_scenes((), ()), *(entry.name for entry in MEASURED)}
    scenes, own_scenes = outside.resolved(outside.SCENES, split(options.scenes), known_scenes)
    methods, own_methods = outside.resolved(
        outside.METHODS, split(options.methods), {entry.name for entry in METHODS}
    )
    motions, reading = Motions(), parse_motion_options(options)
    tests, validates = split(options.test_motions), split(options.validation_motions)
    if options.motions or tests or validates or not names_no_motion(scenes, own_scenes):
        motions = choose_motions(
            options.motions, tests, preset, reading, validation_names=validates, split=options.split
        )
    garment = choose_garment(options)
    if garment:
        motions = replace(motions, worn=(garment.scenes, *motions.worn[1:]))
    request = Request(
        suites=suites, full=bool(options.suite), preset=preset, motions=motions, scenes=tuple(scenes),
        methods=tuple(methods), seeds=seeds, own_scenes=tuple(own_scenes), own_methods=tuple(own_methods),
        roll_outs=tuple(map(parse_roll_out, options.rollout)),
    )  # fmt: skip
    cells, cases, microbenchmarks = choose(request)
    asked = {suite for cell in cells for suite in cell.suites} | {case.suite for case in cases}
    asked |= {SUITE} if microbenchmarks else set()
    return Plan(
        preset=preset,
        suites=tuple(suite for suite in suites if suite in asked),
        cells=cells,
        cases=cases,
        microbenchmarks=microbenchmarks,
        metrics=choose_metrics(split(options.metrics)),
        motions=motions,
        body=choose_body(options.body),
        garment=garment,
        seeds=seeds,
        device=options.device,
        folder=folder,
        only=only,
        fresh=options.fresh,
        workers=workers,
        scheduler=choose_scheduler(options),
        command=shlex.join(["python", "-m", PROGRAM, *words]),
    )


def choose_metrics(words: Sequence[str]) -> tuple[str, ...]:
    """Modules of metrics that are not the project's. Raises ValueError."""
    if not words:
        return ()
    from benchmarks.metrics import declared

    names, metrics = outside.resolved(outside.METRICS, words, ())
    for name in names:
        if name not in {metric.name for metric in metrics}:
            raise PlanError(
                f"--metrics {name}: no such file or entry point; those of the project are measured"
            )
    homes = tuple(dict.fromkeys(metric.declared_in for metric in metrics))
    declared(homes)  # each name stands once
    return homes


def choose_body(path: str | None) -> OwnBody | None:
    """An own body, once it has been read. Raises snug.body.skeleton.BodyError for a file that holds none."""
    if path is None:
        return None
    from snug.body.smpl_files import read_body

    read_body(path)
    return OwnBody(Path(path), digest_of_file(Path(path)))


def choose_garment(options: argparse.Namespace) -> OwnGarment | None:
    """An own garment, once it has been read on the body. Raises PlanError for a name that is taken, and
    snug.garments.garment.GarmentError for a file that holds none for this body.
    """
    if options.garment is None:
        demand_garment_file(options)
        return None
    file = make_garment_file(options.garment, options)
    taken = {scene.split("/")[0] for scene in all_scenes((), ())} | {
        scenes.garment for scenes in GARMENT_SCENES
    }
    if file.name in taken or not re.fullmatch(r"[\w.+-]+", file.name):
        raise PlanError(
            f"--garment {file.path}: '{file.name}' cannot name its scenes: give the file another name, of "
            "letters, digits and '_'"
        )
    from snug.body.smpl_files import read_body
    from snug.garments.reading import read_garment

    read_garment(file, read_body(options.body))
    return OwnGarment(file, tuple(map(digest_of_file, file.files)))


def split(values: Sequence[str]) -> list[str]:
    """Repeated and comma-separated words in one list."""
    return [word.strip() for value in values for word in value.split(",") if word.strip()]


def parse_seeds(text: str) -> tuple[int, ...]:
    """Whole numbers from 0 on, each once. Raises PlanError."""
    try:
        seeds = tuple(dict.fromkeys(int(word) for word in split([text])))
    except ValueError:
        raise PlanError(f"--seeds '{text[:40]}': give whole numbers separated by commas") from None
    if not seeds or min(seeds) < 0 or max(seeds) >= 1 << 63:
        wanted = "at least one whole number, none below 0 or beyond 63 bits"
        raise PlanError(f"--seeds '{text[:40]}': give {wanted}")
    return seeds


def choose_states(words: Sequence[str], *, fresh: bool) -> frozenset[str]:
    """The states of records whose work is done again. Raises PlanError."""
    for word in words:
        if word not in STATES[1:]:
            raise PlanError(f"--only: unknown state '{word}'; choose from {', '.join(STATES[1:])}")
    if words and fresh:
        raise PlanError("--fresh does everything again: leave out --only")
    return frozenset(words or DEFAULT_ONLY)


def check_device(device: str) -> None:
    """Raises PlanError for an unknown device, and DeviceError for one that this machine does not have."""
    if device not in ("cpu", "cuda"):
        raise PlanError(f"--device '{device}': choose cpu or cuda")
    if device == "cuda":
        from snug.training.device import find_device

        find_device(device)


def choose_scheduler(options: argparse.Namespace) -> str:
    """The address of a scheduler that answers; empty without one. Raises ClusterError, PlanError."""
    if options.scheduler is None:
        return ""
    if options.device != "cpu":
        raise PlanError(
            f"--device {options.device}: on a cluster networks train on cpu; leave out --scheduler"
        )
    if options.rollout:
        raise PlanError("--rollout: its files lie on this machine alone; leave out --scheduler")
    from benchmarks.process.scheduler import check_scheduler

    check_scheduler(options.scheduler)
    return options.scheduler


def choose_folder(out: str | None) -> Path:
    """The folder of the run, not created yet. Raises PlanError where it cannot be made or holds other things.

    A folder that holds a run is gone on with.
    """
    if out is None:
        root = Path("reports") / "runs"
        stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        taken = [root / stamp, *(root / f"{stamp}-{n}" for n in range(2, 100))]
        folder = next(path for path in taken if not path.exists())
    else:
        folder = Path(out)
        if folder.exists() and not folder.is_dir():
            raise PlanError(f"--out {out}: is a file; name a folder")
        if folder.is_dir() and any(folder.iterdir()) and not RunFolder(folder).config_path.is_file():
            raise PlanError(f"--out {out}: is not empty and holds no run; name a new folder")
        if RunFolder(folder).config_path.is_file():
            _check_run(folder)
    parent = folder
    while not parent.exists():
        parent = parent.parent
    if not (parent.is_dir() and os.access(parent, os.W_OK | os.X_OK)):
        raise PlanError(f"--out {folder}: {parent} cannot be written to; name another folder")
    return folder


def _check_run(folder: Path) -> None:
    try:
        config = RunFolder(folder).read_config()
    except ResultsError as error:
        raise PlanError(f"--out {error}; name another folder") from None
    if "merged" in config:
        raise PlanError(f"--out {folder}: is merged of several runs, which go on in their own folders")
