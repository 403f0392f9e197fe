"""Mesh files of other programs: read one, read a sequence, bring both to metres with y up.

The files are meshio's formats (OBJ, PLY, STL, OFF, VTK) and trajectories of this project (VTKHDF).
"""

from __future__ import annotations

import contextlib
import glob
import io
import logging
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .cloth import MeshError
from .mesh_header import check_header

if TYPE_CHECKING:
    import numpy as np

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".vtk", ".vtp", ".vtu")
TRAJECTORY_SUFFIXES = (".vtkhdf", ".hdf")
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
UP_AXES = ("y", "z")


@dataclass(frozen=True, eq=False)
class Surface:
    """What a file held: positions (V, 3) in the file's own unit and axes, triangles (F, 3).

    quads: how many four-cornered faces were cut in two along the diagonal from their first corner.
    """

    positions: np.ndarray
    faces: np.ndarray
    quads: int = 0


def read_mesh(path: str | Path) -> Surface:
    """Read the triangles and quads of one mesh file.

    Raises:
        MeshError: missing or unreadable file, unknown format, no faces, faces with five corners or more,
            a vertex that is not finite; the message names the file.
    """
    import numpy as np

    path = Path(path)
    if not path.is_file():
        raise MeshError(f"{path}: no such file")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise MeshError(f"{path}: unknown kind of mesh: convert it to one of {', '.join(MESH_SUFFIXES)}")
    points, polygons = _read_obj(path) if path.suffix.lower() == ".obj" else _read_with_meshio(path)
    positions = np.asarray(points, dtype=np.float64)
    if not polygons:
        raise MeshError(f"{path}: no triangles in it: export the surface as triangles")
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise MeshError(f"{path}: vertices have shape {positions.shape}: expected three coordinates each")
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if bad.size:
        raise MeshError(f"{path}: vertex {bad[0]} is not finite: {positions[bad[0]].tolist()}")
    corners = np.array([len(polygon) for polygon in polygons])
    if corners.max() > 4 or corners.min() < 3:
        k = int(np.argmax((corners > 4) | (corners < 3)))
        raise MeshError(f"{path}: face {k} has {corners[k]} corners: triangulate the mesh")
    if corners.max() == 4:
        polygons = [
            half for p in polygons for half in ((p[0], p[1], p[2]), (p[0], p[2], p[-1]))[: len(p) - 2]
        ]
    return Surface(positions, np.array(polygons, dtype=np.int64), int((corners == 4).sum()))


def _read_obj(path: Path) -> tuple[list[list[float]], list[list[int]]]:
    """Vertices and polygons of an OBJ file.

    meshio refuses a file with more texture coordinates than vertices, which every garment with seams has.
    """
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            words = line.split()
            try:
                if words and words[0] == "v":
                    x, y, z = words[1:4]  # colours may follow
                    points.append([float(x), float(y), float(z)])
                elif words and words[0] == "f":
                    named = [_vertex_number(word.split("/")[0]) for word in words[1:]]
                    polygons.append([n - 1 if n > 0 else len(points) + n for n in named])
            except ValueError:
                raise MeshError(f"{path}: line {number} is not understood: {line.strip()[:60]!r}") from None
    return points, polygons


def _vertex_number(text: str) -> int:
    """Raises ValueError for what is none: OBJ counts from 1, and from the last by -1."""
    number = int(text)
    if not 0 < abs(number) < 1 << 62:
        raise ValueError(text)
    return number


def _read_with_meshio(path: Path) -> tuple[Any, list[Any]]:
    """Points and polygons through meshio; legacy and XML PolyData, which it cannot read, through VTK."""
    import meshio
    import numpy as np

    check_header(path)
    printed = io.StringIO()
    try:
        # meshio prints its error and then leaves the interpreter; its STL reader overflows on purpose.
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            np.errstate(over="ignore"),
        ):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:
        if path.suffix.lower() in (".vtk", ".vtp") and (surface := _read_with_vtk(path)):
            return surface
        message = printed.getvalue().strip() if isinstance(error, SystemExit) else str(error)
        reason = " ".join(message.split())[:300] or type(error).__name__
        raise MeshError(f"{path}: cannot be read ({reason}): export it again, as OBJ or PLY") from None
    kinds = [block for block in mesh.cells if block.type.startswith(("triangle", "quad", "polygon"))]
    return mesh.points, [polygon for block in kinds for polygon in block.data]


def _read_with_vtk(path: Path) -> tuple[Any, list[Any]] | None:
    """Points and triangles of a file of PolyData, or None if it holds none."""
    import pyvista

    try:
        with (
            warnings.catch_warnings(),
            pyvista.vtk_verbosity("off"),
            pyvista.VtkErrorCatcher(raise_errors=True, send_to_logging=False),
        ):
            warnings.simplefilter("ignore")
            logging.disable(logging.CRITICAL)  # to which readers of pyvista hand errors on
            surface = pyvista.read(path)
    except Exception:  # whatever VTK finds wrong with it, meshio's message is the one to show
        return None
    finally:
        logging.disable(logging.NOTSET)
    if not isinstance(surface, pyvista.PolyData) or surface.n_cells == 0:
        return None
    if not surface.is_all_triangles:
        raise MeshError(f"{path}: has faces that are no triangles: triangulate the mesh")
    return surface.points, list(surface.faces.reshape(-1, 4)[:, 1:])


def read_sequence(pattern: str | Path) -> tuple[np.ndarray, Surface]:
    """Read a moving mesh: positions (T, B, 3) and, for its faces, the first mesh.

    Args:
        pattern: one mesh (T = 1), a folder of meshes of one kind, a glob such as "body_*.obj", or a VTKHDF
            trajectory of this project. Files are taken in the order of the numbers in their names.

    Raises:
        MeshError: as `read_mesh`; no files; vertices or faces that do not correspond to the first file's.
        TrajectoryError: a VTKHDF file that is not ours.
    """
    import numpy as np

    if str(pattern).lower().endswith(TRAJECTORY_SUFFIXES):
        from .trajectory import Trajectory

        trajectory = Trajectory.load(pattern)
        return trajectory.positions, Surface(trajectory.positions[0], trajectory.faces)
    paths = _paths(str(pattern))
    first = read_mesh(paths[0])
    frames = [first.positions]
    for path in paths[1:]:
        surface = read_mesh(path)
        _check_corresponds(path, surface, paths[0], first)
        frames.append(surface.positions)
    return np.stack(frames), first


def _paths(pattern: str) -> list[Path]:
    path = Path(pattern)
    if path.is_dir():
        found = [p for p in path.iterdir() if p.suffix.lower() in MESH_SUFFIXES]
        if not found:
            raise MeshError(f"{path}: no mesh in this folder ({', '.join(MESH_SUFFIXES)})")
    elif path.exists() or not glob.has_magic(pattern):
        found = [path]
    else:
        found = [Path(name) for name in glob.glob(pattern)]
        if not found:
            raise MeshError(f"{pattern}: no file matches (quote the pattern, or the shell expands it)")
    kinds = sorted({p.suffix.lower() for p in found})
    if len(kinds) > 1:
        raise MeshError(
            f"{pattern}: meshes of several kinds ({', '.join(kinds)}): name one, as in '*{kinds[0]}'"
        )
    return sorted(found, key=lambda p: [int(s) if s.isdigit() else s for s in re.split(r"(\d+)", p.name)])


def _check_corresponds(path: Path, surface: Surface, first_path: Path, first: Surface) -> None:
    import numpy as np

    remedy = "a sequence needs one numbering: export OBJ or PLY without reordering"
    for noun, here, there in (
        ("vertices", surface.positions, first.positions),
        ("faces", surface.faces, first.faces),
    ):
        if len(here) != len(there):
            raise MeshError(f"{path}: {len(here)} {noun}, but {first_path.name} has {len(there)}: {remedy}")
    bad = np.flatnonzero((surface.faces != first.faces).any(axis=1))
    if bad.size:
        here, there = surface.faces[bad[0]].tolist(), first.faces[bad[0]].tolist()
        raise MeshError(f"{path}: face {bad[0]} = {here}, but {there} in {first_path.name}: {remedy}")


def to_metres_y_up(positions: np.ndarray, *, units: str = "m", up: str = "y") -> np.ndarray:
    """Positions (..., 3) of a file in metres with y up; z up is turned by a quarter about x.

    Raises:
        ValueError: unknown unit or axis.
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
