"""The flags of `python -m reference_sim.simulate`, with units. Light, so that --help answers at once."""

from __future__ import annotations

import argparse
import math
from dataclasses import fields
from fractions import Fraction
from pathlib import Path

from reference_sim.command.command_line import Parser
from reference_sim.material import Material

DEFAULT_FRAMES, DEFAULT_DT = 60, 1 / 30
DIGITS = 9  # of a count
UNITS_OF_MATERIAL = {
    "young_modulus": ("PA", "Young's modulus [Pa]"),
    "poisson_ratio": ("NU", "Poisson's ratio, in (-1, 0.5]"),
    "thickness": ("M", "thickness [m]"),
    "density": ("KG_M3", "volume density [kg/m^3]; times the thickness it is the areal density"),
    "bending_stiffness": ("J", "k of the hinges [J]"),
}
EXAMPLES = """examples:
  python -m reference_sim.simulate sheet.obj --pins top --frames 90 -o sheet.vtkhdf
  python -m reference_sim.simulate shirt.obj --obstacle body.obj --obstacle-rest body.obj -o shirt.vtkhdf
  python -m reference_sim.simulate shirt.ply --units cm --up z --obstacle 'walk/body_*.ply' \\
      --obstacle-rest tpose.ply --pc2 shirt_walk.pc2 -o shirt_walk.vtkhdf
  python -m reference_sim.simulate shirt.obj --obstacle walk/ -o out.vtkhdf --resume     # after a kill
  python -m reference_sim.simulate shirt.obj --rest uv --material silk.toml -o shirt.vtkhdf
  python -m reference_sim.simulate skirt.obj --pins top --self-contact -o skirt.vtkhdf

The output is in metres with y up, whatever the input was in. ParaView opens the .vtkhdf as it is; Blender
takes the .obj beside the .pc2 and a Mesh Cache modifier.
Exit status: 0 all frames converged, 1 some frame did not, 2 bad input (nothing is written)."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of all flags, with units."""
    parser = Parser(
        prog="python -m reference_sim.simulate",
        description="Simulate a cloth: backward Euler, every step minimised to a stated tolerance.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("garment", help="triangle mesh at rest: OBJ, PLY, VTK, STL or OFF")
    add("-o", "--output", type=Path, required=True, metavar="OUT.vtkhdf", help="trajectory")
    add("--pc2", type=Path, metavar="OUT.pc2", help="also a point cache, with OUT.obj beside it")
    add = parser.add_mutually_exclusive_group().add_argument
    add("--resume", action="store_true", help="go on after the last whole frame of OUT.vtkhdf")
    add("--overwrite", action="store_true", help="replace outputs that exist")
    _add_meshes(parser)
    _add_material(parser)
    _add_contact(parser)
    _add_solver(parser)
    return parser


def _add_meshes(parser: argparse.ArgumentParser) -> None:
    """Add what the meshes are, in which units, and which vertices are pinned."""
    add = parser.add_argument_group("meshes").add_argument
    add("--units", choices=("m", "cm", "mm", "in"), default="m", help="of all meshes (default m)")
    add("--up", choices=("y", "z"), default="y", help="up axis of all meshes (default y)")
    add("--rest", choices=("mesh", "uv"), default="mesh",
        help="what has no strain: the garment's mesh itself (default), or its UV chart, the sewing pattern",
    )  # fmt: skip
    add("--uv-scale", type=_positive, metavar="M", help="metres per unit of the chart (default: as --units)")
    add("--obstacle", metavar="MESHES",
        help="closed mesh, or one per frame: a folder, a quoted glob, a VTKHDF trajectory (in metres, y up)",
    )  # fmt: skip
    add("--obstacle-rest", metavar="MESH",
        help="the obstacle as the garment was made for it: cloth then meets only what lies near it there",
    )  # fmt: skip
    add("--region", type=_positive, default=0.20, metavar="M", help="how near [m] (default 0.20)")
    add("--pins", metavar="WHICH",
        help="vertices held in place: '0,9,12', or 'top', or a box in metres with y up, as in 'y>1.4,x<0.1'",
    )  # fmt: skip


def _add_material(parser: argparse.ArgumentParser) -> None:
    """Add the numbers of the material, in a file or one by one, and how hinges use them."""
    add = parser.add_argument_group("material (default: the cotton of the SNUG paper)").add_argument
    add("--material", type=Path, metavar="FILE",
        help=".toml or .json of the values below; those given below come first",
    )  # fmt: skip
    for parameter in fields(Material):
        unit, meaning = UNITS_OF_MATERIAL[parameter.name]
        flag, text = "--" + parameter.name.replace("_", "-"), f"{meaning} (default {parameter.default:g})"
        add(flag, type=_number, metavar=unit, help=text)
    add("--bending-scaling", choices=("length_area", "none"), default="length_area",
        help="length_area: k/2 theta^2 times l^2/(4 (A1 + A2)) (default); none: as the SNUG paper prints it, "
        "without",
    )  # fmt: skip
    add("--rest-angles", choices=("flat", "rest"), default="flat", help="hinges at rest (default flat)")


def _add_contact(parser: argparse.ArgumentParser) -> None:
    """Add penalty with friction, barrier and self-contact."""
    add = parser.add_argument_group("contact").add_argument
    add("--contact-stiffness", type=_positive, metavar="J_M5", help="of the penalty [J/m^5] (default 3.4e6)")
    add("--contact-margin", type=_positive, metavar="M", help="of the penalty [m] (default 0.004)")
    add("--contact-samples", choices=("all", "vertices"),
        help="all: vertices, edge midpoints and centroids (default)",
    )  # fmt: skip
    add("--friction", type=_not_negative, default=0.0, metavar="MU",
        help="coefficient of the penalty's friction, of cloth on the obstacle (default 0)",
    )  # fmt: skip
    add("--barrier", action="store_true",
        help="IPC's barrier in place of the penalty: nothing passes, twelve times the time (needs ipctk)",
    )  # fmt: skip
    add("--self-contact", action="store_true",
        help="the cloth never crosses itself: a barrier, beside the penalty or with --barrier (needs ipctk)",
    )  # fmt: skip
    add("--barrier-distance", type=_positive, metavar="M", help="where it begins [m] (default 0.002)")
    add("--barrier-stiffness", type=_positive, metavar="PA", help="its pressure [Pa] (default 100)")
    add("--area-barrier", type=_not_negative, default=0.0, metavar="J_M2",
        help="keeps triangles from collapsing [J/m^2]; 100 is enough (default 0: none)",
    )  # fmt: skip


def _add_solver(parser: argparse.ArgumentParser) -> None:
    """Add time steps, the minimiser, and what is printed."""
    add = parser.add_argument_group("time and solver").add_argument
    add("--dt", type=_positive, metavar="S",
        help="time between frames, as 0.02 or 1/60 (default: that of an obstacle's trajectory, or 1/30)",
    )  # fmt: skip
    add("--frames", type=_count, metavar="N", help=f"default: those of the obstacle, or {DEFAULT_FRAMES}")
    add("--substeps", type=_count, default=1, metavar="N", help="steps per frame (default 1)")
    add("--tolerance", type=_positive, default=1e-6, metavar="W",
        help="relative residual: largest force left, in mean vertex weights (default 1e-6)",
    )  # fmt: skip
    add("--method", choices=("newton", "lbfgs"),
        help="lbfgs, finished by newton (default), or newton alone (default with a barrier)",
    )  # fmt: skip
    add("--max-iterations", type=_count, metavar="N", help="per step (default 300 of newton, 500 of lbfgs)")
    add("--quiet", action="store_true", help="no progress bar, no summary")


def _number(text: str) -> float:
    """Read a number or a fraction such as 1/60."""
    try:
        value = float(Fraction(text)) if "/" in text else float(text)
    except (ValueError, ZeroDivisionError):
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not finite")
    return value


def _not_negative(text: str) -> float:
    value = _number(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below 0")
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def _count(text: str) -> int:
    if len(text) > DIGITS:
        raise argparse.ArgumentTypeError(f"{text[:40]!r} has more than {DIGITS} digits")
    if not (text.isascii() and text.isdigit()) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number above 0")
    return int(text)
