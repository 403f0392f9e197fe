"""Command `python -m snug.check`: tell whether garment files can be used, and what mends them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from reference_sim.command_line import Parser, command
from snug.file_options import GARMENT_WORDS, parse_garment_file

if TYPE_CHECKING:
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment

PROGRAM = "snug.check"
EXAMPLES = """examples:
  python -m snug.check shirt.obj                              on the body of the package
  python -m snug.check shirt.obj dress.ply --body mine.npz    on your own
  python -m snug.check shirt.obj,units=cm,up=z
  python -m snug.check shirt.obj,rest=uv                      its UV chart as rest shape

exit status: 0 all can be used, 1 one cannot, 2 bad words or body"""


def make_parser() -> argparse.ArgumentParser:
    """Make the parser of the command line."""
    parser = Parser(
        prog=f"python -m {PROGRAM}",
        description="Read garments as benchmarks.run and snug.train do, and print a short table: size, "
        "place on the body, rest shape, openings, or what mends them.",
        epilog=f"{EXAMPLES}\n\n{GARMENT_WORDS}",
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="OBJ or PLY")
    parser.add_argument(
        "--body", metavar="FILE", help="a body of your own (default: that of the package)"
    )
    return parser


def describe(garment: Garment, body: Body) -> Iterator[tuple[str, str]]:
    """Yield what a garment on a body is, by matter."""
    import numpy as np

    from reference_sim.files.mesh_files import stretches
    from reference_sim.geometry.topology import corner_angles
    from reference_sim.obstacle import Obstacle
    from snug.garments.garment import piece_of_faces

    positions, faces = garment.rest_positions, garment.faces
    distances = Obstacle(body.template, body.faces).signed_distance(positions, 0)
    yield "mesh", f"{len(positions)} vertices, {len(faces)} triangles"
    yield "pieces", f"{piece_of_faces(faces).max() + 1}"
    yield "smallest angle", f"{np.degrees(corner_angles(positions, faces).min()):.1f} degrees"
    yield "size", " x ".join(f"{length:.2f}" for length in np.ptp(positions, axis=0)) + " m"
    share, depth = np.mean(distances < 0), max(0.0, -distances.min())
    yield "below the skin", f"{share:.1%} of the vertices, the deepest by {1e3 * depth:.1f} mm"
    if garment.rest_uv is not None:
        strain = np.abs(stretches(positions[faces], garment.rest_uv) - 1).max()
        yield "UV chart", f"stretched by up to {strain:.0%} on the mesh"
    yield "openings", ", ".join(f"{name} ({len(loop)} vertices)" for name, loop in garment.loops.items())
    yield "pinned", f"{len(garment.pins)} vertices"


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    options = make_parser().parse_args(arguments)
    files = list(map(parse_garment_file, options.files))
    # NumPy and more, which --help does not need.
    from snug.body.smpl_files import read_body
    from snug.garments.garment import GarmentError
    from snug.garments.reading import read_garment

    body, status = read_body(options.body), 0
    for file in files:
        try:
            garment = read_garment(file, body)
        except GarmentError as error:
            print(f"{PROGRAM}: {error}", file=sys.stderr)
            status = 1
            continue
        print(f"{file.path}: can be used")
        for matter, text in describe(garment, body):
            print(f"  {matter:<18}{text}")
    return status


if __name__ == "__main__":
    sys.exit(main())
