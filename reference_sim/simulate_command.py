"""The command of `reference_sim.simulate`: a garment and an obstacle from files, a trajectory out.

Whatever else the simulator can do is a few lines of Python, see `reference_sim.simulate` and REPLACED.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from reference_sim.command_line import Parser, announce_compilation, command

if TYPE_CHECKING:
    import numpy as np

    from reference_sim.cloth import Cloth
    from reference_sim.energies.energy import Energy
    from reference_sim.obstacle import Obstacle
    from reference_sim.trajectory import Trajectory

DONE, NOT_CONVERGED = 0, 1  # exit status
DEFAULT_FRAMES, DEFAULT_DT = 60, 1 / 30
FAR_FROM_OBSTACLE = 1.0  # [m] from which garment and obstacle hardly belong together
EXAMPLES = """examples:
  python -m reference_sim.simulate sheet.obj --pins top --frames 90 -o sheet.vtkhdf
  python -m reference_sim.simulate shirt.obj --obstacle body.obj --obstacle-rest body.obj -o shirt.vtkhdf
  python -m reference_sim.simulate shirt.ply --units cm --up z --obstacle 'walk/body_*.ply' \\
      --obstacle-rest tpose.ply --friction 0.3 -o shirt_walk.vtkhdf
  python -m reference_sim.simulate skirt.obj --pins top --self-contact --material silk.toml -o skirt.vtkhdf

The output is in metres with y up, whatever the input was in. ParaView opens it as it is; for Blender see
reference_sim.trajectory.write_point_cache.
Exit status: 0 all frames converged, 1 some frame did not, 2 bad input (nothing is written)."""
REPLACED = {  # former option -> what serves in its place
    f"--{option}": remedy
    for remedy, options in {
        "begin again, under a name that does not exist yet": "resume overwrite",
        "a line in the file of --material": "young-modulus poisson-ratio thickness density bending-stiffness",
        "write_point_cache('out.pc2', Trajectory.load('out.vtkhdf')) in Python": "pc2",
        "Cloth(..., rest_uv=rest_chart(surface, scale)) in Python": "rest uv-scale",
        "Obstacle(..., region=0.2) in Python": "region",
        "an argument of the energy of that name in Python": "bending-scaling rest-angles contact-stiffness "
        "contact-margin contact-samples barrier barrier-distance barrier-stiffness area-barrier",
        "simulate(..., substeps=2, tolerance=1e-8, method='newton') in Python": "substeps tolerance method "
        "max-iterations",
        "> /dev/null 2>&1": "quiet",
    }.items()
    for option in options.split()
}


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of all options, with units."""
    parser = Parser(
        prog="python -m reference_sim.simulate",
        description="Simulate a cloth: backward Euler, every step minimised to a stated tolerance.",
        epilog=EXAMPLES,
        replaced=REPLACED,
    )
    add = parser.add_argument
    add("garment", help="triangle mesh at rest: OBJ, PLY, VTK, STL or OFF")
    add("-o", "--out", type=Path, required=True, metavar="OUT.vtkhdf", help="trajectory")
    add("--units", choices=("m", "cm", "mm", "in"), default="m", help="of all meshes (default m)")
    add("--up", choices=("y", "z"), default="y", help="up axis of all meshes (default y)")
    add("--pins", metavar="WHICH",
        help="vertices held in place: '0,9,12', or 'top', or a box in metres with y up, as in 'y>1.4,x<0.1'",
    )  # fmt: skip
    add("--material", type=Path, metavar="FILE",
        help=".toml or .json: young_modulus [Pa], poisson_ratio, thickness [m], density [kg/m^3], "
        "bending_stiffness [J] (default: the cotton of the SNUG paper)",
    )  # fmt: skip
    add("--obstacle", metavar="MESHES",
        help="closed mesh, or one per frame: a folder, a quoted glob, a VTKHDF trajectory (in metres, y up)",
    )  # fmt: skip
    add("--obstacle-rest", metavar="MESH",
        help="the obstacle as the garment was made for it: cloth then meets only what lies near it there",
    )  # fmt: skip
    add("--friction", type=_number, default=0.0, metavar="MU",
        help="coefficient of the obstacle (default 0)",
    )  # fmt: skip
    add("--self-contact", action="store_true",
        help="the cloth never crosses itself: IPC's barrier, without friction (needs ipctk)",
    )  # fmt: skip
    add("--frames", type=_count, metavar="N", help=f"default: those of the obstacle, or {DEFAULT_FRAMES}")
    add("--dt", type=_number, metavar="S",
        help="time between frames, as 0.02 or 1/60 (default: that of an obstacle's trajectory, or 1/30)",
    )  # fmt: skip
    return parser


def _number(text: str) -> float:
    """Read a number from 0 on, or a fraction such as 1/60."""
    try:
        value = float(Fraction(text)) if "/" in text else float(text)
    except (ValueError, ArithmeticError):
        value = -1.0
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is no number from 0 on")
    return value


def _count(text: str) -> int:
    if not re.fullmatch("[1-9][0-9]{0,8}", text):
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is no whole number from 1 to 999999999")
    return int(text)


@command("simulate", goes_on="the output has the frames until then")
def main(arguments: Sequence[str] | None = None) -> int:
    """Read, simulate and write as the arguments say; return the exit status.

    Raises:
        ValueError: bad input, before anything is written; the message names file, element and remedy.
        OSError: a file cannot be read or written.
    """
    options = make_parser().parse_args(arguments)
    announce_compilation()
    _check_options(options)
    from reference_sim.time_loop import simulate

    cloth = read_cloth(options)
    obstacle, obstacle_dt = read_obstacle(cloth, options)
    frames = options.frames
    if frames is None:
        frames = obstacle.frames if obstacle is not None and obstacle.frames > 1 else DEFAULT_FRAMES
    dt = options.dt if options.dt is not None else obstacle_dt or DEFAULT_DT
    trajectory = simulate(
        cloth, make_terms(cloth, options), dt=dt, frames=frames, obstacle=obstacle, path=options.out,
        progress=options.out.name,
    )  # fmt: skip
    print(f"{summarise(trajectory, frames)}\nwrote      {options.out}", flush=True)
    whole = trajectory.frames == frames and trajectory.status == "converged"
    return DONE if whole else NOT_CONVERGED


def _check_options(options: argparse.Namespace) -> None:
    """Refuse what could not be written, or has no meaning, before any work."""
    path = options.out
    if path.suffix.lower() not in (".vtkhdf", ".hdf"):
        raise ValueError(f"{path}: the trajectory ends in .vtkhdf")
    if path.exists():
        raise ValueError(f"{path} exists: remove it, or choose another name")
    if not path.parent.is_dir():
        raise ValueError(f"{path.parent}: no such folder to write {path.name} in")
    if options.obstacle is None and (options.obstacle_rest or options.friction):
        raise ValueError("--obstacle-rest and --friction need an --obstacle")


def read_cloth(options: argparse.Namespace) -> Cloth:
    """Return the cloth of the garment's file, its pins and material.

    Raises:
        ValueError: a file, an option or the mesh is no good; the message names it and the remedy.
    """
    from reference_sim.cloth import Cloth, MeshError
    from reference_sim.files.mesh_files import read_mesh, to_metres_y_up
    from reference_sim.material import Material

    material = Material.from_file(options.material) if options.material else Material()
    surface = read_mesh(options.garment)
    positions = to_metres_y_up(surface.positions, units=options.units, up=options.up)
    pins = choose_pins(options.pins, positions)
    if len(pins) == len(positions):
        raise ValueError(f"--pins {options.pins!r} holds every vertex of {options.garment}: choose fewer")
    size = float((positions.max(axis=0) - positions.min(axis=0)).max())
    if not 0.02 < size < 20:
        print(f"note: {options.garment} measures {size:.3g} m: is --units {options.units} right?")
    try:
        return Cloth(positions, surface.faces, material, pins=pins)
    except MeshError as error:
        raise ValueError(f"{options.garment}: {error}") from None


def choose_pins(which: str | None, positions: np.ndarray) -> np.ndarray:
    """Return indices (P,) of the vertices that `which` names among positions (V, 3) [m, y up].

    "0,9,12" are indices; "top" is what lies within 1 % of the height from the highest vertex; anything else
    is a box, comparisons joined by commas.

    Raises:
        ValueError: not understood, an index out of range, or nothing chosen.
    """
    import numpy as np

    if which is None:
        return np.zeros(0, dtype=np.int64)
    height = positions[:, 1]
    if which == "top":
        return np.flatnonzero(height >= height.max() - 0.01 * (height.max() - height.min()))
    parts = [part.strip() for part in which.split(",")]
    if all(re.fullmatch(r"\d{1,18}", part, re.ASCII) for part in parts):
        indices = np.array([int(part) for part in parts])
        if indices.max() >= len(positions):
            raise ValueError(f"--pins {indices.max()}: the garment has vertices 0..{len(positions) - 1}")
        return indices
    chosen = np.ones(len(positions), dtype=bool)
    for part in parts:
        match = re.fullmatch(r"([xyz])\s*([<>])=?\s*([-+]?\d*\.?\d+)", part)
        if match is None:
            raise ValueError(f"--pins {which!r}: give indices, 'top', or a box such as 'y>1.4,x<0.1'")
        along, bound = positions[:, "xyz".index(match[1])], float(match[3])
        chosen &= along >= bound if match[2] == ">" else along <= bound
    if not chosen.any():
        low, high = positions.min(axis=0).round(3).tolist(), positions.max(axis=0).round(3).tolist()
        raise ValueError(f"--pins {which!r}: no vertex in this box; the garment spans {low} to {high} m")
    return np.flatnonzero(chosen)


def read_obstacle(cloth: Cloth, options: argparse.Namespace) -> tuple[Obstacle | None, float | None]:
    """Return the obstacle, and the time between its frames [s] where it is a trajectory; None without one.

    Raises:
        ValueError: a file or the mesh is no good; the message names it and the remedy.
    """
    if options.obstacle is None:
        return None, None
    from reference_sim.cloth import MeshError
    from reference_sim.files.mesh_files import read_mesh, read_sequence, to_metres_y_up
    from reference_sim.obstacle import Obstacle  # its search for contact serves no cloth that meets nothing
    from reference_sim.trajectory import TRAJECTORY_SUFFIXES, Trajectory

    axes = {"units": options.units, "up": options.up}
    rest, dt = None, None
    if options.obstacle.lower().endswith(TRAJECTORY_SUFFIXES):
        moving = Trajectory.load(options.obstacle)
        positions, faces = moving.positions, moving.faces
        dt = moving.dt if moving.frames > 1 else None
    else:
        positions, surface = read_sequence(options.obstacle)
        positions, faces = to_metres_y_up(positions, **axes), surface.faces
    if options.obstacle_rest:
        rest_surface = read_mesh(options.obstacle_rest)
        if rest_surface.faces.shape != faces.shape or (rest_surface.faces != faces).any():
            remedy = "export both from one mesh"
            raise ValueError(f"{options.obstacle_rest}: other faces than {options.obstacle}: {remedy}")
        rest = to_metres_y_up(rest_surface.positions, **axes)
    try:
        obstacle = Obstacle(positions, faces, rest_positions=rest)
    except MeshError as error:
        raise ValueError(f"{options.obstacle}: {error}") from None
    distance = obstacle.signed_distance(cloth.rest_positions, 0)
    if distance.min() > FAR_FROM_OBSTACLE:
        print(f"note: the garment starts {distance.min():.2g} m from the obstacle: same units and up axis?")
    elif distance.min() < 0:
        depth = f"vertex {distance.argmin()} {-1e3 * distance.min():.0f} mm deep"
        print(f"note: the garment starts with {(distance < 0).sum()} vertices in the obstacle, {depth}")
    return obstacle, dt


def make_terms(cloth: Cloth, options: argparse.Namespace) -> list[Energy]:
    """Return the terms of Phi in the order of the tables. Raises ValueError without the barrier's package."""
    from reference_sim import energies

    terms: list[Energy] = [energies.StretchStVK(cloth), energies.BendHinge(cloth), energies.Gravity(cloth)]
    if options.obstacle:
        terms.append(contact := energies.ContactPenalty(cloth))
        if options.friction:
            terms.append(energies.ContactFriction(contact, coefficient=options.friction))
    if options.self_contact:
        try:
            terms.append(energies.ContactBarrier(cloth))
        except ImportError as error:
            raise ValueError(str(error)) from None
    return terms


def summarise(trajectory: Trajectory, frames: int) -> str:
    """Return lines on convergence, energies [J] at the last frame, and time; of `frames` that were due."""
    fields = trajectory.frame_fields
    converged, worst = int(fields["converged"][1:].sum()), max(fields["gradient_norm"][1:], default=0.0)
    energies = [f"{name[7:]} {fields[name][-1]:.3g}" for name in fields if name.startswith("energy/")]
    return (
        f"frames     {trajectory.frames} of {frames}; {converged} of {frames - 1} steps converged, "
        f"worst relative residual {worst:.1e}\n"
        f"status     {trajectory.status}{trajectory.reason and ': '}{trajectory.reason}\n"
        f"energies   {', '.join(energies)} J at the last frame\n"
        f"time       {trajectory.frame_seconds[1:].sum():.1f} s"
    )
