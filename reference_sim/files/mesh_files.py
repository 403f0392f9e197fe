"""Mesh files of other programs: one mesh or a sequence, in metres with y up, and the pattern in a UV chart.

A chart is kept by the faces' corners. In space the pieces of the pattern are one mesh: vertices that a
program has doubled for the sake of its chart are joined.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from statistics import mode
from typing import Any

import numpy as np

from reference_sim.cloth import MeshError
from reference_sim.files.mesh_formats import READERS, read_contents
from reference_sim.geometry.topology import corner_areas

MESH_SUFFIXES = tuple(READERS)
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
UP_AXES = ("y", "z")
BYTES_A_VERTEX = 23e3  # of a simulation, measured up to 64,000 vertices
MEMORY_SHARE = 0.8  # of a machine's memory, which a simulation may take
LARGEST_COORDINATE = 1e12  # in any unit: squares and cubes of it are still numbers


@dataclass(frozen=True, eq=False)
class Surface:
    """Mesh of a file, in its own unit and axes; quads are cut along the diagonal from their first corner.

    uv (F, 3, 2): texture coordinates of the faces' corners; NaN for a corner without, None if all are.
    """

    positions: np.ndarray  # (V, 3)
    faces: np.ndarray  # (F, 3)
    uv: np.ndarray | None = None


def read_mesh(path: str | Path) -> Surface:
    """Read the triangles and quads of one mesh file.

    Raises MeshError that names the file: missing, unreadable or of unknown format, without faces, with
    five corners at a face, or a vertex that is not finite.
    """
    path = Path(path)
    if not path.is_file():
        raise MeshError(f"{path}: no such file")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise MeshError(f"{path}: unknown kind of mesh: convert it to one of {', '.join(MESH_SUFFIXES)}")
    try:
        contents = read_contents(path)
    except ValueError as error:
        raise MeshError(f"{path}: {error}") from None
    return _surface(path, *contents)


def _surface(
    path: Path, points: Any, polygons: Sequence[Any], uv: Any, uv_polygons: Sequence[Any]
) -> Surface:
    """Check the contents of a file, and cut its quads into triangles."""
    positions, uv = np.asarray(points, dtype=np.float64), np.asarray(uv, dtype=np.float64)
    if not len(polygons):
        raise MeshError(f"{path}: no triangles in it: export the surface as triangles")
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise MeshError(f"{path}: vertices have shape {positions.shape}: expected three coordinates each")
    bad = np.flatnonzero(~(np.abs(positions) < LARGEST_COORDINATE).all(axis=1))
    if bad.size:
        raise MeshError(f"{path}: vertex {bad[0]} is not finite, or farther than {LARGEST_COORDINATE:g}")
    corners = np.array([len(polygon) for polygon in polygons])
    if corners.max() > 4 or corners.min() < 3:
        k = int(np.argmax((corners > 4) | (corners < 3)))
        raise MeshError(f"{path}: face {k} has {corners[k]} corners: triangulate the mesh")
    faces = _triangles(path, polygons, range(len(positions)), "vertex")
    places = _triangles(path, uv_polygons, range(-1, len(uv)), "texture coordinate")
    if (places < 0).all():
        return Surface(positions, faces)
    return Surface(positions, faces, np.where(places[..., None] < 0, np.nan, uv[places]))


def _triangles(path: Path, polygons: Sequence[Any], indices: range, noun: str) -> np.ndarray:
    """Cut quads into triangles (F, 3). Raises MeshError for one that names none of the indices."""
    halves = [half for p in polygons for half in ((p[0], p[1], p[2]), (p[0], p[2], p[-1]))[: len(p) - 2]]
    triangles = np.array(halves, np.int64).reshape(-1, 3)
    bad = np.flatnonzero(((triangles < indices.start) | (triangles >= indices.stop)).any(axis=1))
    if bad.size:
        raise MeshError(f"{path}: triangle {bad[0]} names a {noun} beyond the {indices.stop} there are")
    return triangles


def read_sequence(pattern: str | Path) -> tuple[np.ndarray, Surface]:
    """Read a moving mesh: positions (T, B, 3) and, for its faces, the first mesh.

    pattern: one mesh (T = 1), a folder of meshes of one kind, or a glob such as "body_*.obj", taken in
    the order of the numbers in their names, which are evenly spaced.

    Raises MeshError as `read_mesh`, for no files, for names between which a number is missing, and for
    vertices or faces other than those of the first.
    """
    paths = _paths(str(pattern))
    first = read_mesh(paths[0])
    frames = [first.positions]
    for path in paths[1:]:
        surface = read_mesh(path)
        if surface.positions.shape != first.positions.shape or not np.array_equal(
            surface.faces, first.faces
        ):
            raise MeshError(
                f"{path}: other vertices or faces than {paths[0].name}: a sequence needs one numbering: "
                "export OBJ or PLY without reordering"
            )
        frames.append(surface.positions)
    return np.stack(frames), first


def _paths(pattern: str) -> list[Path]:
    """Return the files that `read_sequence` reads. Raises MeshError for none, several kinds, or a gap."""
    path = Path(pattern)
    if path.is_dir():
        # macOS leaves a ._body_1.obj beside body_1.obj on other disks
        paths = [p for p in path.iterdir() if p.suffix.lower() in MESH_SUFFIXES and p.name[0] != "."]
    elif path.exists() or not glob.has_magic(pattern):
        paths = [path]
    else:
        paths = [Path(name) for name in glob.glob(pattern)]
    kinds = sorted({p.suffix.lower() for p in paths})
    if len(kinds) != 1:
        content = f"meshes of several kinds ({', '.join(kinds)})" if kinds else "no mesh"
        raise MeshError(f"{pattern}: {content}: quote a pattern of one kind, as 'body_*.ply'")
    return _sort(paths)


def _sort(paths: list[Path]) -> list[Path]:
    """Return frames in the order of the one number in which their names differ.

    Raises MeshError where they differ in something else, or where a number is missing or there twice.
    """
    parts = {path: re.split(r"([0-9]+)", str(path)) for path in paths}
    varying = [k for k, tokens in enumerate(zip(*parts.values())) if len(set(tokens)) > 1]
    lengths = {len(tokens) for tokens in parts.values()}
    if len(paths) > 1 and not (len(lengths) == 1 and len(varying) == 1 and varying[0] % 2):
        first, last = min(paths), max(paths)
        raise MeshError(
            f"{first}: differs from {last.name} in more than a number: name the frames of a sequence "
            "alike but for their numbers, and leave other meshes out of the folder"
        )
    number = {path: int(tokens[varying[0]]) if varying else 0 for path, tokens in parts.items()}
    frames = sorted(paths, key=number.__getitem__)
    steps = [end - start for start, end in pairwise(map(number.__getitem__, frames))]
    usual = mode(steps) if steps else 0
    for path, follower, step in zip(frames, frames[1:], steps):
        if step != usual or step == 0:
            raise MeshError(
                f"{follower}: its number is {step} above that of {path.name}, and others follow by {usual}: "
                "add the frames that are missing, or number the files evenly"
            )
    return frames


def refuse_too_many(vertices: int) -> None:
    """Raise MeshError for more vertices than the memory of this machine is enough to simulate."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if vertices * BYTES_A_VERTEX > MEMORY_SHARE * memory:
        raise MeshError(
            f"has {vertices} vertices, which take {vertices * BYTES_A_VERTEX / 1e9:.0f} GB of memory to "
            f"simulate, above {MEMORY_SHARE:.0%} of this machine's {memory / 1e9:.0f} GB: decimate the mesh"
        )


def to_metres_y_up(positions: np.ndarray, *, units: str = "m", up: str = "y") -> np.ndarray:
    """Bring positions (..., 3) of a file to metres with y up; z up is turned by a quarter about x.

    units: a key of METRES. up: one of UP_AXES. Raises ValueError for others.

    >>> to_metres_y_up(np.array([[0.0, 0.0, 170.0]]), units="cm", up="z")
    array([[ 0. ,  1.7, -0. ]])
    """
    if units not in METRES or up not in UP_AXES:
        raise ValueError(
            f"units {units!r}, up {up!r}: choose from {', '.join(METRES)} and {', '.join(UP_AXES)}"
        )
    scaled = METRES[units] * positions
    if up == "y":
        return scaled
    turned = scaled[..., [0, 2, 1]]
    turned[..., 2] *= -1
    return turned


JOIN_DISTANCE = 1e-6  # [m] from which two vertices are one: round-off of six digits
AREA_FACTOR = 1.5  # a chart whose area is further from the mesh's is in another unit
LARGEST_STRETCH = 1.5  # from chart to mesh, or its inverse: no cloth is sewn so
STRETCHED_SHARE = 0.1  # of the area, from which a chart is no pattern


def join_seams(surface: Surface, distance: float = JOIN_DISTANCE) -> Surface:
    """Join the doubled vertices of a surface in metres: those closer than the distance [m] are one.

    Raises MeshError for a distance that is not above 0, or that a triangle does not survive.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not 0.0 < distance < np.inf:
        raise MeshError(f"weld={distance}: give a distance above 0 [m]")
    count = len(surface.positions)
    pairs = cKDTree(surface.positions).query_pairs(distance, output_type="ndarray")
    if not len(pairs):
        return surface
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    of_vertex = connected_components(graph, directed=False)[1]
    ids = np.sort(np.unique(of_vertex, return_index=True)[1])
    place = np.empty(count, dtype=np.int64)
    place[of_vertex[ids]] = np.arange(len(ids))
    faces = place[of_vertex][surface.faces]
    if (collapsed := (faces == np.roll(faces, 1, axis=1)).any(axis=1)).any():
        raise MeshError(
            f"joining vertices within {distance:g} m makes a line of triangle {collapsed.argmax()}: "
            "weld by less, or remove the triangle"
        )
    return replace(surface, positions=surface.positions[ids], faces=faces)


def rest_chart(surface: Surface, scale: float) -> np.ndarray:
    """Return the chart (F, 3, 2) [m] of a surface in metres, as `Cloth` takes it for `rest_uv`.

    scale: metres per unit of the chart. Raises MeshError for a chart that is missing, has no corner or
    area somewhere, an area further than `AREA_FACTOR` from that of the mesh, or the distortion of no
    pattern.
    """
    instead = "rest=mesh takes the mesh itself as rest shape"
    if surface.uv is None:
        raise MeshError(f"has no UV: {instead}")
    bad = np.flatnonzero(~np.isfinite(surface.uv).all(axis=(1, 2)))
    if bad.size:
        raise MeshError(f"triangle {bad[0]} has a corner without UV: complete the chart, or {instead}")
    if not (np.isfinite(scale) and scale > 0):
        raise MeshError(f"uv_scale={scale}: give metres per unit of the chart, above 0")
    chart = scale * surface.uv
    corners = surface.positions[surface.faces]
    flat, mesh = corner_areas(chart), corner_areas(corners)
    ratio = flat.sum() / mesh.sum()
    if not 1 / AREA_FACTOR <= ratio <= AREA_FACTOR:
        equal = f"uv_scale={scale / np.sqrt(ratio):.4g} makes them equal, " if ratio > 0 else ""
        raise MeshError(
            f"its UV chart measures {flat.sum():.4g} m^2 and the mesh {mesh.sum():.4g} m^2: give metres per "
            f"unit of the chart, {equal}or {instead}"
        )
    small = np.flatnonzero(~(flat > 1e-12 * flat.max()))
    if small.size:
        raise MeshError(f"triangle {small[0]} has no area in the UV chart: mend the chart, or {instead}")
    stretch = stretches(corners, chart)
    off = (stretch[:, 0] > LARGEST_STRETCH) | (stretch[:, 1] < 1 / LARGEST_STRETCH)
    share = flat[off].sum() / flat.sum()
    if share > STRETCHED_SHARE:
        raise MeshError(
            f"{share:.0%} of its UV chart is stretched or pressed by more than {LARGEST_STRETCH:g} on the "
            f"mesh: that is a texture and no pattern; {instead}"
        )
    return chart


def stretches(corners: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return the principal stretches (F, 2), the larger first, from a chart to a mesh.

    They are the singular values of F = [x1 - x0, x2 - x0] Dm^-1, for corners (F, 3, 3) of the mesh and a
    chart (F, 3, 2), no triangle without area.
    """
    Dm, Ds = (np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=-1) for x in (chart, corners))
    return np.linalg.svd(Ds @ np.linalg.inv(Dm), compute_uv=False)
