"""The options of benchmarks.run, those of a scene, which score and export take too, and their requests.

Light, so that --help answers at once.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.assets.inputs import FEWEST_FRAMES
from benchmarks.external.roll_out_option import HELP as ROLL_OUT_HELP
from benchmarks.external.roll_out_option import parse_roll_out
from benchmarks.plan.plan import PlanError
from benchmarks.plan.request import Request
from benchmarks.presets import PRESETS, find_preset
from reference_sim.command_line import Parser
from snug.garments.options import add_garment_options, demand_garment_file, make_garment_file
from snug.motion.options import add_motion_options, parse_motion_options
from snug.trained import FOLDER

PROGRAM = "benchmarks.run"
EXAMPLES = """examples:
  python -m benchmarks.run                                    garments, and a part of three other suites
  python -m benchmarks.run --trained                          the same without training
  python -m benchmarks.run --preset smoke                     everything once, tiny, about 2 minutes
  python -m benchmarks.run --suite garments -o reports/runs/mine
  python -m benchmarks.run --scenes hanging_sheet --methods simulation,newton-4
  python -m benchmarks.run --scenes 'tshirt/*' --methods snug,skinning,simulation --seeds 0,1,2
  python -m benchmarks.run --methods ./mine.py,snug,simulation --metrics ./my_metric.py
  python -m benchmarks.run --motions clips/ --test-motions 01_01
  python -m benchmarks.run --suite garments --methods 'simulation,skinning,snug,snug-without-*' \\
      --split validation                                        what each choice of the recipe does
  python -m benchmarks.run -o reports/runs/mine --dry-run     what is finished there, what would be run
  python -m benchmarks.run --motions library --motions mine.amc
  python -m benchmarks.run --motions mocap.bvh --motion-up z --repair
  python -m benchmarks.run --suite fabric --fabrics measured.csv     textile tests, also of your fabrics
  python -m benchmarks.run --body mine.npz --suite garments
  python -m benchmarks.run --scenes tshirt/kick --methods simulation,skinning --rollout mine=out.npz,ms=2.2
  python -m benchmarks.run --seeds 0,1,2 --scheduler tcp://10.0.0.1:8786
  python -m benchmarks.run --garment shirt.obj --garment-units cm --body mine.npz --suite garments

motions: without --motions the embedded library, whose motions train, validate or test (docs/protocol.md).
  With --motions the files replace the library; "library" among the paths keeps it. --test-motions and
  --validation-motions name those of these roles, all others train, but for the library's own validation
  and test motions, which never do. Without them the library's roles hold; of files alone the first by
  name tests and the others train; where no file is left to train on, the library trains. Files are
  brought to 30 frames per second, placed on the floor, arms spread clear of the torso, and cut to the
  preset's length.

a folder that holds a run is gone on with: what is finished there for the same inputs and code is taken
  as it is, the rest is done. A run that was killed is so taken up again. --only failed does again what
  failed, --fresh everything.

exit status: 0 when every cell ended as ok or as an explained skip (in extremes a failure reported with
  its reason is an accepted outcome); 1 when a cell, a training or a simulation failed: a line says why
  and the rest went on; 2 when the request cannot be met, also where another run is going on in the
  folder: one line says why and nothing is left behind; 130 when it was interrupted: what had ended is
  in the folder, whole, and the same command goes on from there."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of benchmarks.run."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Dress a body, simulate the ground truth, train the networks, compare all of them "
        "and write tables, figures and a PDF.",
        epilog=EXAMPLES,
    )
    add_scene_options(parser)
    add = parser.add_argument
    add("--suite", action="append", default=[], metavar="NAME",
        help="garments, speed, validation, extremes, shapes, fabric, engines or all, in full; "
        "repeat or separate by commas (default: garments, and a part of speed, validation and "
        "extremes)")  # fmt: skip
    file = "; a file (mine.py) means all that it declares"
    add(
        "--scenes",
        action="append",
        default=[],
        metavar="NAME,...",
        help=f"only these; patterns allowed{file}",
    )
    add(
        "--methods",
        action="append",
        default=[],
        metavar="NAME,...",
        help="only these; patterns and files as for scenes",
    )
    add("--metrics", action="append", default=[], metavar="FILE,...",
        help="files of metrics of your own, measured besides all others")  # fmt: skip
    add("--rollout", action="append", default=[], metavar="NAME=FILE", help=ROLL_OUT_HELP)
    add("--split", choices=("test", "validation"), default="test",
        help="motions that the suites measure: test (default), or validation, to choose recipes")  # fmt: skip
    add("--fabrics", metavar="FILE",
        help="measured fabrics, a CSV of density and bending, for suite fabric (docs/fabric.md)")  # fmt: skip
    add("--gauge", metavar="DIR",
        help="a copy of GAUGE-Dataset, whose fabrics suite fabric tests too (docs/fabric.md)")  # fmt: skip
    add("--seeds", default="0", metavar="N,...", help="seeds of training (default 0)")
    add("--device", default="cpu", metavar="cpu|cuda", help="where networks train (default cpu)")
    add("--trained", nargs="?", const=FOLDER, metavar="DIR", help="measure without training: networks of the "
        "package, or of the run in DIR; methods whose network is not there are skipped, those of your own "
        "files trained")  # fmt: skip
    add("-o", "--out", metavar="DIR", help="folder of the run (default: a new one under reports/runs/)")
    add("--only", action="append", default=[], metavar="STATE,...",
        help="tasks of the folder that are repeated: failed, stale or missing (default stale,missing); the "
        "others are reused")  # fmt: skip
    add("--fresh", action="store_true", help="reuse nothing from the folder")
    add("--workers", type=int, metavar="N",
        help="parallel processes for work that is not timed (default 2, or the number of cores if less); "
        "timed methods run alone")  # fmt: skip
    add("--scheduler", metavar="ADDRESS",
        help="a cluster of dask.distributed, as tcp://HOST:8786, for work that is not timed; timed methods "
        "run here (docs/scale.md)")  # fmt: skip
    add("--list", action="store_true", help="list suites, scenes, methods, motions and presets; run nothing")
    add("--dry-run", action="store_true", help="say what would be run and what is cached; write nothing")
    return parser


def add_scene_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of what a scene is made of; benchmarks.score and benchmarks.export take the same."""
    add = parser.add_argument
    names = ", ".join(preset.name for preset in PRESETS)
    add("--preset", default="quick", metavar="NAME", help=f"sizes of everything: {names} (default quick)")
    add("--motions", action="append", default=[], metavar="PATH",
        help="motion file (.npz, .bvh, .amc with .asf), folder, or the word library; repeatable")  # fmt: skip
    add_motion_options(add)
    add("--frames", type=int, metavar="N",
        help="measure at most N frames of a motion, at 30 a second (default: the preset's)")  # fmt: skip
    add("--test-motions", action="append", default=[], metavar="NAME,...", help="motions that test")
    add("--validation-motions", action="append", default=[], metavar="NAME,...",
        help="motions that validate; neither these nor those that test train a network")  # fmt: skip
    add(
        "--body",
        metavar="FILE",
        help="your own body of SMPL's family, .npz or .pkl, in place of the package's; garments are made for "
        "it (extreme cases of single steps keep the package's)",
    )
    add("--garment", metavar="FILE",
        help="your own garment (OBJ, PLY, VTK), made for the body, in place of the T-shirt; its scenes are "
        "<name of the file>/<motion>. python -m snug.check FILE tells whether it can be used")  # fmt: skip
    add_garment_options(parser)
    add("--self-contact", action="store_true",
        help="simulations of <garment>/<motion>, settling and training data included, keep the cloth from "
        "crossing itself (needs ipctk)")  # fmt: skip


def request_of_run(options: argparse.Namespace, command_line: Sequence[str]) -> Request:
    """Return the request of benchmarks.run.

    Args:
        options: of `make_parser`.
        command_line: the command line that they were parsed from.

    Raises:
        ValueError: one line for an option that means nothing.
    """
    return Request(
        command=shlex.join(["python", "-m", PROGRAM, *command_line]),
        suites=split(options.suite),
        scenes=split(options.scenes),
        methods=split(options.methods),
        metrics=split(options.metrics),
        roll_outs=tuple(map(parse_roll_out, options.rollout)),
        split=options.split,
        fabrics=Path(options.fabrics) if options.fabrics else None,
        gauge=Path(options.gauge) if options.gauge else None,
        seeds=parse_seeds(options.seeds),
        device=options.device,
        folder=Path(options.out) if options.out else None,
        only=split(options.only),
        fresh=options.fresh,
        workers=options.workers,
        scheduler=options.scheduler or "",
        trained=Path(options.trained) if options.trained else None,
        **scene_fields(options),
    )


def scene_fields(options: argparse.Namespace) -> dict[str, Any]:
    """Return the fields of a Request that the options of `add_scene_options` fill. Raises ValueError."""
    garment = None
    if options.garment is None:
        demand_garment_file(options)
    else:
        garment = make_garment_file(options.garment, options)
    preset = find_preset(options.preset)
    if options.frames is not None:
        if options.frames < FEWEST_FRAMES:
            raise PlanError(f"--frames {options.frames}: give {FEWEST_FRAMES} or more")
        preset = replace(preset, frames=options.frames)
    return {
        "preset": preset,
        "motions": tuple(options.motions),
        "motion_options": parse_motion_options(options),
        "test_motions": split(options.test_motions),
        "validation_motions": split(options.validation_motions),
        "self_contact": options.self_contact,
        "body": Path(options.body) if options.body else None,
        "garment": garment,
    }


def split(values: Sequence[str]) -> tuple[str, ...]:
    """Return repeated and comma-separated values one by one.

    >>> split(["snug,pbns", "skinning"])
    ('snug', 'pbns', 'skinning')
    """
    return tuple(word.strip() for value in values for word in value.split(",") if word.strip())


def parse_seeds(text: str) -> tuple[int, ...]:
    """Return whole numbers separated by commas, each once. Raises PlanError."""
    try:
        return tuple(dict.fromkeys(int(word) for word in split([text])))
    except ValueError:
        raise PlanError(f"--seeds '{text[:40]}': give whole numbers separated by commas") from None
