"""Contents of OBJ and PLY files: points, polygons and texture coordinates, as they stand there.

The libraries at hand do not: meshio refuses texture coordinates of corners, VTK keeps PLY in single
precision, libigl drops texture coordinates.

Nothing is allocated by a number that a file states, which may be more than its bytes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))  # of a vertex, as programs call them
PLY_NUMBERS = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f",
    "double": "d", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
PLY_ORDER = {"ascii": "text", "binary_little_endian": "<", "binary_big_endian": ">"}
# Points, polygons, texture coordinates, and their places along polygons, -1 for a corner without.
Contents = tuple[Any, Sequence[Any], Any, Sequence[Any]]


def read_contents(path: Path) -> Contents:
    """Read a file by its ending, which READERS has. Raises ValueError, without the file's name."""
    try:
        with np.errstate(all="ignore"):  # numbers that are not finite are refused with their vertex
            return READERS[path.suffix.lower()](path)
    except struct.error:
        raise ValueError("ends before what its header states: export it again, as OBJ") from None
    except (ValueError, KeyError, OverflowError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ValueError(f"cannot be read ({reason}): export it again, as OBJ") from None


def _read_obj(path: Path) -> Contents:
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    uv: list[list[float]] = []
    uv_polygons: list[list[int]] = []
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            kind, *fields = line.partition("#")[0].split() or [""]
            try:
                if kind == "v":
                    x, y, z = fields[:3]  # colours may follow
                    points.append([float(x), float(y), float(z)])
                elif kind == "vt":
                    uv.append([float(fields[0]), float(fields[1]) if len(fields) > 1 else 0.0])
                elif kind == "f":
                    corners = [[*word.split("/"), ""] for word in fields]
                    polygons.append([_resolve_index(c[0], len(points)) for c in corners])
                    uv_polygons.append([_resolve_index(c[1], len(uv)) if c[1] else -1 for c in corners])
            except (ValueError, IndexError):
                fault = f"line {number} is not understood: {line.strip()[:60]!r}"
                raise ValueError(fault) from None
    return points, polygons, uv, uv_polygons


def _resolve_index(text: str, count: int) -> int:
    """Return an index from 0 on: OBJ counts from 1, and from the last by -1. Raises ValueError."""
    number = _index(text)
    if number == 0 or count + number < 0:
        raise ValueError(text)
    return number - 1 if number > 0 else count + number


def _index(text: str | float) -> int:
    """Return a whole number that an array can hold. Raises ValueError."""
    number = int(text)
    if abs(number) >= 1 << 62:
        raise ValueError(f"{text} is no index")
    return number


def _read_ply(path: Path) -> Contents:
    """Read PLY, text or binary, with whatever further elements, properties and lists it has."""
    data = path.read_bytes()
    head = re.match(rb"ply\s[\s\S]{1,65536}?\bend_header[ \t]*\r?\n", data)
    if head is None:
        raise ValueError("its header does not end")
    order, at = "text", head.end()
    elements: list[tuple[str, int, dict[str, str]]] = []  # name, count, types of properties
    for line in head.group().decode("utf-8", "replace").splitlines()[1:]:
        match line.split():
            case ["format", kind, _] if kind in PLY_ORDER:
                order = PLY_ORDER[kind]
            case ["element", name, count] if count.isdecimal():
                elements.append((name, int(count), {}))
            case ["property", "list", size, kind, name] if elements and name not in elements[-1][2]:
                elements[-1][2][name] = PLY_NUMBERS[size] + PLY_NUMBERS[kind]
            case ["property", kind, name] if elements and name not in elements[-1][2]:
                elements[-1][2][name] = PLY_NUMBERS[kind]
            case ["comment" | "obj_info" | "end_header", *_] | []:
                pass
            case _:
                raise ValueError(f"its header is not understood: {line.strip()[:60]!r}")
    if order == "text":  # becomes a row of doubles
        data, at = np.fromiter(map(float, data[at:].split()), np.float64).tobytes(), 0
    contents: dict[str, dict[str, Any]] = {}
    for name, number, properties in elements:
        contents[name], at = _read_records(data, at, number, properties, order)
    if order == "text" and at < len(data):
        raise ValueError("has more numbers than its header states")
    vertex: dict[str, Any]
    face: dict[str, Any]
    vertex, face = (
        {name: values for name, values in contents.get(key, {}).items() if isinstance(values, kind)}
        for key, kind in (("vertex", np.ndarray), ("face", list))
    )
    points = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    polygons: Any = face.get("vertex_indices", face.get("vertex_index", ()))
    if any(map(len, corners := face.get("texcoord", ()))):  # u0 v0 u1 v1 ... of each face
        uv = np.concatenate([[], *corners]).reshape(-1, 2)
        ends = np.cumsum([len(numbers) // 2 for numbers in corners])
        places = [
            range(end - len(polygon), end) if len(numbers) == 2 * len(polygon) else [-1] * len(polygon)
            for polygon, numbers, end in zip(polygons, corners, ends)
        ]
        return points, polygons, uv, places
    for u, v in UV_NAMES:
        if u in vertex and v in vertex:
            return points, polygons, np.stack([vertex[u], vertex[v]], axis=1), polygons
    return points, polygons, (), ()


def _read_records(
    data: bytes, at: int, count: int, properties: dict[str, str], order: str
) -> tuple[dict[str, Any], int]:
    """Return arrays of numbers or lists of lists by property, and the place behind `count` records."""
    codes = properties if order != "text" else {name: "d" * len(properties[name]) for name in properties}
    order = order.replace("text", "<")
    if max(map(len, codes.values()), default=1) == 1:  # no lists
        record = np.dtype([(name, order + code) for name, code in codes.items()])
        if count * record.itemsize > len(data) - at:
            raise ValueError("ends before what its header states")
        table = np.frombuffer(data, record, count, at) if count else np.empty(0, record)
        return {name: table[name].astype(code) for name, code in properties.items()}, at + table.nbytes
    values: dict[str, Any] = {name: [] for name in properties}
    for _ in range(count):
        for name, code in codes.items():
            row: tuple[Any, ...] = (1,)
            for kind in code:  # a list's length, and its numbers
                kinds = f"{order}{int(row[0])}{kind}"
                row = struct.unpack_from(kinds, data, at)
                at += struct.calcsize(kinds)
            if properties[name][-1] not in "fd":
                if any(number != int(number) for number in row):
                    raise ValueError(f"a number of {name} is not whole")
                row = tuple(map(_index, row))
            values[name].append(row)
    return {n: v if len(codes[n]) > 1 else np.array(v)[:, 0] for n, v in values.items()}, at


READERS: dict[str, Callable[[Path], Contents]] = {".obj": _read_obj, ".ply": _read_ply}
