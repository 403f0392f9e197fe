"""python -m benchmarks.solver_speed: the simulator's own benchmark. Times are medians; compare ratios.

Every part runs in a process of its own, one after another, so that its peak memory is its own and nothing
runs beside it. Nothing here is asserted by a test: a time belongs to the machine that it was taken on.
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import sys
from collections.abc import Sequence
from pathlib import Path

from ..clock import one_thread

PARTS = {
    "sheet": "64 x 64 sheet pinned at two corners, 30 frames: ms a frame, convergence, where the time goes",
    "tshirt": "T-shirt of 1000 and 4400 vertices on the walking, running and jumping body",
    "minimisers": "Newton and L-BFGS over the same walk, beside ten starts moved by 0.1 mm",
    "barrier": "a sheet on a ball: IPC's barrier beside the penalty, its cost and what passes (ipctk)",
    "guesses": "potential above the minimum of each initial guess of a step",
    "scaling": "cost of an iteration and peak memory from 1k to 64k vertices",
    "left_out": "with and without a body, hinges, inertia, networks that a scene does not need",
    "closest": "closest points of a frame's samples on the body: the refitted tree beside libigl's",
    "linear": "sparse Cholesky packages on the same Hessian: analyse, factorise, solve",
    "peers": "newton's VBD and XPBD on the same sheet, step and masses (extra `peers`)",
}
EXAMPLES = """examples:
  python -m benchmarks.solver_speed                     everything, medians of 5 (about half an hour)
  python -m benchmarks.solver_speed --parts sheet,linear --repeats 3
  python -m benchmarks.solver_speed -o reports/runs/solver"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the parts asked for; 0 when all ran, 1 when one failed, 2 for a wrong word."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.solver_speed",
        description="Benchmark of the reference simulator.\n\nparts:\n"
        + "\n".join(f"  {name:<11} {what}" for name, what in PARTS.items()),
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--parts", default=",".join(PARTS), metavar="NAME,...", help="default: all")
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="runs of each case (default 5)")
    parser.add_argument("-o", "--out", metavar="DIR", help="also write solver_speed.csv and .json there")
    options = parser.parse_args(arguments)
    parts = [name.strip() for name in options.parts.split(",")]
    unknown = [name for name in parts if name not in PARTS]
    if unknown or options.repeats < 1:
        wrong = (
            f"unknown part '{unknown[0]}': choose from {', '.join(PARTS)}"
            if unknown
            else "--repeats: at least 1"
        )
        print(f"benchmarks.solver_speed: {wrong}", file=sys.stderr)
        return 2
    one_thread()
    rows: list[dict[str, object]] = []
    failed = False
    for name in parts:
        for case in _cases(name):
            found = _in_own_process(name, case, options.repeats)
            failed |= any(row["metric"] == "failed" for row in found)
            for row in found:
                print(
                    f"{row['part']:<11} {row['case']:<30} {row['metric']:<34} {row['value']} {row['unit']}",
                    flush=True,
                )
            rows += found
    if options.out:
        _write(Path(options.out), rows)
    return int(failed)


def _cases(part: str) -> list[str]:
    import importlib

    return list(importlib.import_module(f".{part}", __package__).CASES)


def _in_own_process(part: str, case: str, repeats: int) -> list[dict[str, object]]:
    """The rows of one case; a case that dies is one row that says so."""
    from .child import report

    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=report, args=(part, case, repeats, sender))
    child.start()
    sender.close()
    try:
        measured = receiver.recv()
    except EOFError:
        measured = [("failed", f"the process ended with status {child.exitcode}", "")]
    child.join()
    return [
        {
            "part": part,
            "case": case,
            "metric": metric,
            "value": float(f"{value:.4g}") if isinstance(value, float) else value,
            "unit": unit,
        }
        for metric, value, unit in measured
    ]


def _write(folder: Path, rows: list[dict[str, object]]) -> None:
    from ..provenance import commit, hardware, versions
    from ..results import replacing

    folder.mkdir(parents=True, exist_ok=True)
    with replacing(folder / "solver_speed.csv") as path, path.open("w", newline="") as file:
        table = csv.DictWriter(file, ["part", "case", "metric", "value", "unit"])
        table.writeheader()
        table.writerows(rows)
    facts = {
        "commit": commit(),
        "hardware": hardware(),
        "versions": versions(),
        "threads": 1,
    }
    with replacing(folder / "solver_speed.json") as path:
        path.write_text(json.dumps(facts, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main())
