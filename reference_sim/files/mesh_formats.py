"""Raw contents of mesh files, before polygons become triangles: OBJ here, others through meshio and VTK."""

from __future__ import annotations

import contextlib
import io
import logging
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from reference_sim.cloth import MeshError
from reference_sim.files.array_file import MOST_PACKED
from reference_sim.files.trial import try_out

UV_OF_VTK = "UV"  # what the texture coordinates of a VTK file are called here
EXPORT_AGAIN = "export it again, as OBJ or PLY"
SECTIONS = (
    b"POINTS|VERTICES|LINES|POLYGONS|TRIANGLE_STRIPS|CELLS|CELL_TYPES|POINT_DATA|CELL_DATA|"
    rb"DIMENSIONS|[XYZ]_COORDINATES|FIELD\s+\S+|LOOKUP_TABLE\s+\S+|COLOR_SCALARS\s+\S+"
)
# Suffix -> where a header has numbers of elements, and how many may lie in a byte.
COUNTS = {
    ".ply": (rb"^[ \t]*element[ \t]+\w+((?:[ \t]+\d+)+)", 1),
    ".off": (rb"^[ \t]*(\d+[ \t]+\d+[ \t]+\d+)[ \t]*$", 1),
    ".vtk": (rb"^[ \t]*(?:" + SECTIONS + rb")((?:[ \t]+\d+)+)", 1),
    ".vtp": (rb"NumberOf\w+\s*=\s*[\"']\s*(\d+)", MOST_PACKED),
    ".vtu": (rb"NumberOf\w+\s*=\s*[\"']\s*(\d+)", MOST_PACKED),
}

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


def read_parts(paths: Sequence[Path]) -> Iterator[Parts]:
    """Read everything of files that exist, one after the other.

    meshio does not know the PolyData of VTK. VTK does, and may crash: a process of its own tries all files
    first, for it takes a second to start.

    Raises:
        MeshError: not understood; the message names the file.
    """
    tried = False
    for path in paths:
        if path.suffix.lower() == ".obj":
            yield _read_obj(path)
            continue
        _check_header(path)
        try:
            yield _read_with_meshio(path)
        except MeshError:
            if path.suffix.lower() not in (".vtk", ".vtp"):
                raise
            tried = tried or not try_out(read_poly_data, *paths)
            if not (tried or (paths[1:] and not try_out(read_poly_data, path))):
                raise
            if (parts := _poly_data(path)) is None:
                raise
            yield parts


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


def _check_header(path: Path) -> None:
    """Refuse a file shorter than its header says, and a PLY or OFF file without a header.

    meshio reads a header that does not end for ever; meshio and VTK make room for as many vertices as a file
    claims, and look for all of them.

    Raises:
        MeshError: the message names file and line.
    """
    kind = path.suffix.lower()
    if kind not in COUNTS:
        return
    (pattern, dense), data = COUNTS[kind], path.read_bytes()
    end = re.search(rb"^\s*end_header\s*$", data, re.MULTILINE) if kind == ".ply" else None  # in no comment
    head = data[: end.start()] if end else data
    lines = list(re.finditer(pattern, head, re.MULTILINE | re.IGNORECASE))
    if (kind == ".ply" and not end) or (kind == ".off" and not lines):
        raise MeshError(f"{path}: cannot be read (its header does not end): {EXPORT_AGAIN}")
    for line in lines[:1] if kind == ".off" else lines:  # vertices of OFF may be whole numbers too
        for count in line[1].split():
            if len(count) > 20 or int(count) > dense * len(data):
                text = " ".join(line[0].decode(errors="replace").split())[:60]
                raise MeshError(f"{path}: cannot be read (shorter than '{text}' says): {EXPORT_AGAIN}")


def _read_with_meshio(path: Path) -> Parts:
    """Read points, polygons and data of the vertices."""
    import meshio

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
        message = printed.getvalue().strip() if isinstance(error, SystemExit) else str(error)
        reason = " ".join(message.split())[:300] or type(error).__name__
        raise MeshError(f"{path}: cannot be read ({reason}): {EXPORT_AGAIN}") from None
    kinds = [block for block in mesh.cells if block.type.startswith(("triangle", "quad", "polygon"))]
    data = {name: np.asarray(values) for name, values in mesh.point_data.items()}
    return Parts(mesh.points, [polygon for block in kinds for polygon in block.data], vertex_data=data)


def read_poly_data(path: Path) -> Any:
    """Return what VTK makes of a file. Raises an exception of pyvista, or crashes."""
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


def _poly_data(path: Path) -> Parts | None:
    """Return points and triangles of a file of PolyData that VTK can read; None if it holds none."""
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
