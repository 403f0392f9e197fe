"""python -m reference_sim.simulate: a garment and an obstacle from files, a trajectory out.

Whatever else the simulator can do is a few lines of Python, see the function `reference_sim.simulate`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from reference_sim.cloth import Cloth, MeshError
from reference_sim.command_line import Parser, announce_compilation, command
from reference_sim.files.atomic_files import demand_writable_folder
from reference_sim.files.mesh_files import (
    join_seams,
    read_mesh,
    read_sequence,
    refuse_too_many,
    to_metres_y_up,
)
from reference_sim.material import Material

if TYPE_CHECKING:
    import numpy as np

    from reference_sim.obstacle import Obstacle

FRAMES_ALONE = 60  # of a garment that meets nothing, or an obstacle that stands still
EXAMPLES = """examples:
  python -m reference_sim.simulate sheet.obj --pins top --frames 90 -o sheet.vtkhdf
  python -m reference_sim.simulate shirt.obj --obstacle body.obj --obstacle-rest body.obj -o shirt.vtkhdf
  python -m reference_sim.simulate shirt.ply --units cm --up z --obstacle 'walk/body_*.ply' -o walk.vtkhdf
  python -m reference_sim.simulate skirt.obj --pins top --self-contact --material silk.toml -o skirt.vtkhdf

The output is in metres with y up, whatever the input was in; ParaView opens it.
Exit status: 0 all frames converged, 1 some frame did not, 2 bad input (nothing is written)."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of all options, with units."""
    parser = Parser(
        prog="python -m reference_sim.simulate",
        description="Simulate a cloth: backward Euler, every step minimised to a stated tolerance.",
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("garment", help="triangle mesh at rest: OBJ or PLY")
    add("-o", "--out", type=Path, required=True, metavar="OUT.vtkhdf", help="trajectory")
    add("--units", choices=("m", "cm", "mm", "in"), default="m", help="of all meshes (default m)")
    add("--up", choices=("y", "z"), default="y", help="up axis of all meshes (default y)")
    add("--pins", metavar="WHICH", help="vertices that are held, or ride on a moving obstacle beside them: "
        "'0,9,12', or 'top'")  # fmt: skip
    add("--weld", type=float, metavar="M",
        help="join vertices that are closer [m], before --pins counts them")  # fmt: skip
    add("--material", type=Path, metavar="FILE",
        help=".toml: young_modulus [Pa], poisson_ratio, thickness [m], density [kg/m^3], "
        "bending_stiffness [J] (default: the cotton of the SNUG paper)",
    )  # fmt: skip
    add("--obstacle", metavar="MESHES", help="closed mesh, or one per frame: a folder or a quoted glob")
    add("--obstacle-rest", metavar="MESH",
        help="the obstacle as the garment was made for it: cloth then meets only what lies near it there",
    )  # fmt: skip
    add("--self-contact", action="store_true", help="the cloth never crosses itself (needs ipctk)")
    add("--frames", type=int, metavar="N", help=f"default: those of the obstacle, or {FRAMES_ALONE}")
    add("--dt", type=float, default=1 / 30, metavar="S", help="time between frames [s] (default 1/30)")
    return parser


@command("simulate")
def main(arguments: Sequence[str] | None = None) -> int:
    """Read, simulate and write as the arguments say; return the exit status."""
    options = make_parser().parse_args(arguments)
    announce_compilation()
    path: Path = options.out
    if path.suffix.lower() != ".vtkhdf" or path.exists() or not path.parent.is_dir():
        raise ValueError(f"{path}: name a new file that ends in .vtkhdf, in a folder that exists")
    demand_writable_folder(path.parent)
    if options.frames is not None and options.frames < 2:
        raise ValueError(f"--frames {options.frames}: frame 0 is the start: give 2 or more")
    if options.self_contact and find_spec("ipctk") is None:
        raise ValueError("--self-contact: needs the package ipctk: pip install ipctk")
    if options.obstacle_rest and not options.obstacle:
        raise ValueError(
            f"--obstacle-rest {options.obstacle_rest}: is a pose of an obstacle: add --obstacle"
        )
    from reference_sim import energies
    from reference_sim.time_loop import simulate

    cloth, obstacle = read_cloth(options), read_obstacle(options) if options.obstacle else None
    terms = [energies.StretchStVK(cloth), energies.BendHinge(cloth), energies.Gravity(cloth)]
    if obstacle is not None:
        terms.append(energies.ContactPenalty(cloth))
    if options.self_contact:
        terms.append(energies.ContactBarrier(cloth))
    frames = options.frames
    if frames is None:
        frames = obstacle.frames if obstacle is not None and obstacle.frames > 1 else FRAMES_ALONE
    pins = cloth.rest_positions[cloth.pins]
    rides = obstacle.carrying(pins) if obstacle and obstacle.moves_beside(pins) else None
    motion = simulate(
        cloth, terms, dt=options.dt, frames=frames, obstacle=obstacle, pin_positions=rides,
        progress=path.name,
    )  # fmt: skip
    motion.save(path)
    fields = motion.frame_fields
    joules = [
        f"{name[7:]} {values[-1]:.3g}" for name, values in fields.items() if name.startswith("energy/")
    ]
    print(
        f"frames     {motion.frames} of {frames}, {int(fields['converged'].sum())} converged\n"
        f"status     {motion.status}{motion.reason and ': '}{motion.reason}\n"
        f"pins       {len(pins)} {'ride on the obstacle' if rides else 'stay in place'}\n"
        f"energies   {', '.join(joules)} J at the last frame\nwrote      {path}"
    )
    return 0 if motion.frames == frames and motion.status == "converged" else 1


def read_cloth(options: argparse.Namespace) -> Cloth:
    """Return the cloth of the garment's file. Raises ValueError that names file or option, and remedy."""
    material = Material.from_file(options.material) if options.material else Material()
    surface = read_mesh(options.garment)
    positions = to_metres_y_up(surface.positions, units=options.units, up=options.up)
    try:
        refuse_too_many(len(positions))
        if options.weld is not None:
            surface = join_seams(replace(surface, positions=positions), options.weld)
            positions = surface.positions
        return Cloth(positions, surface.faces, material, pins=choose_pins(options.pins, positions))
    except MeshError as error:
        raise ValueError(f"{options.garment}: {error}") from None


def choose_pins(choice: str | None, positions: np.ndarray) -> list[int]:
    """Return the vertices that `choice` names among positions (V, 3) [m, y up]: "0,9", or "top" (1 %)."""
    if choice is None:
        return []
    if choice == "top":
        height = positions[:, 1]
        if height.min() == height.max():
            raise ValueError(
                "--pins top: the mesh is level, all of it is its top: give --up, or vertices"
            )
        return (height >= height.max() - 0.01 * (height.max() - height.min())).nonzero()[0].tolist()
    numbers = [word.strip() for word in choice.split(",")]
    if not all(word.isdecimal() and int(word) < len(positions) for word in numbers):
        raise ValueError(
            f"--pins {choice!r}: give 'top', or vertices from 0 to {len(positions) - 1} as '0,9'"
        )
    return [int(word) for word in numbers]


def read_obstacle(options: argparse.Namespace) -> Obstacle:
    """Return the obstacle of its files. Raises ValueError that names the file, and the remedy."""
    # Its search for contact serves no cloth that meets nothing.
    from reference_sim.obstacle import Obstacle

    positions, surface = read_sequence(options.obstacle)
    axes, rest = {"units": options.units, "up": options.up}, None
    if path := options.obstacle_rest:
        as_made = read_mesh(path)
        if as_made.faces.tolist() != surface.faces.tolist():
            raise ValueError(f"{path}: other faces than {options.obstacle}: export both from one mesh")
        rest = to_metres_y_up(as_made.positions, **axes)
    try:
        return Obstacle(to_metres_y_up(positions, **axes), surface.faces, rest_positions=rest)
    except MeshError as error:
        raise ValueError(f"{options.obstacle}: {error}") from None


if __name__ == "__main__":
    sys.exit(main())

from reference_sim.time_loop import simulate  # noqa: E402

# An import would put this module in the place of the function `reference_sim.simulate`.
sys.modules[__name__] = simulate  # type: ignore[assignment]
