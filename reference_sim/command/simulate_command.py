"""The command `python -m reference_sim.simulate`: a garment and an obstacle from files, a trajectory out.

What only a run needs is imported when it runs, so that --help answers at once.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from reference_sim.command.simulate_options import DEFAULT_DT, DEFAULT_FRAMES, make_parser
from reference_sim.command.simulate_terms import contradiction, terms
from reference_sim.material import Material

if TYPE_CHECKING:
    from argparse import Namespace

    import numpy as np

    from reference_sim.cloth import Cloth
    from reference_sim.obstacle import Obstacle

FAR = 1.0  # [m] from which garment and obstacle hardly belong together
DONE, NOT_CONVERGED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


class InputError(ValueError):
    """Bad input, in one line that names file, element and remedy."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status."""
    options = make_parser().parse_args(arguments)
    try:
        return _run(options)
    except (ValueError, OSError) as error:
        from reference_sim.files.atomic_files import disk_full

        if line := disk_full(error):
            print(f"simulate: {line}; --resume goes on from it once there is room", file=sys.stderr)
            return NOT_CONVERGED
        print(f"simulate: {' '.join(str(error).split())}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"simulate: interrupted; --resume goes on from {options.output}", file=sys.stderr)
        return INTERRUPTED


def _run(options: Namespace) -> int:
    _check_paths(options)
    if options.uv_scale and options.rest != "uv":
        raise InputError(f"--uv-scale {options.uv_scale:g} is for a rest shape from UV: add --rest uv")
    if text := contradiction(options):
        raise InputError(text)
    cloth = _read_cloth(options)
    obstacle, own = _read_obstacle(cloth, options)
    frames = options.frames
    if frames is None:
        frames = obstacle.frames if obstacle is not None and obstacle.frames > 1 else DEFAULT_FRAMES
    dt = options.dt or own or DEFAULT_DT
    if own and abs(dt - own) > 1e-6 * own:
        _say(f"note: {options.obstacle} has {own:.4g} s between frames, and --dt is {dt:.4g}")
    from reference_sim.command.summary import predicted_stretch, summary
    from reference_sim.time_loop import simulate

    stretch, note = predicted_stretch(cloth)
    if note:
        _say(f"note: {note}")
    if options.resume and not options.output.exists():
        _say(f"note: {options.output} does not exist yet: starting at the beginning")
    given = {"method": options.method, "max_iterations": options.max_iterations}
    chosen = {name: value for name, value in given.items() if value is not None}
    trajectory = simulate(
        cloth,
        terms(cloth, options),
        dt=dt,
        frames=frames,
        obstacle=obstacle,
        substeps=options.substeps,
        path=options.output,
        resume=options.resume,
        progress=None if options.quiet else options.output.name,
        tolerance=options.tolerance,
        **chosen,
    )
    written = [options.output]
    if options.pc2:
        from reference_sim.trajectory.point_cache import write_point_cache

        written += write_point_cache(options.pc2, trajectory)
    if not options.quiet:
        _say(summary(trajectory, obstacle, frames=frames))
        _say(stretch)
        _say(f"wrote      {', '.join(map(str, written))}")
    whole = trajectory.frames == frames and trajectory.status == "converged"
    return DONE if whole else NOT_CONVERGED


def _check_paths(options: Namespace) -> None:
    """Refuse what could not be written, or would destroy an input, before any work."""
    from reference_sim.trajectory.trajectory import SUFFIXES

    if options.output.suffix.lower() not in SUFFIXES:
        raise InputError(f"{options.output}: the trajectory ends in .vtkhdf")
    if options.output.exists() and not (options.resume or options.overwrite):
        raise InputError(f"{options.output} exists: add --resume to go on with it, --overwrite to replace it")
    outputs = [options.output]
    if options.pc2:
        if options.pc2.suffix.lower() != ".pc2":
            raise InputError(f"{options.pc2}: a point cache ends in .pc2")
        outputs += [options.pc2, options.pc2.with_suffix(".obj")]
    from reference_sim.files.mesh_files import mesh_paths

    inputs = [Path(p).resolve() for p in (options.garment, options.obstacle_rest) if p]
    if options.obstacle:
        inputs += [path.resolve() for path in mesh_paths(options.obstacle)]
    for path in outputs:
        if not path.parent.is_dir():
            raise InputError(f"{path.parent}: no such folder to write {path.name} in")
        if path.resolve() in inputs:
            raise InputError(f"{path} would replace an input: choose another name")
        if path != options.output and path.exists() and not (options.resume or options.overwrite):
            raise InputError(f"{path} exists: add --overwrite to replace it")


def _read_cloth(options: Namespace) -> Cloth:
    import numpy as np

    from reference_sim.cloth import Cloth, MeshError
    from reference_sim.files.mesh_files import METRES, read_mesh, to_metres_y_up
    from reference_sim.files.uv_chart import join_seams, rest_chart

    material = Material.from_file(options.material) if options.material else Material()
    given = {parameter.name: getattr(options, parameter.name) for parameter in fields(Material)}
    material = replace(material, **{name: value for name, value in given.items() if value is not None})
    surface = read_mesh(options.garment)
    positions = to_metres_y_up(surface.positions, units=options.units, up=options.up)
    pins, chart = choose_pins(options.pins, positions), None
    if options.rest == "uv":
        surface, kept, now = join_seams(replace(surface, positions=positions))
        if len(kept) < len(positions):
            _say(f"note: {options.garment}: {len(positions) - len(kept)} doubled vertices joined along seams")
            pins = np.unique(now[pins])  # chosen by their numbers in the file
        positions = surface.positions
        try:
            chart = rest_chart(surface, options.uv_scale or METRES[options.units])
        except MeshError as error:
            raise InputError(f"{options.garment}: {error}") from None
    if surface.quads:
        _say(f"note: {options.garment}: {surface.quads} quads cut into triangles")
    if options.up == "z":
        _say("note: meshes turned from z up to y up, (x, y, z) -> (x, z, -y)")
    size = float((positions.max(axis=0) - positions.min(axis=0)).max())
    if not 0.02 < size < 20:
        _say(f"note: {options.garment} measures {size:.3g} m: is --units {options.units} right?")
    if len(pins) == len(positions):
        raise InputError(f"--pins {options.pins!r} holds every vertex of {options.garment}: choose fewer")
    try:
        return Cloth(positions, surface.faces, material, pins=pins, rest_uv=chart)
    except MeshError as error:
        raise InputError(f"{options.garment}: {error}") from None


def choose_pins(which: str | None, positions: np.ndarray) -> np.ndarray:
    """Indices of the vertices that `which` names among positions (V, 3) [m, y up].

    "0,9,12" are indices; "top" is what lies within 1 % of the height from the highest vertex; anything else
    is a box, comparisons joined by commas.

    Raises:
        InputError: not understood, an index out of range, or nothing chosen.
    """
    import numpy as np

    if which is None:
        return np.zeros(0, dtype=np.int64)
    height = positions[:, 1]
    if which == "top":
        return np.flatnonzero(height >= height.max() - 0.01 * (height.max() - height.min()))
    parts = [part.strip() for part in which.split(",")]
    if all(re.fullmatch(r"\d+", part) for part in parts):
        indices = np.array([int(part) for part in parts])
        if indices.max() >= len(positions):
            raise InputError(f"--pins {indices.max()}: the garment has vertices 0..{len(positions) - 1}")
        return indices
    chosen = np.ones(len(positions), dtype=bool)
    for part in parts:
        match = re.fullmatch(r"([xyz])\s*([<>])=?\s*(\S+)", part)
        try:
            axis, sign, bound = match.groups()  # type: ignore[union-attr]
            value = float(bound)
        except (AttributeError, ValueError):
            raise InputError(
                f"--pins {which!r}: give indices, 'top', or a box such as 'y>1.4,x<0.1'"
            ) from None
        along = positions[:, "xyz".index(axis)]
        chosen &= along >= value if sign == ">" else along <= value
    if not chosen.any():
        low, high = positions.min(axis=0).round(3).tolist(), positions.max(axis=0).round(3).tolist()
        raise InputError(
            f"--pins {which!r}: no vertex in this box; the garment spans {low} to {high} m, y up"
        )
    return np.flatnonzero(chosen)


def _read_obstacle(cloth: Cloth, options: Namespace) -> tuple[Obstacle | None, float | None]:
    """The obstacle, and the time between its frames [s] where it is a trajectory."""
    if options.obstacle is None:
        return None, None
    from reference_sim.cloth import MeshError
    from reference_sim.files.mesh_files import read_mesh, read_sequence, to_metres_y_up
    from reference_sim.obstacle import Obstacle
    from reference_sim.trajectory.trajectory import SUFFIXES, Trajectory

    axes = {"units": options.units, "up": options.up}
    if options.obstacle.lower().endswith(SUFFIXES):
        moving = Trajectory.load(options.obstacle)
        positions, faces = moving.positions, moving.faces
        dt = moving.dt if moving.frames > 1 else None
    else:
        positions, surface = read_sequence(options.obstacle)
        positions, faces, dt = to_metres_y_up(positions, **axes), surface.faces, None
    rest = None
    if options.obstacle_rest:
        rest_surface = read_mesh(options.obstacle_rest)
        if rest_surface.faces.shape != faces.shape or (rest_surface.faces != faces).any():
            raise InputError(
                f"{options.obstacle_rest}: other faces than {options.obstacle}: export both from one mesh"
            )
        rest = to_metres_y_up(rest_surface.positions, **axes)
    try:
        obstacle = Obstacle(positions, faces, rest_positions=rest, region=options.region)
    except MeshError as error:
        raise InputError(f"{options.obstacle}: {error}") from None
    distance = obstacle.signed_distance(cloth.rest_positions, 0)
    if distance.min() > FAR:
        _say(f"note: the garment starts {distance.min():.2g} m from the obstacle: same units and up axis?")
    elif (inside := distance < 0).any():
        _say(
            f"note: the garment starts with {inside.sum()} of {len(inside)} vertices inside the obstacle, "
            f"vertex {distance.argmin()} {-1e3 * distance.min():.0f} mm deep"
        )
    return obstacle, dt


def _say(text: str) -> None:
    print(text, flush=True)
