"""Read a garment from a mesh file: whatever cannot be simulated is refused with its remedy."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import igl
import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.files.mesh_files import (
    METRES,
    UP_AXES,
    Surface,
    join_seams,
    read_mesh,
    refuse_too_many,
    rest_chart,
    to_metres_y_up,
)
from reference_sim.geometry.topology import Array, Index, corner_areas
from reference_sim.material import Material
from reference_sim.obstacle import Obstacle
from snug.body.parametric_body import Body
from snug.file_options import GarmentFile
from snug.garments.garment import (
    Garment,
    GarmentError,
    find_weights,
    name_openings,
    piece_of_faces,
    waist_pins,
)
from snug.garments.implicit_surface import skin_following

# [m] below the skin, from which contact may not find the way out
TRAPPED_DEPTH = 0.02
TRAPPED_SHARE = 0.05  # of the vertices that may be so deep
MAX_DEPTH = 0.04  # [m], half the thickness of an arm
# [m] from the skin: whatever is worn has a tenth of its vertices there
WORN_DISTANCE = 0.05
WORN_SHARE = 0.1
# largest extent of a garment [heights of the body]
SIZE_RANGE = 0.1, 1.2
ENDS = ("head", "left_wrist", "right_wrist", "left_hand", "right_hand", "left_ankle", "right_ankle",
        "left_foot", "right_foot")  # fmt: skip
# share of the area that looks away from the skin, below which a piece is inside out
OUTWARD = 0.5
AREAL_DENSITIES = 0.005, 5.0  # [kg/m^2] of cloth: beyond them a unit is mistaken


def read_garment(file: GarmentFile | str | Path, body: Body) -> Garment:
    r"""Read and check a garment that was made for the unposed body, in T pose.

    Raises:
        GarmentError: file, problem, remedy.

    >>> import tempfile, numpy as np
    >>> angle = 2 * np.pi * np.arange(40) / 40
    >>> ring = [f"{0.2 * np.sin(a):.4f} {{}} {0.16 * np.cos(a) + 0.01:.4f}" for a in angle]
    >>> belt = ["v " + point.format(height) for height in (0.93, 0.97) for point in ring]
    >>> belt += [f"f {k + 1} {(k + 1) % 40 + 1} {(k + 1) % 40 + 41} {k + 41}" for k in range(40)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "belt.obj").write_text("\n".join(belt))
    ...     garment = read_garment(Path(folder, "belt.obj"), Body.load())
    >>> garment.name, garment.rest_positions.shape, list(garment.loops)
    ('belt', (80, 3), ['waist', 'hem'])
    """
    try:
        file = file if isinstance(file, GarmentFile) else GarmentFile(path=Path(file))
        raw = read_mesh(file.path)
        material = Material.from_file(file.material) if file.material else Material()
    except ValueError as error:
        raise GarmentError(str(error)) from None
    try:
        return _make_garment(file, body, raw, material)
    except ValueError as error:
        raise GarmentError(f"{file.path}: {error}") from None


def _make_garment(file: GarmentFile, body: Body, raw: Surface, material: Material) -> Garment:
    """Return the garment of a surface as it is in the file. Raises ValueError: problem, remedy."""
    refuse_too_many(len(raw.positions))
    positions = to_metres_y_up(raw.positions, units=file.units, up=file.up) + file.shift
    surface = join_seams(replace(raw, positions=positions), file.weld)
    skin = Obstacle(body.template, body.faces)
    _check_place(file, body, skin, raw)
    chart = None
    if file.rest == "uv":
        chart = rest_chart(surface, METRES[file.units] if file.uv_scale is None else file.uv_scale)
    faces, chart = _wind_outward(surface.positions, surface.faces, chart, skin)
    positions = surface.positions
    if file.material and not AREAL_DENSITIES[0] <= material.areal_density <= AREAL_DENSITIES[1]:
        text = f"{material.areal_density:.3g} kg/m^2, {1e3 * material.thickness:.3g} mm thick"
        raise ValueError(f"its material is {text}: give thickness in m and density in kg/m^3")
    Cloth(positions, faces, rest_uv=chart)  # sheets that can be simulated, consistently wound
    loops = name_openings(body, positions, faces)
    if not loops:
        raise ValueError("it has no opening, the surface is closed: cut where head and limbs come out")
    weights, nearest = find_weights(body, positions, faces)
    return Garment(
        name=file.name,
        rest_positions=positions,
        faces=faces,
        body_vertices=nearest,
        skinning_weights=weights,
        loops=loops,
        pins=waist_pins(body, positions, faces),
        material=material,
        rest_uv=chart,
    )


def _check_place(file: GarmentFile, body: Body, skin: Obstacle, raw: Surface) -> None:
    """Raise ValueError unless the garment lies on the body; say which unit or axis mends it."""
    problem, size, fitting = "", "", {}
    for units, up in sorted(product(METRES, UP_AXES), key=lambda axes: axes != (file.units, file.up)):
        positions = to_metres_y_up(raw.positions, units=units, up=up) + file.shift
        distances = skin.signed_distance(positions, 0)
        misfit = _misfit(body, skin, positions, raw.faces, distances)
        if (units, up) == (file.units, file.up):
            if not misfit:
                return
            problem, size = misfit, " x ".join(f"{length:.2f}" for length in np.ptp(positions, axis=0))
        elif not misfit:
            fitting[units, up] = np.abs(distances).mean()
    remedy = "move it onto the unposed body, facing +z with y up"
    if fitting:
        units, up = min(fitting, key=fitting.__getitem__)
        remedy = f"give units={units},up={up} behind its path"
    raise ValueError(f"does not lie on the body ({size} m, {problem}): {remedy}")


def _misfit(body: Body, skin: Obstacle, positions: Array, faces: Index, distances: Array) -> str:
    """Return why nothing can be simulated from the place of a garment (V,3) [m], (F,3), or empty.

    distances: (V,) [m] of its vertices to the skin, negative below it.
    """
    size = np.ptp(positions, axis=0).max() / body.height
    if not SIZE_RANGE[0] < size < SIZE_RANGE[1]:
        return f"its largest extent is {size:.3g} times the body's height"
    if np.mean(np.abs(distances) < WORN_DISTANCE) < WORN_SHARE:
        return f"it lies {1e3 * np.median(np.abs(distances)):.0f} mm from the body"
    depth = -distances.min()
    if depth > MAX_DEPTH or np.mean(distances < -TRAPPED_DEPTH) > TRAPPED_SHARE:
        share = np.mean(distances < 0)
        return f"it lies up to {1e3 * depth:.0f} mm deep in the body, with {share:.0%} of it"
    corners = positions[faces]
    at_ends = np.all(skin_following(body, ENDS)[body.faces], axis=1)
    ends = at_ends[skin.planes(corners.mean(axis=1), 0).faces]
    share = np.average(ends, weights=corner_areas(corners))
    return f"{share:.0%} of it lies around head, hands or feet" if share > 0.5 else ""


def _wind_outward(
    positions: Array, faces: Index, chart: Array | None, skin: Obstacle
) -> tuple[Index, Array | None]:
    """Return faces and chart, each piece wound one way, with its outside on the outside."""
    source, faces = faces, np.asarray(igl.bfs_orient(faces)[0], dtype=np.int64)
    corners = positions[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = np.einsum("fi,fi->f", normals, skin.planes(corners.mean(axis=1), 0).normals) > 0
    areas, pieces = np.linalg.norm(normals, axis=1), piece_of_faces(faces)
    turned = (np.bincount(pieces, areas * outward) <= OUTWARD * np.bincount(pieces, areas))[pieces]
    turned ^= (faces != source).any(axis=1)
    if chart is not None:
        chart = np.where(turned[:, None, None], chart[:, ::-1], chart)
    return np.ascontiguousarray(np.where(turned[:, None], source[:, ::-1], source)), chart
