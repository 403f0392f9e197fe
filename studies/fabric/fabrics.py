"""Fabrics: mass per area and flexural rigidities; those of the study, and a user's own beside its files.

| beside the study | content |
| --- | --- |
| measured.csv | a table of fabrics with a row of heads; five, spread over the bending lengths, are tested |
| GAUGE-Dataset | a copy of GAUGE (Wang et al. 2026), of which the metadata of textiles is read |

Columns of measured.csv are known by their heads, in any order; others are left alone, a line without a
name is called by its number, and fabrics of one name are numbered. With semicolons between its cells, a
comma is the decimal sign:

    name, density[g/m2], bending warp[uN.m], bending weft[uN.m]
    voile, 62, 2.1, 1.4

The heads of the 618 fabrics of Feng et al. 2022 (doi 10.1145/3550454.3555464) are known too. GAUGE gives
mass per area [kg/m^2] and bending stiffness, taken as [N m] because no unit is stated. Neither is part of
this project.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks import DeclarationError
from reference_sim import GRAVITY, Material

SNUG = Material()
SCALED, PRINTED = 1 / 4, 3**0.5 / 2  # rigidity of a plate of equilateral triangles over k of its hinges
HERE = Path(__file__).parent

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


@dataclass(frozen=True)
class Fabric:
    """Fabric as textile laboratories describe it.

    Attributes:
        name: in scenes and tables.
        density: mass per area [kg/m^2].
        warp, weft: flexural rigidity per width along each direction [N m].

    >>> round(1e3 * Fabric("cotton", 0.2, 1e-5, 1e-5).bending_length, 1)  # [mm]
    17.2
    """

    name: str
    density: float
    warp: float
    weft: float

    @property
    def rigidity(self) -> float:
        """Overall flexural rigidity (warp weft)^(1/2) [N m], as ASTM D1388 defines it."""
        return (self.warp * self.weft) ** 0.5

    @property
    def bending_length(self) -> float:
        """Bending length c = (rigidity / weight per area)^(1/3) [m] (Peirce 1930)."""
        return (self.rigidity / (self.density * GRAVITY)) ** (1 / 3)


def plain_name(text: str) -> str:
    """Return a fabric's name as scenes can carry it, maybe empty.

    >>> plain_name(" twill 2/1 ")
    'twill_2_1'
    """
    return re.sub(r"[^A-Za-z0-9_.+-]+", "_", text.strip()).strip("_")


def isotropic(name: str, density: float, bending_length: float) -> Fabric:
    """Return the fabric of that mass per area [kg/m^2] and bending length [m]."""
    rigidity = density * GRAVITY * bending_length**3
    return Fabric(name, density, rigidity, rigidity)


def _snug(name: str, factor: float) -> Fabric:
    rigidity = SNUG.bending_stiffness * factor
    return Fabric(name, SNUG.areal_density, rigidity, rigidity)


# SNUG's cotton by both readings of its bending term, and round numbers inside the range of measured
# cloth: thin and thick, limp and stiff, so that an order of bending lengths is no order of weights.
FABRICS = (
    isotropic("thin_limp", 0.06, 14e-3),
    isotropic("thick_limp", 0.40, 16e-3),
    _snug("snug", SCALED),
    isotropic("thin_crisp", 0.08, 22e-3),
    _snug("snug_printed", PRINTED),
    isotropic("thick_stiff", 0.38, 32e-3),
)


def find_fabric(name: str) -> Fabric:
    """Return one of FABRICS by its name."""
    return next(fabric for fabric in FABRICS if fabric.name == name)


def read_fabrics(path: Path) -> tuple[Fabric, ...]:
    """Read the fabrics of a CSV file, see above.

    Raises:
        DeclarationError: not understood, a missing column, or a number out of its range; names the line.
    """
    try:
        if path.exists() and not path.is_file():  # a pipe could be read without end
            raise OSError("no regular file")
        rows = path.read_text(encoding="utf-8-sig").splitlines()
        # Spreadsheets of half of Europe write 2,1;1,4.
        delimiter = ";" if rows and ";" in rows[0] else ","
        if delimiter == ";" and any("," in row for row in rows[1:]):
            rows[1:] = [row.translate(str.maketrans(",.", ".,")) for row in rows[1:]]
        lines = list(csv.reader(rows, delimiter=delimiter))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DeclarationError(f"{path}: cannot be read ({error}): give a CSV file") from None
    columns: dict[str, tuple[int, float]] = {}
    for place, head in enumerate(re.sub(r"[\s\ufeff]", "", head) for head in (lines[0] if lines else ())):
        if head in HEADS:
            field, unit = HEADS[head]
            if field in columns:
                raise DeclarationError(f"{path}: line 1 has two columns for {field}: leave one")
            columns[field] = (place, unit)
    if missing_fields := [field for field in RANGES if field not in columns]:
        names = ", ".join(missing_fields)
        raise DeclarationError(f"{path}: line 1 has no column for {names}: its heads are {EXPECTED}")
    fabrics = [
        _fabric(f"{path}: line {number}", number, line, len(lines[0]), columns)
        for number, line in enumerate(lines[1:], start=2)
        if any(cell.strip() for cell in line)
    ]
    if not fabrics:
        raise DeclarationError(f"{path}: holds no fabric below its heads")
    return _named_apart(fabrics)


def _fabric(
    source: str, number: int, line: Sequence[str], heads: int, columns: dict[str, tuple[int, float]]
) -> Fabric:
    """Return the fabric of one line. Raises DeclarationError."""
    if len(line) <= max(place for place, _ in columns.values()) or any(
        cell.strip() for cell in line[heads:]
    ):
        raise DeclarationError(f"{source}: has {len(line)} cells for {heads} heads: give it as many")
    values = {}
    for field in RANGES:
        place, unit = columns[field]
        try:
            values[field] = unit * float(line[place])
        except ValueError:
            raise DeclarationError(f"{source}: {field} '{line[place].strip()}' is no number") from None
    name = plain_name(line[columns["name"][0]]) if "name" in columns else ""
    return _in_range(source, Fabric(name or f"line_{number}", **values))


def _named_apart(fabrics: Sequence[Fabric]) -> tuple[Fabric, ...]:
    """Return the fabrics, names that several have with a number behind: scenes are told apart by them."""
    named: dict[str, Fabric] = {}
    for fabric in fabrics:
        name, number = fabric.name, 1
        while name in named:
            number += 1
            name = f"{fabric.name}_{number}"
        named[name] = replace(fabric, name=name)
    return tuple(named.values())


def _in_range(source: str, fabric: Fabric) -> Fabric:
    """Return the fabric. Raises DeclarationError for a number that no cloth has."""
    for field, (low, high) in RANGES.items():
        if not low <= getattr(fabric, field) <= high:
            number = f"{field} {getattr(fabric, field):g} in SI units"
            raise DeclarationError(f"{source}: {number} is outside {low:g} to {high:g}: check its unit")
    return fabric


def read_gauge(folder: Path) -> tuple[Fabric, ...]:
    """Read the fabrics of a copy of GAUGE, of its experiment "stretching" or else "bending".

    Raises:
        DeclarationError: no such file, one that is not understood, or a number out of its range.
    """
    paths = [
        folder / "metadata" / "textile" / f"textile {task}.json" for task in ("stretching", "bending")
    ]
    path = next((path for path in paths if path.is_file()), paths[-1])
    try:
        materials = json.loads(path.read_text(encoding="utf-8"))["assets"]["textile"]["material"]
        data = {key: (float(m["density"]), float(m["bend stiffness"])) for key, m in materials.items()}
    except (OSError, KeyError, TypeError, AttributeError, ValueError) as error:
        reason = f"not the metadata of a textile task ({type(error).__name__}: {error})"
        raise DeclarationError(f"{path}: {reason}: download it again") from None
    return _named_apart(
        [
            _in_range(f"{path}: {key}", Fabric(plain_name(key), density, k, k))
            for key, (density, k) in data.items()
        ]
    )


def spread_sample(fabrics: Sequence[Fabric]) -> tuple[Fabric, ...]:
    """Return at most five of the fabrics, spread over the order of bending length."""
    ordered = sorted(fabrics, key=lambda fabric: fabric.bending_length)
    places = [math.floor(quantile * len(ordered)) for quantile in QUANTILES if ordered]
    return tuple(ordered[place] for place in dict.fromkeys(places))


def measured_fabrics(folder: Path = HERE) -> tuple[Fabric, ...]:
    """Return all fabrics of a user's measured.csv, none where there is no such file."""
    path = folder / "measured.csv"
    return read_fabrics(path) if path.is_file() else ()


def users_fabrics(folder: Path = HERE) -> tuple[Fabric, ...]:
    """Return the fabrics that a user has put into a folder, to be tested like FABRICS."""
    measured = [replace(f, name=f"measured/{f.name}") for f in spread_sample(measured_fabrics(folder))]
    gauge = read_gauge(folder / "GAUGE-Dataset") if (folder / "GAUGE-Dataset").is_dir() else ()
    return (*measured, *(replace(fabric, name=f"gauge/{fabric.name}") for fabric in gauge))
