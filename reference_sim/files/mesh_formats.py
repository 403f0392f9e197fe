"""Raw contents of mesh files, before polygons become triangles: OBJ here, others through meshio and VTK."""

from __future__ import annotations

import contextlib
import io
import logging
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from reference_sim.cloth import MeshError
from reference_sim.files.mesh_header import check_header
from reference_sim.files.trial import try_out

UV_OF_VTK = "UV"  # what the texture coordinates of a VTK file are called here


Polygon = Sequence[int] | np.ndarray  # indices of its corners


@dataclass(frozen=True)
class Parts:
    """Raw contents of a mesh file.

    Attributes:
        points: (V, 3).
        polygons: vertex indices of each face.
        uv: (N, 2) texture coordinates.
        uv_polygons: places in uv, parallel to polygons, -1 for a corner without; empty where the UV are those
            of the vertices.
        vertex_data: name -> (V,) or (V, k).
    """

    points: np.ndarray | list[list[float]]
    polygons: Sequence[Polygon]
    uv: Sequence[Sequence[float]] = ()
    uv_polygons: Sequence[Polygon] = ()
    vertex_data: Mapping[str, np.ndarray] = field(default_factory=dict)


def read_parts(path: Path) -> Parts:
    """Read everything of a file that exists.

    Raises:
        MeshError: not understood; the message names the file.
    """
    return _read_obj(path) if path.suffix.lower() == ".obj" else _read_with_meshio(path)


def _read_obj(path: Path) -> Parts:
    """Read vertices, polygons and texture coordinates of an OBJ file.

    meshio refuses a file with more texture coordinates than vertices, which every garment with seams has.
    """
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    uv: list[list[float]] = []
    uv_polygons: list[list[int]] = []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            parts = line.partition("#")[0].split()
            try:
                if parts and parts[0] == "v":
                    x, y, z = parts[1:4]  # colours may follow
                    points.append([float(x), float(y), float(z)])
                elif parts and parts[0] == "vt":
                    uv.append([float(parts[1]), float(parts[2]) if len(parts) > 2 else 0.0])
                elif parts and parts[0] == "f":
                    corners = [corner.split("/") for corner in parts[1:]]
                    polygons.append([_counted(c[0], len(points)) for c in corners])
                    uv_polygons.append(
                        [_counted(c[1], len(uv)) if len(c) > 1 and c[1] else -1 for c in corners]
                    )
            except (ValueError, IndexError):
                raise MeshError(f"{path}: line {number} is not understood: {line.strip()[:60]!r}") from None
    return Parts(points, polygons, uv, uv_polygons)


def _counted(text: str, count: int) -> int:
    """Return an index from 0 on: OBJ counts from 1, and from the last by -1.

    Raises:
        ValueError: no number.
    """
    number = int(text)
    if not 0 < abs(number) < 1 << 62:
        raise ValueError(text)
    return number - 1 if number > 0 else count + number


def _read_with_meshio(path: Path) -> Parts:
    """Read points and polygons through meshio; PolyData of VTK, which it cannot read, through VTK."""
    import meshio

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
        if path.suffix.lower() in (".vtk", ".vtp") and (parts := _read_with_vtk(path)):
            return parts
        message = printed.getvalue().strip() if isinstance(error, SystemExit) else str(error)
        reason = " ".join(message.split())[:300] or type(error).__name__
        raise MeshError(f"{path}: cannot be read ({reason}): export it again, as OBJ or PLY") from None
    kinds = [block for block in mesh.cells if block.type.startswith(("triangle", "quad", "polygon"))]
    data = {name: np.asarray(values) for name, values in mesh.point_data.items()}
    return Parts(mesh.points, [polygon for block in kinds for polygon in block.data], vertex_data=data)


def try_poly_data(*paths: Path) -> bool:
    """Return whether VTK can read the files; a process tries each once, until it changes."""
    new = [path for path in paths if _state(path) not in _TRIED]
    if new and try_out(read_poly_data, *new):
        return False
    _TRIED.update(map(_state, new))
    return True


_TRIED: set[tuple[str, int, int]] = set()  # files that VTK could read


def _state(path: Path) -> tuple[str, int, int]:
    stat = path.stat()
    return str(path.absolute()), stat.st_mtime_ns, stat.st_size


def read_poly_data(path: Path) -> Any:
    """Return what VTK makes of a file. Raises an exception of pyvista, or crashes: see `try_poly_data`."""
    import pyvista

    try:
        with (
            warnings.catch_warnings(),
            pyvista.vtk_verbosity("off"),
            pyvista.VtkErrorCatcher(raise_errors=True, send_to_logging=False),
        ):
            warnings.simplefilter("ignore")
            logging.disable(logging.CRITICAL)  # to which readers of pyvista hand errors on
            return pyvista.read(path)
    finally:
        logging.disable(logging.NOTSET)


def _read_with_vtk(path: Path) -> Parts | None:
    """Read points and triangles of a file of PolyData; None if it holds none, or VTK cannot read it."""
    if not try_poly_data(path):
        return None
    import pyvista

    surface = read_poly_data(path)
    if not isinstance(surface, pyvista.PolyData) or surface.n_cells == 0:
        return None
    if not surface.is_all_triangles:
        raise MeshError(f"{path}: has faces that are no triangles: triangulate the mesh")
    data = {name: np.asarray(surface.point_data[name]) for name in surface.point_data}
    if surface.active_texture_coordinates is not None:
        data[UV_OF_VTK] = np.asarray(surface.active_texture_coordinates)
    return Parts(surface.points, list(surface.faces.reshape(-1, 4)[:, 1:]), vertex_data=data)
