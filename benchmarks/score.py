"""python -m benchmarks.score: evaluate a roll-out of another program in a scene of this project.

A thin command: the roll-out is a method of an ordinary run, beside the simulation of the same scene.
"""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from benchmarks.external.roll_out_files import RollOutFileError, RollOutOption, parse_roll_out
from benchmarks.plan.cell import Cell
from benchmarks.plan.options import add_study_options, study_of
from benchmarks.plan.plan import Plan, make_plan
from benchmarks.plan.study import Study, StudyError, option, read_study
from benchmarks.results.run_folder import RunFolder
from benchmarks.run import carry_out
from benchmarks.timing import one_thread
from reference_sim.command_line import INTERRUPTED, Parser, command

PROGRAM = "benchmarks.score"
MEASURED_BESIDE = ("simulation", "skinning")  # relative excess is the share of skinning's
SOLVED_AGAIN = "speed"  # the part in which steps are solved again: gaps and one-step errors
NO_REFERENCE = (
    "left out by --no-reference: distances of curvature and position, dynamics, relative energy gap"
)
SUMMARY_METRICS = (
    "energy/total", "energy/strain", "energy/bending", "energy/bending_printed", "gap/energy",
    "curvature/mean", "curvature/histogram", "penetration/surface", "distance/rms", "surface/chamfer",
    "surface/normals",
)  # fmt: skip
EXAMPLES = """examples:
  python -m benchmarks.export tshirt/kick -o kick                 the scene, to be simulated elsewhere
  python -m benchmarks.score mine.npz --scene tshirt/kick -o scored
  python -m benchmarks.score mine.pc2,units=cm,up=z --scene tshirt/kick
  python -m benchmarks.score theirs=frames/,ms=2.2 --scene hanging_sheet
  python -m benchmarks.score 'out/cloth_*.obj' --scene flag --reference simulated.vtkhdf
  python -m benchmarks.score mine.npz --scene tshirt/kick --json > numbers.json
  python -m benchmarks.score pred.pkl --rest-mesh shirt.obj --no-reference      cloth and body of a pickle

ROLLOUT: .vtkhdf of this project; .npz with positions (T,V,3), faces, fps, quasi_static; .pkl with pred,
  cloth_faces, obstacle, obstacle_faces; .pc2 and .pc16 with their .obj; a folder or a quoted pattern of
  meshes, one a frame. In world coordinates, one position for each frame and vertex of the scene, in their
  order. units=cm and up=z say what the file has instead of metres and y up; other-mesh compares surfaces
  alone, ms=2.2 says what a frame takes.

exit status: 0 scored; 1 something failed, a line says what; 2 the roll-out cannot be read or does not belong
  to the scene: one line says why and nothing is written; 130 interrupted."""


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    command_line = list(sys.argv[1:] if arguments is None else arguments)
    one_thread()
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Energies, gap to the minimum of each step, curvature, depth, dynamics of "
        "a roll-out of another program: rows, a report, one line.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("roll_out", metavar="[NAME=]ROLLOUT", help="file, folder or pattern; as benchmarks.run --rollout")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--scene", metavar="NAME", help="as in benchmarks.run --list")
    where.add_argument("--rest-mesh", metavar="FILE",
        help="no scene of this project: the cloth at rest, in the roll-out's unit, axes and order; the file "
        "brings its own body (obstacle, obstacle_faces) and starts at rest in its first frame")  # fmt: skip
    add_study_options(parser)
    reference = parser.add_mutually_exclusive_group()
    reference.add_argument("--reference", metavar="FILE",
        help="compare with this roll-out (metres, y up) instead of simulating the scene")  # fmt: skip
    reference.add_argument("--no-reference", dest="reference", action="store_false",
        help="leave out what needs a reference")  # fmt: skip
    add("--json", action="store_true",
        help="print all numbers of the roll-out as one JSON object in place of the line: no figures, page "
        "and PDF, and no times and gaps of what it is compared with")  # fmt: skip
    add("-o", "--out", metavar="DIR", help="folder of the run (default: a new one under reports/runs/)")
    parser.set_defaults(reference=None)
    options = parser.parse_args(command_line)
    plan = plan_score(
        study_of(options), options.roll_out, options.scene or "",
        rest_mesh=options.rest_mesh, reference=options.reference,
        report=not options.json, folder=Path(options.out) if options.out else None,
        command_line=shlex.join(["python", "-m", PROGRAM, *command_line]),
    )  # fmt: skip
    with contextlib.redirect_stdout(sys.stderr):
        status = carry_out(plan, program=PROGRAM, report=not options.json)
    if evaluated := numbers(plan, status):
        print(json.dumps(evaluated, indent=1) if options.json else summary(evaluated))
    return status


def score(
    roll_out: str | Path, scene: str = "", *, study: Study | None = None, **more: Any
) -> dict[str, Any]:
    """Evaluate a roll-out in a scene and return its `numbers`, without figures, page and PDF.

    Args:
        roll_out: a file, a folder or a pattern, as the command takes it.
        scene: its name, as "tshirt/kick".
        study: whose body, garment, motions and sizes the scene has; None: study full.
        more: `rest_mesh`, `reference` and `folder` of `plan_score`.

    Raises:
        ValueError: one line, where the roll-out cannot be read or does not belong to the scene, or where
            the evaluation ended early.
        KeyboardInterrupt: it was interrupted.

    >>> score("mine.npz", "tshirt/kick")["metrics"]["energy/strain"]["value"]  # doctest: +SKIP
    0.031
    """
    one_thread()
    plan = plan_score(study or read_study(), str(roll_out), scene, report=False, **more)
    message = io.StringIO()
    with contextlib.redirect_stdout(sys.stderr), contextlib.redirect_stderr(message):
        status = carry_out(plan, program=PROGRAM, report=False)
    if status == INTERRUPTED:
        raise KeyboardInterrupt
    evaluated = numbers(plan, status)
    if evaluated is None:
        raise ValueError((message.getvalue().strip() or "the run ended early").splitlines()[-1])
    return evaluated


def plan_score(
    study: Study, roll_out: str, scene: str = "", *, rest_mesh: str | Path | None = None,
    reference: str | Path | Literal[False] | None = None, report: bool = True, folder: Path | None = None,
    command_line: str = "benchmarks.score.score",
) -> Plan:  # fmt: skip
    """Return the plan of a roll-out, of the simulation and of skinning in one scene.

    Args:
        study: whose body, garment, motions and sizes the scene has.
        roll_out: [NAME=]FILE, with ,units=cm and the like behind it.
        scene: its name; empty with a rest mesh.
        rest_mesh: of a roll-out that brings its own scene.
        reference: a roll-out in place of the simulation; False for none.
        report: whether times and gaps of what the roll-out is compared with are measured.
        folder: of the run; None: a new one.
        command_line: for run.json.
    """
    name, table = parse_roll_out(roll_out, named=False)
    stored = read_study(options=[option("rollouts", {name: table})]).rollouts[name]
    if rest_mesh and stored.other_mesh:
        raise RollOutFileError("other-mesh compares with a scene: give --scene, not --rest-mesh")
    scenes = []
    if rest_mesh:
        from benchmarks.scenes.from_roll_out import declared  # loads the simulator

        scenes = [declared(stored, str(rest_mesh))]
        scene = scenes[0].name
    # Some have a scene's name.
    parts = {name: replace(part, cases=()) for name, part in study.parts.items()}
    plan = make_plan(
        replace(study, parts=parts, scenes=(scene,), methods=MEASURED_BESIDE, rollouts={name: stored}),
        folder=folder, command=command_line, scenes=scenes,
    )  # fmt: skip
    if len(plan.scenes) != 1:
        raise StudyError(f"{scene}: name one scene; see python -m benchmarks.run --list")
    cells = []
    for cell in (_reference(cell, reference) for cell in plan.cells):
        suites = (*cell.suites, SOLVED_AGAIN) if report or cell.method == name else cell.suites
        entry = replace(cell.entry, timed=cell.entry.timed and report)
        cells.append(replace(cell, entry=entry, suites=tuple(dict.fromkeys(suites))))
    return replace(plan, cells=tuple(cells))


def _reference(cell: Cell, given: str | Path | Literal[False] | None) -> Cell:
    """Return the simulation's cell, or the one that takes its place; others as they are."""
    if cell.entry.role != "reference" or given is None:
        return cell
    if given is False:
        return replace(cell, entry=replace(cell.entry, left_out=NO_REFERENCE))
    from benchmarks.methods.outside import entry_of  # loads numpy

    stored = RollOutOption("reference", str(given), role="reference")
    entry = entry_of(stored, cell.scene.name)
    if entry is None:
        raise RollOutFileError(f"--reference {stored.path_for(cell.scene.name)}: no such file")
    return replace(cell, entry=replace(entry, label="Reference, from a file"))


def numbers(plan: Plan, status: int) -> dict[str, Any] | None:
    """Return name, scene, status ("ok", or the first other one), reason, metrics and folder of the roll-out.

    Metrics are name -> value and unit. None where the run ended before the roll-out was evaluated.
    """
    folder, name = RunFolder(plan.folder), plan.cells[-1].method
    if status not in (0, 1) or not folder.rows_path.is_file():
        return None
    rows = [row for row in folder.read_rows() if row.method == name]
    worst = next((row for row in rows if row.status != "ok"), rows[0] if rows else None)
    if worst is None:
        return None
    known = (row for row in rows if row.value is not None)
    return {
        "name": name,
        "scene": plan.scenes[0].name,
        "status": worst.status,
        "reason": worst.reason if worst.status != "ok" else "",
        "metrics": {row.metric: {"value": row.value, "unit": row.unit} for row in known},
        "folder": str(plan.folder),
    }


def summary(evaluated: dict[str, Any]) -> str:
    """Return one line of results, and where the rest is."""
    folder, metrics = RunFolder(Path(evaluated["folder"])), evaluated["metrics"]
    bad = [f"{evaluated['status']}: {evaluated['reason']}"] if evaluated["status"] != "ok" else []
    shown = {name: metrics[name] for name in SUMMARY_METRICS if name in metrics}
    values = [f"{name} {number['value']:.4g} {number['unit']}" for name, number in shown.items()]
    where = folder.report_path if folder.report_path.is_file() else folder.path
    return f"{evaluated['name']} in {evaluated['scene']}: {', '.join([*bad, *values])}; {where}"


if __name__ == "__main__":
    sys.exit(main())
