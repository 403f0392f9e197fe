"""python -m benchmarks.run: the main job, from a body and motions to a report.

This file is the command alone: a study, its plan, an exit status. Nothing heavy is
imported before the plan is made, so --help and --list answer at once.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.declarations import DeclarationError
from benchmarks.external.roll_out_files import RollOutFileError
from benchmarks.plan.options import PROGRAM, list_names, make_parser, study_of
from benchmarks.plan.plan import Plan, make_plan
from benchmarks.plan.study import StudyError, locate
from benchmarks.runner.task import RunRefused, RunStopped
from benchmarks.timing import one_thread
from reference_sim.command_line import announce_compilation, command
from reference_sim.files.atomic_files import disk_full

GOES_ON = "the same command goes on from there"


@command(PROGRAM, goes_on=GOES_ON, bad_input=(RunRefused, DeclarationError, RollOutFileError))
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    name = "default"
    one_thread()
    try:
        options = make_parser().parse_args(typed)
        name = options.study
        study = study_of(options, name)
        if options.list is not None:
            print(list_names(study, options.list))
            return 0
        plan = make_plan(
            study,
            folder=Path(options.out) if options.out else None,
            retry=options.retry,
            fresh=options.fresh,
            workers=options.workers,
            command=shlex.join(["python", "-m", PROGRAM, *typed]),
        )
    except ValueError as error:  # also the readers' own: each is one line with file and remedy
        line = locate(str(error), name, typed) if isinstance(error, StudyError) else str(error)
        raise RunRefused(line) from error
    return carry_out(plan, dry_run=options.dry_run)


def carry_out(plan: Plan, *, dry_run: bool = False) -> int:
    """Run the plan, or print what would be run; return the exit status.

    Raises RunRefused, DeclarationError and RollOutFileError before anything is run.
    """
    for motion in plan.inputs.motions.values():
        print(f"motion {motion.name}: {motion.source}", file=sys.stderr)
    if absent := plan.study.motion_files.absent(plan.inputs.motions):
        print(absent, file=sys.stderr)
    for name, text in plan.cut_motions.items():
        print(f"motion {name}: {text} are measured; --set sizes.frames=N measures more", file=sys.stderr)
    from benchmarks.runner.execute_plan import check_methods, describe, execute, held

    if dry_run:
        print(describe(plan))
        return 0
    from benchmarks.runner.isolated_process import LOADED_BY_DRESSED, start_loading

    announce_compilation()
    dressed = bool(plan.scenes) and all(scene.dressed for scene in plan.scenes)
    start_loading(*(LOADED_BY_DRESSED if dressed else ()))
    assets = check_methods(plan)
    try:
        with held(plan.folder):
            print(plan.study.question, file=sys.stderr)
            return execute(plan, assets)
    except (RunStopped, OSError) as error:
        print(f"{PROGRAM}: {disk_full(error) or error}; {GOES_ON}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
