"""python -m benchmarks.score: evaluate a roll-out of another program in a scene of this project.

A thin command: the roll-out is a method of an ordinary run, beside the simulation of the same scene.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.plan.options import add_scene_options
from benchmarks.plan.plan import Plan
from benchmarks.plan.plan_roll_out import plan_roll_out
from benchmarks.process.timing import one_thread
from benchmarks.results.run_folder import RunFolder
from benchmarks.run import carry_out
from reference_sim.command_line import INTERRUPTED, Parser

PROGRAM = "benchmarks.score"
MISSING = "missing"  # status of a roll-out that a run ended before
EXAMPLES = """examples:
  python -m benchmarks.export tshirt/kick -o kick                 the scene, to be simulated elsewhere
  python -m benchmarks.score mine.npz --scene tshirt/kick -o scored
  python -m benchmarks.score mine.pc2 --scene tshirt/kick --units cm --up z --match-vertices
  python -m benchmarks.score frames/ --scene hanging_sheet --fps 60 --declared-ms 2.2
  python -m benchmarks.score 'out/cloth_*.obj' --scene flag --reference simulated.vtkhdf
  python -m benchmarks.score mine.npz --scene tshirt/kick --json --no-report > numbers.json
  python -m benchmarks.score pred.pkl --rest-mesh shirt.obj --no-reference      cloth and body of a pickle

ROLLOUT: .vtkhdf of this project; .npz with positions (T,V,3), faces, fps, quasi_static; .pkl with pred,
  cloth_faces, obstacle, obstacle_faces; .pc2 and .pc16 with their .obj; a folder or a quoted pattern of
  meshes, one a frame. In world coordinates, the scene's first frame first. Other units, axes, rates and
  orders of vertices are refused with the option that mends them.

exit status: 0 scored; 1 something failed, a line says what; 2 the roll-out cannot be read or does not belong
  to the scene: one line says why and nothing is written; 130 interrupted."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Energies, gap to the minimum of each step, curvature, depth, conservation, dynamics of "
        "a roll-out of another program: rows, a report, one line.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("roll_out", metavar="ROLLOUT", help="file, folder or pattern")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--scene", metavar="NAME", help="as in benchmarks.run --list")
    where.add_argument("--rest-mesh", metavar="FILE",
        help="no scene of this project: the cloth at rest, in the roll-out's unit, axes and order; the file "
        "brings its own body (obstacle, obstacle_faces) and starts at rest in its first frame")  # fmt: skip
    add_scene_options(parser)
    add("--name", default="", metavar="NAME", help="of the method in tables (default: the file's)")
    add("--units", default="m", metavar="m|cm|mm|in", help="of the roll-out (default m)")
    add("--up", default="y", metavar="y|z", help="its up axis (default y)")
    add("--fps", type=float, metavar="N", help="its frames per second; other than the scene's are re-timed")
    add("--match-vertices", action="store_true", help="its vertices are the scene's in another order")
    add("--other-mesh", action="store_true", help="its mesh is another one: surfaces are compared alone")
    add("--declared-ms", type=float, metavar="X",
        help="milliseconds a frame, as its author says: marked so, nothing is timed here")  # fmt: skip
    reference = parser.add_mutually_exclusive_group()
    reference.add_argument("--reference", metavar="FILE",
        help="compare with this roll-out (metres, y up) instead of simulating the scene")  # fmt: skip
    reference.add_argument("--no-reference", action="store_true", help="leave out what needs a reference")
    add(
        "--no-report",
        action="store_true",
        help="numbers of the roll-out alone: no figures, page and PDF, and no times and "
        "gaps of what it is compared with",
    )
    add("--json", action="store_true", help="print all numbers as one JSON object in place of the line")
    add("-o", "--out", metavar="DIR", help="folder of the run (default: a new one under reports/runs/)")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    command_line = list(sys.argv[1:] if arguments is None else arguments)
    one_thread()
    try:
        command = shlex.join(["python", "-m", PROGRAM, *command_line])
        options = make_parser().parse_args(command_line)
        plan = plan_roll_out(options, command)
    except (ValueError, OSError) as error:  # as in benchmarks.run
        print(f"{PROGRAM}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted; nothing was written", file=sys.stderr)
        return 130
    with contextlib.redirect_stdout(sys.stderr):
        status = carry_out(plan, program=PROGRAM, report=not options.no_report)
    if status in (0, 1) and RunFolder(plan.folder).rows_path.is_file():
        print(json.dumps(numbers(plan), indent=1) if options.json else summary(plan))
    return status


def score(roll_out: str | Path, *options: str) -> dict[str, Any]:
    """Evaluate a roll-out in a scene and return the numbers, without figures, page and PDF.

    Args:
        roll_out: a file, a folder or a pattern, as the command takes it.
        *options: of the command, such as "--scene", "tshirt/kick".

    Returns:
        What `numbers` returns.

    Raises:
        ValueError: one line, where the roll-out cannot be read or does not belong to the scene, or where the
            evaluation ended early.
        KeyboardInterrupt: it was interrupted.

    >>> score("mine.npz", "--scene", "tshirt/kick")["metrics"]["energy/strain"]["value"]  # doctest: +SKIP
    0.031
    """
    one_thread()
    bare = make_parser().parse_args([str(roll_out), *options, "--no-report"])
    plan = plan_roll_out(bare, "benchmarks.score.score")
    message = io.StringIO()
    with contextlib.redirect_stdout(sys.stderr), contextlib.redirect_stderr(message):
        status = carry_out(plan, program=PROGRAM, report=False)
    lines = message.getvalue().strip().splitlines()
    if status == INTERRUPTED:
        raise KeyboardInterrupt
    evaluated = numbers(plan) if status in (0, 1) and RunFolder(plan.folder).rows_path.is_file() else None
    if evaluated is None or evaluated["status"] == MISSING:
        raise ValueError(lines[-1] if lines else "the run ended early")
    return evaluated


def numbers(plan: Plan) -> dict[str, Any]:
    """Return what was found of the roll-out, ready for JSON.

    Returns:
        name, scene, status ("ok", the first other one, or "missing" where the run ended before), reason,
        metrics (name -> value and unit), folder.
    """
    folder, name = RunFolder(plan.folder), plan.cells[-1].method
    rows = [row for row in folder.read_rows() if row.method == name]
    bad = next((row for row in rows if row.status != "ok"), None)
    known = (row for row in rows if row.value is not None)
    return {
        "name": name,
        "scene": plan.scenes[0].name,
        "status": bad.status if bad else "ok" if rows else MISSING,
        "reason": bad.reason if bad else "" if rows else "the run ended before it was evaluated",
        "metrics": {row.metric: {"value": row.value, "unit": row.unit} for row in known},
        "folder": str(plan.folder),
    }


SUMMARY_METRICS = (
    ("energy/total", "total", "J"),
    ("energy/strain", "strain", "J"),
    ("energy/bending", "bending", "J"),
    ("energy/bending_printed", "bending as printed", "J"),
    ("gap/energy", "gap", "J"),
    ("curvature/mean", "curvature", "1/m"),
    ("curvature/error", "curvature error", "1/m"),
    ("penetration/surface", "penetration", "%"),
    ("distance/rms", "distance", "mm"),
    ("surface/chamfer", "Chamfer distance", "mm"),
    ("surface/normals", "angle of normals", "deg"),
)


def summary(plan: Plan) -> str:
    """Return one line of results, and where the rest is."""
    result = numbers(plan)
    metrics = result["metrics"]
    shown = [
        f"{word} {metrics[metric]['value']:.4g} {unit}"
        for metric, word, unit in SUMMARY_METRICS
        if metric in metrics
    ]
    bad = f"{result['status']}: {result['reason']}" if result["status"] != "ok" else ""
    results = ", ".join(filter(None, (bad, *shown)))
    report = RunFolder(plan.folder).report_path
    where = report if report.is_file() else plan.folder
    return f"{result['name']} in {result['scene']}: {results}; {where}"


if __name__ == "__main__":
    sys.exit(main())
