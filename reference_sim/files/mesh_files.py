"""Mesh files of other programs: read one, read a sequence, bring both to metres with y up.

OBJ is read here, since meshio refuses the texture coordinates of a garment with seams; PLY, STL and OFF are
read by meshio, VTK's files by VTK, which may crash: a process of its own tries these first.
"""

from __future__ import annotations

import contextlib
import glob
import io
import logging
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from reference_sim.cloth import MeshError
from reference_sim.files.array_file import try_out

VTK_SUFFIXES = (".vtk", ".vtp", ".vtu")
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", *VTK_SUFFIXES)
# What a header has that ends; meshio looks for it for ever.
HEADERS = {".ply": rb"^\s*end_header\s*$", ".off": rb"^\s*\d+\s+\d+\s+\d+\s*$"}
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
UP_AXES = ("y", "z")
LARGEST_COORDINATE = 1e12  # in any unit: squares and cubes of it are still numbers
# What programs call the texture coordinates of a vertex: two numbers, or one array of both.
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
UV_ARRAYS = ("UV", "uv", "TCoords", "Texture Coordinates", "TEXCOORD_0")


@dataclass(frozen=True, eq=False)
class Surface:
    """Mesh of a file, in its own unit and axes.

    Attributes:
        positions: (V, 3).
        faces: (F, 3) triangles.
        quads: number of four-cornered faces that were cut in two along the diagonal from their first corner.
        uv: (F, 3, 2) texture coordinates of the faces' corners, several for a vertex on a seam; NaN where a
            corner has none, None where no corner has any.
        vertex_data: name -> (V,) or (V, k), further values of the vertices in PLY and VTK files.
    """

    positions: np.ndarray
    faces: np.ndarray
    quads: int = 0
    uv: np.ndarray | None = None
    vertex_data: Mapping[str, np.ndarray] = field(default_factory=dict)


class Contents(NamedTuple):
    """Contents of a file, before polygons become triangles.

    uv_polygons are places in uv (N, 2), parallel to polygons and -1 for a corner without; none in a file
    whose vertex_data have the texture coordinates.
    """

    points: Any
    polygons: Sequence[Any]
    vertex_data: Mapping[str, np.ndarray]
    uv: Sequence[Sequence[float]] = ()
    uv_polygons: Sequence[Any] = ()


def read_mesh(path: str | Path) -> Surface:
    """Read the triangles and quads of one mesh file.

    Raises:
        MeshError: missing or unreadable file, unknown format, no faces, faces with five corners or more,
            a vertex that is not finite; the message names the file.

    >>> import tempfile
    >>> from reference_sim.trajectory import write_obj
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_obj(Path(folder, "a.obj"), np.eye(3), np.array([[0, 1, 2]]))
    ...     read_mesh(f"{folder}/a.obj").faces
    array([[0, 1, 2]])
    """
    return next(_read([Path(path)]))


def _read(paths: Sequence[Path]) -> Iterator[Surface]:
    for path in paths:
        if not path.is_file():
            raise MeshError(f"{path}: no such file")
        if path.suffix.lower() not in MESH_SUFFIXES:
            raise MeshError(f"{path}: unknown kind of mesh: convert it to one of {', '.join(MESH_SUFFIXES)}")
    of_vtk = [path for path in paths if path.suffix.lower() in VTK_SUFFIXES]
    if of_vtk and try_out(read_vtk, *of_vtk):
        path, reason = next((path, why) for path in of_vtk if (why := try_out(read_vtk, path)))
        raise MeshError(f"{path}: cannot be read ({reason}): export it again, as OBJ or PLY")
    for path in paths:
        read = _read_obj if path.suffix.lower() == ".obj" else read_vtk if of_vtk else _read_with_meshio
        yield _surface(path, read(path))


def _read_obj(path: Path) -> Contents:
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    uv: list[list[float]] = []
    uv_polygons: list[list[int]] = []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            kind, *words = line.partition("#")[0].split() or [""]
            try:
                if kind == "v":
                    x, y, z = words[:3]  # colours may follow
                    points.append([float(x), float(y), float(z)])
                elif kind == "vt":
                    uv.append([float(words[0]), float(words[1]) if len(words) > 1 else 0.0])
                elif kind == "f":
                    corners = [[*word.split("/"), ""] for word in words]
                    polygons.append([_counted(c[0], len(points)) for c in corners])
                    uv_polygons.append([_counted(c[1], len(uv)) if c[1] else -1 for c in corners])
            except (ValueError, IndexError):
                raise MeshError(f"{path}: line {number} is not understood: {line.strip()[:60]!r}") from None
    return Contents(points, polygons, {}, uv, uv_polygons)


def _counted(text: str, count: int) -> int:
    """Return an index from 0 on: OBJ counts from 1, and from the last by -1. Raises ValueError."""
    number = int(text)
    if not 0 < abs(number) < 1 << 62:
        raise ValueError(text)
    return number - 1 if number > 0 else count + number


def _read_with_meshio(path: Path) -> Contents:
    import meshio

    printed = io.StringIO()
    try:
        pattern = HEADERS.get(path.suffix.lower())
        if pattern and not re.search(pattern, path.read_bytes(), re.MULTILINE):
            raise ValueError("its header does not end")
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
        raise MeshError(f"{path}: cannot be read ({reason}): export it again, as OBJ") from None
    kinds = [block for block in mesh.cells if block.type.startswith(("triangle", "quad", "polygon"))]
    data = {name: np.asarray(values) for name, values in mesh.point_data.items()}
    return Contents(mesh.points, [polygon for block in kinds for polygon in block.data], data)


def read_vtk(path: Path) -> Contents:
    """Read surface cells and values of vertices by VTK. Raises an exception of pyvista, or crashes."""
    import pyvista

    try:
        with (
            warnings.catch_warnings(),
            pyvista.vtk_verbosity("off"),
            pyvista.VtkErrorCatcher(raise_errors=True, send_to_logging=False),
        ):
            warnings.simplefilter("ignore")
            logging.disable(logging.CRITICAL)  # to which readers of pyvista hand errors on
            mesh: Any = pyvista.read(path)
    finally:
        logging.disable(logging.NOTSET)
    if isinstance(mesh, pyvista.PolyData):
        polygons = list(mesh.irregular_faces)
    else:
        kinds = (pyvista.CellType.TRIANGLE, pyvista.CellType.QUAD, pyvista.CellType.POLYGON)
        polygons = [mesh.get_cell(i).point_ids for i, kind in enumerate(mesh.celltypes) if kind in kinds]
    data = {name: np.asarray(mesh.point_data[name]) for name in mesh.point_data}
    if mesh.active_texture_coordinates is not None:
        data[UV_ARRAYS[0]] = np.asarray(mesh.active_texture_coordinates)
    return Contents(mesh.points, polygons, data)


def _surface(path: Path, parts: Contents) -> Surface:
    """Check the contents of a file, and cut its quads into triangles."""
    positions, polygons = np.asarray(parts.points, dtype=np.float64), parts.polygons
    if not polygons:
        raise MeshError(f"{path}: no triangles in it: export the surface as triangles")
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise MeshError(f"{path}: vertices have shape {positions.shape}: expected three coordinates each")
    bad = np.flatnonzero(~(np.abs(positions) < LARGEST_COORDINATE).all(axis=1))
    if bad.size:
        where = positions[bad[0]].tolist()
        raise MeshError(
            f"{path}: vertex {bad[0]} is not finite, or farther than {LARGEST_COORDINATE:g}: {where}"
        )
    corners = np.array([len(polygon) for polygon in polygons])
    if corners.max() > 4 or corners.min() < 3:
        k = int(np.argmax((corners > 4) | (corners < 3)))
        raise MeshError(f"{path}: face {k} has {corners[k]} corners: triangulate the mesh")
    faces = np.array(_halved(polygons), dtype=np.int64)
    bad = np.flatnonzero((faces < 0).any(axis=1) | (faces >= len(positions)).any(axis=1))
    if bad.size:
        raise MeshError(f"{path}: triangle {bad[0]} names a vertex beyond the {len(positions)} there are")
    uv = _corner_uv(path, parts, faces)
    return Surface(positions, faces, int((corners == 4).sum()), uv, parts.vertex_data)


def _halved(polygons: Sequence[Any]) -> list[tuple[int, int, int]]:
    """Cut quads into triangles; triangles stay."""
    return [half for p in polygons for half in ((p[0], p[1], p[2]), (p[0], p[2], p[-1]))[: len(p) - 2]]


def _corner_uv(path: Path, parts: Contents, faces: np.ndarray) -> np.ndarray | None:
    """Return the texture coordinates (F, 3, 2) of the faces' corners, NaN where there are none."""
    places = faces
    if parts.uv_polygons:
        uv, places = np.asarray(parts.uv, dtype=np.float64), np.array(_halved(parts.uv_polygons), np.int64)
    else:
        vertex_uv = _uv_of_vertices(parts.vertex_data)
        if vertex_uv is None:
            return None
        uv = vertex_uv
    if (places < 0).all():
        return None
    bad = np.flatnonzero((places >= len(uv)).any(axis=1) | (places < -1).any(axis=1))
    if bad.size:
        raise MeshError(
            f"{path}: triangle {bad[0]} names a texture coordinate beyond the {len(uv)} there are: export it "
            "again"
        )
    return np.where(places[..., None] < 0, np.nan, uv[places])


def _uv_of_vertices(data: Mapping[str, np.ndarray]) -> np.ndarray | None:
    for u, v in UV_NAMES:
        if u in data and v in data:
            return np.stack([data[u], data[v]], axis=1).astype(np.float64)
    for name in UV_ARRAYS:
        if name in data and data[name].ndim == 2 and data[name].shape[1] >= 2:
            return data[name][:, :2].astype(np.float64)
    return None


def read_sequence(pattern: str | Path) -> tuple[np.ndarray, Surface]:
    """Read a moving mesh: positions (T, B, 3) and, for its faces, the first mesh.

    Args:
        pattern: one mesh (T = 1), a folder of meshes of one kind, or a glob such as "body_*.obj". Files are
            taken in the order of the numbers in their names.

    Raises:
        MeshError: as `read_mesh`; no files; vertices or faces that do not correspond to the first file's.

    >>> import tempfile
    >>> from reference_sim.trajectory import write_obj
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for frame in range(2):
    ...         write_obj(Path(folder, f"{frame}.obj"), np.eye(3) + frame, np.array([[0, 1, 2]]))
    ...     positions, first = read_sequence(f"{folder}/*.obj")
    >>> positions.shape
    (2, 3, 3)
    """
    paths = _paths(str(pattern))
    surfaces = _read(paths)
    first = next(surfaces)
    frames = [first.positions]
    for path, surface in zip(paths[1:], surfaces, strict=True):
        _check_corresponds(path, surface, paths[0], first)
        frames.append(surface.positions)
    return np.stack(frames), first


def _paths(pattern: str) -> list[Path]:
    """Return the files that `read_sequence` reads, in its order.

    Raises:
        MeshError: there are none, or they are of several kinds.
    """
    path = Path(pattern)
    if path.is_dir():
        paths = [p for p in path.iterdir() if p.suffix.lower() in MESH_SUFFIXES]
        if not paths:
            raise MeshError(f"{path}: no mesh in this folder ({', '.join(MESH_SUFFIXES)})")
    elif path.exists() or not glob.has_magic(pattern):
        paths = [path]
    else:
        paths = [Path(name) for name in glob.glob(pattern)]
        if not paths:
            raise MeshError(f"{pattern}: no file matches (quote the pattern, or the shell expands it)")
    kinds = sorted({p.suffix.lower() for p in paths})
    if len(kinds) > 1:
        raise MeshError(
            f"{pattern}: meshes of several kinds ({', '.join(kinds)}): name one, as in '*{kinds[0]}'"
        )
    return sorted(paths, key=lambda p: [int(s) if s.isdigit() else s for s in re.split(r"(\d+)", str(p))])


def _check_corresponds(path: Path, surface: Surface, first_path: Path, first: Surface) -> None:
    remedy = "a sequence needs one numbering: export OBJ or PLY without reordering"
    for noun, rows, first_rows in (
        ("vertices", surface.positions, first.positions),
        ("faces", surface.faces, first.faces),
    ):
        if len(rows) != len(first_rows):
            raise MeshError(
                f"{path}: {len(rows)} {noun}, but {first_path.name} has {len(first_rows)}: {remedy}"
            )
    bad = np.flatnonzero((surface.faces != first.faces).any(axis=1))
    if bad.size:
        face, first_face = surface.faces[bad[0]].tolist(), first.faces[bad[0]].tolist()
        raise MeshError(f"{path}: face {bad[0]} = {face}, but {first_face} in {first_path.name}: {remedy}")


def to_metres_y_up(positions: np.ndarray, *, units: str = "m", up: str = "y") -> np.ndarray:
    """Bring positions (..., 3) of a file to metres with y up; z up is turned by a quarter about x.

    Args:
        positions: (..., 3) in the file's unit and axes.
        units: a key of METRES.
        up: one of UP_AXES.

    Raises:
        ValueError: unknown unit or axis.

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
