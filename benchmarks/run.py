"""python -m benchmarks.run: the main job, from a body and motions to a report.

This file is the command alone: words in, a checked plan, stages run in order, an exit status. Nothing
heavy is imported before the plan stands, so that --help and --list answer at once.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from snug.garment_file import add_garment_options, demand_a_file, garment_file

from .cache import DEFAULT_ONLY, STATES
from .performance.microbenchmark import SUITE
from .plan import Motions, OwnBody, OwnGarment, Plan, PlanError
from .presets import PRESETS, find_preset
from .provenance import usable_cores
from .registry import DeclarationError
from .results import ResultsError, RunFolder, digest_of_file
from .scenes import GARMENT_SCENES, all_scenes
from .selection import Request, choose, choose_motions, choose_suites, names_no_motion
from .tasks.task import RunStopped
from .timing import one_thread

PROGRAM = "benchmarks.run"
WORKERS = 2  # the same everywhere, so that seconds of two runs can be compared; fewer cores, fewer workers
EXAMPLES = """examples:
  python -m benchmarks.run                                    the quick run: every suite's quick subset
  python -m benchmarks.run --preset smoke                     everything once, tiny, about 3 minutes
  python -m benchmarks.run --suite garments -o reports/runs/mine
  python -m benchmarks.run --scenes hanging_sheet --methods simulation,newton-4
  python -m benchmarks.run --scenes 'tshirt/*' --methods snug,skinning,simulation --seeds 0,1,2
  python -m benchmarks.run --motions clips/ --test-motions 01_01
  python -m benchmarks.run --suite garments --methods 'simulation,skinning,snug,snug-without-*' \\
      --test-motions brisk_walk,torso_twist,lunge               what each choice of the recipe does
  python -m benchmarks.run -o reports/runs/mine --dry-run     what is finished there, what would be run
  python -m benchmarks.run --motions library --motions mine.amc
  python -m benchmarks.run --body mine.npz --suite garments
  python -m benchmarks.run --garment shirt.obj --garment-units cm --body mine.npz --suite garments

motions: without --motions the embedded library, which has its own test set. With --motions the files
  replace the library; "library" among the paths keeps it. --test-motions names those to test on, all
  others train, but for the library's own test motions, which never do. Without it the library's test
  set tests; of files alone the first by name tests and the others train; a single file tests and the
  library trains. Files are brought to 30 frames per second, placed on the floor, arms spread clear of
  the torso, and cut to the preset's length.

a folder that holds a run is gone on with: what is finished there for the same inputs and code is taken
  as it is, the rest is done. A run that was killed is so taken up again. --only failed does again what
  failed, --fresh everything.

exit status: 0 when every cell ended as ok or as an explained skip (in extremes a failure reported with
  its reason is an accepted outcome); 1 when a cell, a training or a simulation failed: a line says why
  and the rest went on; 2 when the request cannot be met, also where another run is going on in the
  folder: one line says why and nothing is left behind; 130 when it was interrupted: what had ended is
  in the folder, whole, and the same command goes on from there."""


class _Parser(argparse.ArgumentParser):
    """One clear line for a wrong word, in place of the whole usage."""

    def error(self, message: str):
        raise PlanError(f"{message}; see --help")


def make_parser() -> argparse.ArgumentParser:
    """The options of the command."""
    parser = _Parser(
        prog=f"python -m {PROGRAM}",
        description="Dress a body, simulate the ground truth, train the networks, compare all of them "
        "and write tables, figures and a PDF.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    names = ", ".join(preset.name for preset in PRESETS)
    add("--preset", default="quick", metavar="NAME", help=f"how much of everything: {names} (default quick)")
    add("--suite", action="append", default=[], metavar="NAME",
        help="garments, speed, validation, extremes, performance or all, in full; repeat or separate by "
        "commas (default: the quick subset of each but performance)")  # fmt: skip
    add("--scenes", action="append", default=[], metavar="NAME,...", help="only these; patterns allowed")
    add("--methods", action="append", default=[], metavar="NAME,...", help="only these; patterns allowed")
    add("--motions", action="append", default=[], metavar="PATH",
        help="motion file or folder (.amc with its .asf, .npz), or the word library; repeatable")  # fmt: skip
    add("--test-motions", action="append", default=[], metavar="NAME,...", help="motions to test on")
    add(
        "--body",
        metavar="FILE",
        help="an own body of SMPL's family, .npz or .pkl, in place of the package's; garments are made for "
        "it (extreme cases of single steps keep the package's)",
    )
    add("--garment", metavar="FILE",
        help="an own garment (OBJ, PLY, VTK), made for the body, in place of the T-shirt; its scenes are "
        "<name of the file>/<motion>. What will work says python -m snug.check FILE")  # fmt: skip
    add("--seeds", default="0", metavar="N,...", help="seeds of training (default 0)")
    add("--device", default="cpu", metavar="cpu|cuda", help="where networks train (default cpu)")
    add("-o", "--out", metavar="DIR", help="folder of the run (default: a new one under reports/runs/)")
    add("--only", action="append", default=[], metavar="STATE,...",
        help="of what the folder holds already, do again what is failed, stale or missing (default "
        "stale,missing; the finished is reused)")  # fmt: skip
    add("--fresh", action="store_true", help="reuse nothing from the folder")
    add("--workers", type=int, metavar="N",
        help="processes side by side for ground truth, training, metrics and cases (default 2, or the "
        "cores there are); cells that are timed run alone")  # fmt: skip
    add("--list", action="store_true", help="list suites, scenes, methods, motions and presets; run nothing")
    add("--dry-run", action="store_true", help="say what would be run and what is cached; write nothing")
    add_garment_options(parser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    one_thread()
    try:
        options = make_parser().parse_args(words)
        if options.list:
            from .listing import listing

            print(listing())
            return 0
        plan = make_plan(options, words)
    except (ValueError, OSError) as error:  # also the readers' own: each is one line with file and remedy
        print(f"{PROGRAM}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    from .lock import HeldError, held

    try:
        if options.dry_run:
            from .dry_run import describe

            print(describe(plan))
            return 0
        with held(plan.folder):
            from .execution import execute

            return execute(plan)
    except (HeldError, DeclarationError) as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2
    except (RunStopped, OSError) as error:
        from reference_sim.whole_file import disk_full

        line = str(error) if isinstance(error, RunStopped) else disk_full(error)
        if not line:
            raise
        print(f"{PROGRAM}: {line}; the same command goes on from there", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted; what was finished lies whole in {plan.folder}", file=sys.stderr)
        return 130


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
    scenes, methods = tuple(split(options.scenes)), tuple(split(options.methods))
    motions = Motions()
    if options.motions or options.test_motions or not names_no_motion(scenes):
        motions = choose_motions(options.motions, split(options.test_motions), preset)
    garment = choose_garment(options)
    if garment:
        motions = replace(motions, worn=(garment.scenes, *motions.worn[1:]))
    request = Request(
        suites=suites, full=bool(options.suite), preset=preset, motions=motions, scenes=scenes,
        methods=methods, seeds=seeds,
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
        motions=motions,
        body=choose_body(options.body),
        garment=garment,
        seeds=seeds,
        device=options.device,
        folder=folder,
        only=only,
        fresh=options.fresh,
        workers=workers,
        command=shlex.join(["python", "-m", PROGRAM, *words]),
    )


def choose_body(path: str | None) -> OwnBody | None:
    """An own body, once it has been read. Raises snug.skeleton.BodyError for a file that holds none."""
    if path is None:
        return None
    from snug.body import Body

    Body.from_file(path)
    return OwnBody(Path(path), digest_of_file(Path(path)))


def choose_garment(options: argparse.Namespace) -> OwnGarment | None:
    """An own garment, once it has been read on the body. Raises PlanError for a name that is taken, and
    snug.garments.GarmentError for a file that holds none for this body.
    """
    if options.garment is None:
        demand_a_file(options)
        return None
    file = garment_file(options.garment, options)
    taken = {scene.split("/")[0] for scene in all_scenes((), ())} | {
        scenes.garment for scenes in GARMENT_SCENES
    }
    if file.name in taken or not re.fullmatch(r"[\w.+-]+", file.name):
        raise PlanError(
            f"--garment {file.path}: '{file.name}' cannot name its scenes: give the file another name, of "
            "letters, digits and '_'"
        )
    from snug.body import Body
    from snug.garment_reading import read_garment

    read_garment(file, Body.from_file(options.body) if options.body else Body.load())
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
        from snug.device import find_device

        find_device(device)


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
        RunFolder(folder).read_config()
    except ResultsError as error:
        raise PlanError(f"--out {error}; name another folder") from None


if __name__ == "__main__":
    sys.exit(main())
