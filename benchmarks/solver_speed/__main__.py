"""python -m benchmarks.solver_speed: the simulator's own benchmark.

Times are medians, of part left_out minima; compare ratios. Every part runs in a process of its own, one after
another, so that its peak memory is its own and nothing runs beside it. No test asserts a time: it belongs to
the machine that it was taken on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from ..clock import one_thread
from ..parts import chosen, described, make_folder, run_parts

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
    """Run the parts asked for; 0 when all ran, 1 when one failed, 2 for a wrong word, 130 if interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.solver_speed",
        description="Benchmark of the reference simulator." + described(PARTS),
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--parts", default=",".join(PARTS), metavar="NAME,...", help="default: all")
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="runs of each case (default 5)")
    parser.add_argument("-o", "--out", metavar="DIR", help="also write solver_speed.csv and .json there")
    options = parser.parse_args(arguments)
    folder = Path(options.out) if options.out else None
    try:
        parts = chosen(options.parts, PARTS)
        if options.repeats < 1:
            raise ValueError("--repeats: at least 1")
        if folder is not None:
            make_folder(folder)
    except ValueError as error:
        print(f"benchmarks.solver_speed: {error}", file=sys.stderr)
        return 2
    one_thread()
    return run_parts("benchmarks.solver_speed", parts, options.repeats, folder)


if __name__ == "__main__":
    sys.exit(main())
