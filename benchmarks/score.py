"""python -m benchmarks.score: evaluate a roll-out of another program in a scene of this project.

It stands beside the scene's reference: shipped, from a file, or simulated now.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from benchmarks.external.roll_out_files import RollOutFileError, RollOutOption, parse_roll_out
from benchmarks.plan.cell import Cell
from benchmarks.plan.options import add_options, study_of
from benchmarks.plan.plan import Plan, make_plan
from benchmarks.plan.study import Study, StudyError, option, read_study
from benchmarks.results.run_folder import RunFolder
from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command

if TYPE_CHECKING:
    from benchmarks.runner.run_json import RunLog

PROGRAM = "benchmarks.score"
MEASURED_BESIDE = ("simulation", "skinning")  # relative excess is the share of skinning's
NETWORKS = ("snug", "pbns")  # beside these where their numbers are shipped
SOLVED_AGAIN = "speed"  # the part in which steps are solved again: gaps and one-step errors
NO_REFERENCE = (
    "left out by --no-reference: distances of curvature and position, dynamics, relative energy gap"
)
EXAMPLES = """examples:
  python -m benchmarks.export tshirt/kick -o kick         the scene, to be simulated elsewhere
  python -m benchmarks.score mine.npz --scene tshirt/07_02    seconds: its reference is shipped
  python -m benchmarks.score mine.npz --scene tshirt/kick -o scored   minutes: the scene is simulated
  python -m benchmarks.score mine.pc2,units=cm,up=z --scene tshirt/kick
  python -m benchmarks.score theirs=frames/,ms=2.2 --scene hanging_sheet
  python -m benchmarks.score 'out/cloth_*.obj' --scene flag --reference simulated.vtkhdf
  python -m benchmarks.score pred.pkl --rest-mesh shirt.obj --no-reference      cloth and body of a pickle

ROLLOUT: .vtkhdf of this project; .npz with positions (T,V,3), faces, fps, quasi_static; .pkl with pred,
  cloth_faces, obstacle, obstacle_faces; .pc2 and .pc16 with their .obj; a folder or a quoted pattern of
  meshes, one a frame. In world coordinates, one position for each frame and vertex of the scene, in their
  order. units=cm and up=z say what the file has instead of metres and y up; other-mesh compares surfaces
  alone, ms=2.2 says what a frame takes.

DIR has results.csv, run.json, and for_your_paper.tex and .csv. Page and PDF: benchmarks.run --rollout.
exit status: 0 scored; 1 something failed, a line says what; 2 the roll-out cannot be read or does not belong
  to the scene: one line says why and nothing is written; 130 interrupted."""


@command(PROGRAM, goes_on="the same command begins again")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    typed = list(sys.argv[1:] if arguments is None else arguments)
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Energies, gap to the minimum of each step, curvature, depth, dynamics of "
        "a roll-out of another program: a table, beside simulation, skinning, SNUG and PBNS.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("roll_out", metavar="[NAME=]ROLLOUT", help="file, folder or pattern; as benchmarks.run --rollout")
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--scene", metavar="NAME", help="as in benchmarks.run --list")
    group.add_argument("--rest-mesh", metavar="FILE",
        help="no scene of this project: the cloth at rest, in the roll-out's unit, axes and order; the file "
        "brings its own body (obstacle, obstacle_faces) and starts at rest in its first frame")  # fmt: skip
    add_options(parser)
    reference = parser.add_mutually_exclusive_group()
    reference.add_argument("--reference", metavar="FILE",
        help="compare with this roll-out (metres, y up) instead of the simulation")  # fmt: skip
    reference.add_argument("--no-reference", dest="reference", action="store_false",
        help="leave out what needs a reference")  # fmt: skip
    reference.add_argument("--fresh", action="store_true",
        help="simulate the scene, also where its reference is shipped")  # fmt: skip
    add("-o", "--out", metavar="DIR", help="folder of the rows (default: a new one under reports/runs/)")
    parser.set_defaults(reference=None)
    options = parser.parse_args(typed)
    scored = score(
        options.roll_out, options.scene or "", study=study_of(options), rest_mesh=options.rest_mesh,
        reference=options.reference, fresh=options.fresh,
        folder=Path(options.out) if options.out else None,
        command_line=shlex.join(["python", "-m", PROGRAM, *typed]),
    )  # fmt: skip
    from reports.build import build_row

    print(build_row(scored["folder"]))
    print(f"{scored['name']}: {scored['reason'] or scored['status']}; {scored['folder']}")
    return 0 if scored["status"] == "ok" else 1


def score(
    roll_out: str | Path, scene: str = "", *, study: Study | None = None, fresh: bool = False, **opts: Any
) -> dict[str, Any]:
    """Evaluate a roll-out in a scene and return its `numbers`.

    Args:
        roll_out: a file, a folder or a pattern, as the command takes it.
        scene: its name, as "tshirt/kick".
        study: whose body, garment, motions and sizes the scene has; None: study full.
        fresh: whether a scene is simulated whose reference is shipped.
        opts: `rest_mesh`, `reference`, `folder` and `command_line` of `plan_score`.

    Raises:
        ValueError: one line, where the roll-out cannot be read or does not belong to the scene.

    >>> score("mine.npz", "tshirt/07_02")["metrics"]["energy/strain"]["value"]  # doctest: +SKIP
    0.031
    """
    one_thread()
    plan = plan_score(study or read_study(), str(roll_out), scene, **opts)
    from benchmarks.evaluate import evaluate  # loads the simulator

    return numbers(evaluate(plan, {} if fresh else None))


def plan_score(
    study: Study, roll_out: str, scene: str = "", *, rest_mesh: str | Path | None = None,
    reference: str | Path | Literal[False] | None = None, folder: Path | None = None,
    command_line: str = "benchmarks.score.score",
) -> Plan:  # fmt: skip
    """Return the plan of a roll-out, and of what it is evaluated beside, in one scene.

    Args:
        study: as of `score`.
        roll_out: [NAME=]FILE, with ,units=cm and the like behind it.
        scene: its name; empty with a rest mesh.
        rest_mesh: of a roll-out that brings its own scene.
        reference: a roll-out in place of the simulation; False for none.
        folder: of the run; None: a new one.
        command_line: for run.json.
    """
    name, table = parse_roll_out(roll_out, named=False)
    stored = read_study(options=[option("rollouts", {name: table})]).rollouts[name]
    if rest_mesh and stored.other_mesh:
        raise RollOutFileError("other-mesh compares with a scene: give --scene, not --rest-mesh")
    scenes = []
    if rest_mesh:
        from benchmarks.scenes.from_roll_out import declare_scene  # loads the simulator

        scenes = [declare_scene(stored, str(rest_mesh))]
        scene = scenes[0].name
    methods = MEASURED_BESIDE if rest_mesh else (*MEASURED_BESIDE, *NETWORKS)
    # Some have a scene's name.
    parts = {name: replace(part, cases=()) for name, part in study.parts.items()}
    plan = make_plan(
        replace(study, parts=parts, scenes=(scene,), methods=methods, rollouts={name: stored}),
        folder=folder, command=command_line, scenes=scenes,
    )  # fmt: skip
    run = RunFolder(plan.folder)
    if run.config_path.is_file() and PROGRAM not in str(run.read_config().get("command")):
        raise StudyError(f"--out {run.path}: holds a run of another command; name another folder")
    if len(plan.scenes) != 1:
        raise StudyError(f"{scene}: name one scene; see python -m benchmarks.run --list")
    cells = []
    for cell in (_reference(cell, reference) for cell in plan.cells):
        suites = (*cell.suites, SOLVED_AGAIN) if cell.method == name else cell.suites
        cells.append(replace(cell, suites=tuple(dict.fromkeys(suites))))
    return replace(plan, cells=tuple(cells))


def _reference(cell: Cell, source: str | Path | Literal[False] | None) -> Cell:
    """Return the simulation's cell, or the one in its place; others as they are."""
    if cell.entry.role != "reference" or source is None:
        return cell
    if source is False:
        return replace(cell, entry=replace(cell.entry, left_out=NO_REFERENCE))
    from benchmarks.methods.outside import entry_of  # loads numpy

    stored = RollOutOption("reference", str(source), role="reference")
    entry = entry_of(stored, cell.scene.name)
    if entry is None:
        raise RollOutFileError(f"--reference {stored.path_for(cell.scene.name)}: no such file")
    return replace(cell, entry=replace(entry, label="Reference, from a file"))


def numbers(log: RunLog) -> dict[str, Any]:
    """Return name, scene, status ("ok", or the first other one), reason, metrics and folder.

    Metrics are name -> value and unit.
    """
    cell = log.plan.cells[-1]
    rows = [row for row in log.rows if row.method == cell.method]
    worst = next((row for row in rows if row.status != "ok"), rows[0])
    values = (row for row in rows if row.value is not None)
    return {
        "name": cell.method,
        "scene": cell.scene.name,
        "status": worst.status,
        "reason": worst.reason if worst.status != "ok" else "",
        "metrics": {row.metric: {"value": row.value, "unit": row.unit} for row in values},
        "folder": str(log.folder.path),
    }


if __name__ == "__main__":
    sys.exit(main())
