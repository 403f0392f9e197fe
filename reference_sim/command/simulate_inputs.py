"""Files that `python -m reference_sim.simulate` reads: garment, material and obstacle."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from reference_sim.cloth import Cloth, MeshError
from reference_sim.files.mesh_files import METRES, read_mesh, read_sequence, to_metres_y_up
from reference_sim.files.uv_chart import join_seams, rest_chart
from reference_sim.material import Material
from reference_sim.trajectory.trajectory import TRAJECTORY_SUFFIXES, Trajectory

if TYPE_CHECKING:
    from argparse import Namespace

    from reference_sim.obstacle import Obstacle

FAR_FROM_OBSTACLE = 1.0  # [m] from which garment and obstacle hardly belong together


class BadInput(ValueError):
    """Bad input, in one line that names file, element and remedy."""


def read_cloth(options: Namespace) -> Cloth:
    """Return the cloth of the garment's file, its rest shape, pins and material.

    Raises:
        ValueError: a file, an option or the mesh is no good; the message names it and the remedy.
    """
    material = Material.from_file(options.material) if options.material else Material()
    given = {parameter.name: getattr(options, parameter.name) for parameter in fields(Material)}
    material = replace(material, **{name: value for name, value in given.items() if value is not None})
    surface = read_mesh(options.garment)
    positions = to_metres_y_up(surface.positions, units=options.units, up=options.up)
    pins, chart = choose_pins(options.pins, positions), None
    if options.rest == "uv":
        surface, kept, now = join_seams(replace(surface, positions=positions))
        if len(kept) < len(positions):
            print_note(f"{options.garment}: {len(positions) - len(kept)} doubled vertices joined along seams")
            pins = np.unique(now[pins])  # chosen by their numbers in the file
        positions = surface.positions
        try:
            chart = rest_chart(surface, options.uv_scale or METRES[options.units])
        except MeshError as error:
            raise BadInput(f"{options.garment}: {error}") from None
    if surface.quads:
        print_note(f"{options.garment}: {surface.quads} quads cut into triangles")
    if options.up == "z":
        print_note("meshes turned from z up to y up, (x, y, z) -> (x, z, -y)")
    size = float((positions.max(axis=0) - positions.min(axis=0)).max())
    if not 0.02 < size < 20:
        print_note(f"{options.garment} measures {size:.3g} m: is --units {options.units} right?")
    if len(pins) == len(positions):
        raise BadInput(f"--pins {options.pins!r} holds every vertex of {options.garment}: choose fewer")
    try:
        return Cloth(positions, surface.faces, material, pins=pins, rest_uv=chart)
    except MeshError as error:
        raise BadInput(f"{options.garment}: {error}") from None


def choose_pins(which: str | None, positions: np.ndarray) -> np.ndarray:
    """Return indices (P,) of the vertices that `which` names among positions (V, 3) [m, y up].

    "0,9,12" are indices; "top" is what lies within 1 % of the height from the highest vertex; anything else
    is a box, comparisons joined by commas.

    Raises:
        BadInput: not understood, an index out of range, or nothing chosen.
    """
    if which is None:
        return np.zeros(0, dtype=np.int64)
    height = positions[:, 1]
    if which == "top":
        return np.flatnonzero(height >= height.max() - 0.01 * (height.max() - height.min()))
    parts = [part.strip() for part in which.split(",")]
    if all(re.fullmatch(r"\d+", part) for part in parts):
        indices = np.array([int(part) for part in parts])
        if indices.max() >= len(positions):
            raise BadInput(f"--pins {indices.max()}: the garment has vertices 0..{len(positions) - 1}")
        return indices
    chosen = np.ones(len(positions), dtype=bool)
    for part in parts:
        match = re.fullmatch(r"([xyz])\s*([<>])=?\s*(\S+)", part)
        try:
            axis, sign, bound = match.groups()  # type: ignore[union-attr]
            value = float(bound)
        except (AttributeError, ValueError):
            raise BadInput(f"--pins {which!r}: give indices, 'top', or a box such as 'y>1.4,x<0.1'") from None
        along = positions[:, "xyz".index(axis)]
        chosen &= along >= value if sign == ">" else along <= value
    if not chosen.any():
        low, high = positions.min(axis=0).round(3).tolist(), positions.max(axis=0).round(3).tolist()
        raise BadInput(f"--pins {which!r}: no vertex in this box; the garment spans {low} to {high} m, y up")
    return np.flatnonzero(chosen)


def read_obstacle(cloth: Cloth, options: Namespace) -> tuple[Obstacle | None, float | None]:
    """Return the obstacle, and the time between its frames [s] where it is a trajectory; None without one.

    Raises:
        ValueError: a file or the mesh is no good; the message names it and the remedy.
    """
    if options.obstacle is None:
        return None, None
    from reference_sim.obstacle import Obstacle  # its search for contact serves no cloth that meets nothing

    axes = {"units": options.units, "up": options.up}
    if options.obstacle.lower().endswith(TRAJECTORY_SUFFIXES):
        moving = Trajectory.load(options.obstacle, guarded=True)
        positions, faces = moving.positions, moving.faces
        dt = moving.dt if moving.frames > 1 else None
    else:
        positions, surface = read_sequence(options.obstacle)
        positions, faces, dt = to_metres_y_up(positions, **axes), surface.faces, None
    rest = None
    if options.obstacle_rest:
        rest_surface = read_mesh(options.obstacle_rest)
        if rest_surface.faces.shape != faces.shape or (rest_surface.faces != faces).any():
            raise BadInput(
                f"{options.obstacle_rest}: other faces than {options.obstacle}: export both from one mesh"
            )
        rest = to_metres_y_up(rest_surface.positions, **axes)
    try:
        obstacle = Obstacle(positions, faces, rest_positions=rest, region=options.region)
    except MeshError as error:
        raise BadInput(f"{options.obstacle}: {error}") from None
    distance = obstacle.signed_distance(cloth.rest_positions, 0)
    if distance.min() > FAR_FROM_OBSTACLE:
        print_note(f"the garment starts {distance.min():.2g} m from the obstacle: same units and up axis?")
    elif (inside := distance < 0).any():
        print_note(
            f"the garment starts with {inside.sum()} of {len(inside)} vertices inside the obstacle, "
            f"vertex {distance.argmin()} {-1e3 * distance.min():.0f} mm deep"
        )
    return obstacle, dt


def print_note(text: str) -> None:
    """Print a note on input that is possible and suspicious."""
    print(f"note: {text}", flush=True)
