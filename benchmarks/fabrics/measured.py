"""Measured fabrics of a user's file.

The file is a CSV table with a row of heads. Its columns are known by their heads, in any order; others are
left alone, and a line without a name is called by its number:

    name, density[g/m2], bending warp[uN.m], bending weft[uN.m]
    voile, 62, 2.1, 1.4

The heads of the 618 fabrics of Feng et al. 2022 (doi 10.1145/3550454.3555464) are known too. No measured
fabric is part of this project.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path

from benchmarks.fabrics.fabric import Fabric, plain_name

# Head of a column, without its blanks -> field of a Fabric and its unit in SI.
HEADS = {
    "name": ("name", 1.0),
    "density[g/m2]": ("density", 1e-3),
    "bendingwarp[uN.m]": ("warp", 1e-6),
    "bendingweft[uN.m]": ("weft", 1e-6),
    "density[kg.m-2]": ("density", 1.0),
    "linearwarp[SI*1e9]": ("warp", 1e-9),
    "linearweft[SI*1e9]": ("weft", 1e-9),
}
EXPECTED = "name, density[g/m2], bending warp[uN.m], bending weft[uN.m]"
QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)  # of bending length, at which fabrics of a file are tested
RANGES = {"density": (1e-3, 10.0), "warp": (1e-9, 1.0), "weft": (1e-9, 1.0)}  # [kg/m^2, N m]


class FabricFileError(ValueError):
    """File that holds no fabrics; the message names file, line and remedy."""


def read_fabrics(path: str | Path) -> tuple[Fabric, ...]:
    """Read the fabrics of a CSV file, see above.

    Raises:
        FabricFileError: no such file, not understood, a missing column, or a number out of its range.
    """
    path = Path(path)
    try:
        lines = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FabricFileError(f"--fabrics {path}: cannot be read ({error}): give a CSV file") from None
    heads = {re.sub(r"\s", "", head): place for place, head in enumerate(lines[0] if lines else ())}
    columns = {HEADS[head][0]: (place, HEADS[head][1]) for head, place in heads.items() if head in HEADS}
    if missing := [field for field in RANGES if field not in columns]:
        raise FabricFileError(
            f"--fabrics {path}: line 1 has no column for {', '.join(missing)}: its heads are {EXPECTED}"
        )
    fabrics = [
        _fabric(f"{path}: line {number}", number, line, columns)
        for number, line in enumerate(lines[1:], start=2)
        if any(cell.strip() for cell in line)
    ]
    if not fabrics:
        raise FabricFileError(f"--fabrics {path}: holds no fabric below its heads")
    return tuple(fabrics)


def _fabric(where: str, number: int, line: Sequence[str], columns: dict[str, tuple[int, float]]) -> Fabric:
    """Return the fabric of one line. Raises FabricFileError."""
    values = {}
    for field, (low, high) in RANGES.items():
        place, unit = columns[field]
        text = line[place].strip() if place < len(line) else ""
        try:
            values[field] = unit * float(text)
        except ValueError:
            raise FabricFileError(f"--fabrics {where}: {field} '{text}' is no number") from None
        if not low <= values[field] <= high:
            raise FabricFileError(
                f"--fabrics {where}: {field} {text} is {values[field]:g} in SI units, outside {low:g} to "
                f"{high:g}: check its unit"
            )
    name = ""
    if "name" in columns:
        place, _ = columns["name"]
        if place >= len(line):
            raise FabricFileError(f"--fabrics {where}: ends before its name: give it as many cells as heads")
        name = plain_name(line[place])
    return Fabric(name or f"line_{number}", **values)


def spread_sample(fabrics: Sequence[Fabric]) -> tuple[Fabric, ...]:
    """Return at most five fabrics of different names, spread over the order of bending length."""
    by_name = {fabric.name: fabric for fabric in fabrics}
    ordered = sorted(by_name.values(), key=lambda fabric: fabric.bending_length)
    places = [math.floor(quantile * len(ordered)) for quantile in QUANTILES]
    return tuple(ordered[place] for place in dict.fromkeys(places))
