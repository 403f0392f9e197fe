"""The command `python -m snug.check`: what will and what will not work of garments from files."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from reference_sim.command.command_line import Parser, command
from snug.garments.options import GarmentFile, add_garment_options, make_garment_file

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.fit import DressForm

PROGRAM = "snug.check"
USABLE, UNUSABLE, UNREADABLE = 0, 1, 2
MARKS = {"ok": "", "note": "note", "unusable": "NO"}
EXAMPLES = """examples:
  python -m snug.check shirt.obj                              on the body of the package
  python -m snug.check shirt.obj dress.ply --body mine.npz    on your own
  python -m snug.check shirt.obj --garment-units cm --garment-up z --picture shirt.png
  python -m snug.check shirt.obj --garment-rest uv            its UV chart as rest shape

beside a mesh: <name>.weights.npz with an array "weights" (V, 24), or the vertex properties weight_0 to
weight_23 of a PLY, are skinning weights that are kept as they are.

exit status: 0 all can be used, 1 one cannot, 2 one cannot be read"""


def make_parser() -> argparse.ArgumentParser:
    """The options of the command."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Read garments as benchmarks.run and snug.train do, and say in a short table what was "
        "found: size, place on the body, rest shape, winding, openings, weights, and what mends them.",
        epilog=EXAMPLES,
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="OBJ, PLY, VTK, STL or OFF")
    parser.add_argument("--body", metavar="FILE", help="an own body (default: that of the package)")
    parser.add_argument(
        "--picture", type=Path, metavar="OUT.png",
        help="a picture of the (last) garment on the body, what is below the skin in red",
    )  # fmt: skip
    add_garment_options(parser)
    return parser


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    options = make_parser().parse_args(arguments)
    files = [make_garment_file(path, options) for path in options.files]
    if options.picture and not options.picture.parent.is_dir():
        raise ValueError(f"--picture {options.picture}: no such folder")
    from snug.body.smpl_files import read_body
    from snug.garments.fit import DressForm

    body = read_body(options.body)
    wearer = DressForm(body)
    return max(_check(file, body, wearer, options.picture) for file in files)


def _check(file: GarmentFile, body: Body, wearer: DressForm, picture: Path | None) -> int:
    """Print the table of one file; its exit status."""
    from snug.garments.garment import GarmentError
    from snug.garments.reading import examine_file

    try:
        reading = examine_file(file, wearer, body)
    except GarmentError as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return UNREADABLE
    print(f"{file.path}: {'cannot be used' if reading.unusable else 'can be used'}")
    for finding in reading.findings:
        remedy = f"; {finding.remedy}" if finding.remedy else ""
        print(f"  {MARKS[finding.level]:<5}{finding.matter:<18}{finding.says}{remedy}")
    if picture and reading.surface is not None and reading.distances is not None:
        from snug.garments.picture import draw

        draw(picture, body, reading.surface, reading.distances)
        print(f"  {picture}")
    return UNUSABLE if reading.unusable else USABLE


if __name__ == "__main__":
    sys.exit(main())
