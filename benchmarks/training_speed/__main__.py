"""python -m benchmarks.training_speed: how fast networks train and run, up to the paper's scale.

Every case runs in a process of its own, one after another, on one thread. No test asserts a time: it belongs
to the machine that it was taken on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from ..clock import one_thread
from ..parts import chosen, described, make_folder, run_parts
from .settings import VALIDATION, Settings

PARTS = {
    "step": "a training step and its parts: SNUG, supervised, PBNS at 500 to 4400 vertices",
    "inference": "a frame at a time on one CPU core, network and skinning; memory of each network",
    "convergence": f"SNUG trained at 4400 vertices, rolled out on a training motion held out ({VALIDATION})",
}
EXAMPLES = """examples:
  python -m benchmarks.training_speed                               everything (a quarter of an hour on a CPU)
  python -m benchmarks.training_speed --parts inference --repeats 20 -o reports/runs/inference
  python -m benchmarks.training_speed --device cuda -o reports/runs/training_speed_gpu
  python -m benchmarks.training_speed --parts convergence --steps 60000      preset paper's length

The results in a folder are those of its last run alone. An interrupt leaves the rows measured until then.
A convergence that was killed goes on from its last checkpoint when the same command is given again.
python -m reports.convergence DIR draws its curve."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the parts asked for; 0 when all ran, 1 when one failed, 2 for a wrong word, 130 if interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.training_speed",
        description="Benchmark of training and of trained networks." + described(PARTS),
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--parts", default=",".join(PARTS), metavar="NAME,...", help="default: all")
    add("--device", default="cpu", metavar="cpu|cuda",
        help="where networks train; a frame at a time is always the CPU's (default: cpu)")  # fmt: skip
    add("--repeats", type=int, default=5, metavar="N",
        help="blocks of 20 steps, roll-outs of 120 frames (default: %(default)s)")  # fmt: skip
    add("--steps", type=int, default=6000, metavar="N", help="of convergence (default: %(default)s)")
    add("-o", "--out", default="reports/runs/training_speed", metavar="DIR",
        help="for training_speed.csv and .json, curve and network (default: %(default)s)")  # fmt: skip
    options = parser.parse_args(arguments)
    one_thread()
    folder = Path(options.out)
    try:
        parts = chosen(options.parts, PARTS)
        if options.repeats < 1 or options.steps < 1:
            raise ValueError("--repeats and --steps: at least 1")
        from snug.device import find_device

        settings = Settings(
            device=find_device(options.device).type, repeats=options.repeats, steps=options.steps,
            folder=folder,
        )  # fmt: skip
        make_folder(folder)
    except ValueError as error:
        print(f"benchmarks.training_speed: {error}", file=sys.stderr)
        return 2
    status = run_parts(
        "benchmarks.training_speed", parts, settings, folder, device=settings.device,
        configuration=_configuration(parts, settings),
    )  # fmt: skip
    print(folder.resolve())
    return status


def _configuration(parts: Sequence[str], settings: Settings) -> dict[str, object]:
    from snug.motion_library import TRAIN
    from snug.recipe import DEFAULT

    return {
        "parts": list(parts), "device": settings.device, "repeats": settings.repeats, "steps": settings.steps,
        "motions": list(TRAIN), "held_out": VALIDATION, "recipe": DEFAULT.as_dict(), "seed": 0,
        "dtype": "float32",
    }  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
