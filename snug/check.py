"""Command `python -m snug.check`: tell whether garments from files can be used, and what mends them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from reference_sim.command_line import Parser, command
from snug.file_options import GARMENT_WORDS, parse_garment_file

PROGRAM = "snug.check"
USABLE, UNUSABLE, UNREADABLE = 0, 1, 2
LEVEL_MARKS = {"ok": "", "note": "note", "unusable": "NO"}
EXAMPLES = """examples:
  python -m snug.check shirt.obj                              on the body of the package
  python -m snug.check shirt.obj dress.ply --body mine.npz    on your own
  python -m snug.check shirt.obj,units=cm,up=z
  python -m snug.check shirt.obj,rest=uv                      its UV chart as rest shape

beside a mesh: <name>.weights.npz with an array "weights" (V, 24) has skinning weights, which are kept as
they are.

exit status: 0 all can be used, 1 one cannot, 2 one cannot be read"""


def make_parser() -> argparse.ArgumentParser:
    """Make the parser of the command line."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Read garments as benchmarks.run and snug.train do, and print a short table: size, "
        "place on the body, rest shape, winding, openings, weights, and what mends them.",
        epilog=f"{EXAMPLES}\n\n{GARMENT_WORDS}",
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="OBJ, PLY, VTK, STL or OFF")
    parser.add_argument("--body", metavar="FILE", help="a body of your own (default: that of the package)")
    return parser


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    options = make_parser().parse_args(arguments)
    files = list(map(parse_garment_file, options.files))
    # NumPy and more, which --help does not need.
    from snug.body.smpl_files import read_body
    from snug.garments.fit import DressForm
    from snug.garments.garment import GarmentError
    from snug.garments.reading import examine_file

    form, status = DressForm(read_body(options.body)), USABLE
    for file in files:
        try:
            examination = examine_file(file, form)
        except GarmentError as error:
            print(f"{PROGRAM}: {error}", file=sys.stderr)
            status = UNREADABLE
            continue
        print(f"{file.path}: {'cannot be used' if examination.unusable else 'can be used'}")
        for finding in examination.findings:
            remedy = f"; {finding.remedy}" if finding.remedy else ""
            print(f"  {LEVEL_MARKS[finding.level]:<5}{finding.matter:<18}{finding.text}{remedy}")
        status = max(status, UNUSABLE if examination.unusable else USABLE)
    return status


if __name__ == "__main__":
    sys.exit(main())
