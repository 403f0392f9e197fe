"""A stored roll-out as a method of a run: its table in a study, and --rollout NAME=FILE."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CHARACTERS = r"\w+.-"  # of a name, as a class of a regular expression
MODULE = "benchmarks.methods.outside.stored_roll_out"
PLACE = "{scene}"  # in a path: the scene's name, its slashes as hyphens


class RollOutFileError(ValueError):
    """A roll-out that cannot be read or does not belong to the scene; the message names file and remedy."""


@dataclass(frozen=True)
class FileConventions:
    """Unit, up axis and frames per second of a roll-out's file, and what its vertices are.

    match_vertices: the scene's in another order. other_mesh: those of another mesh of the same garment.
    """

    units: str = "m"
    up: str = "y"
    fps: float | None = None
    match_vertices: bool = False
    other_mesh: bool = False

    def __post_init__(self) -> None:
        from reference_sim.files.mesh_files import METRES, UP_AXES

        for what, value, known in (("units", self.units, tuple(METRES)), ("up", self.up, UP_AXES)):
            if value not in known:
                raise RollOutFileError(f"{what}={value}: choose from {', '.join(known)}")
        if self.fps is not None and not 0.0 < self.fps < 1e6:
            raise RollOutFileError(f"fps={self.fps}: give a positive number of frames per second")
        if self.match_vertices and self.other_mesh:
            raise RollOutFileError(
                "match_vertices and other_mesh: another mesh has no vertex to match, give one"
            )


@dataclass(frozen=True)
class RollOutOption:
    """One roll-out: its name, its path, what is said of the file, and the declared time of a frame [ms]."""

    name: str
    path: str
    stated: FileConventions
    declared_ms: float | None = None
    role: str = "external"

    def __post_init__(self) -> None:
        if (ms := self.declared_ms) is not None and not 0.0 < ms < 1e9:
            raise RollOutFileError(f"declared time {ms} ms: give a positive number of milliseconds a frame")
        if not re.fullmatch(rf"\w[{CHARACTERS}]*", self.name):
            raise RollOutFileError(
                f"{self.path}: the name '{self.name}' has other than letters, digits and _-+., or "
                "begins with one of -+."
            )

    @property
    def places(self) -> bool:
        """True where there is a file for each of several scenes."""
        return PLACE in self.path

    def path_for(self, scene: str) -> str:
        """Return the path of the roll-out in a scene."""
        return self.path.replace(PLACE, scene.replace("/", "-"))


FIELDS: dict[str, type] = {
    "path": str, "units": str, "up": str, "fps": float, "match_vertices": bool, "other_mesh": bool,
    "ms": float,
}  # fmt: skip


def roll_out_of(name: str, table: Mapping[str, Any]) -> RollOutOption:
    """Return the roll-out of that name with the fields of a study's table. Raises RollOutFileError.

    >>> roll_out_of("mine", {"path": "out.npz", "units": "cm"}).stated.units
    'cm'
    """
    values = {key.replace("-", "_"): value for key, value in table.items()}
    for key, value in values.items():
        if key not in FIELDS:
            raise RollOutFileError(f"unknown word '{key}'; there are {', '.join(FIELDS)}")
        if FIELDS[key] is float and type(value) not in (int, float):
            raise RollOutFileError(f"{key}={value} is no number")
        if FIELDS[key] is not float and type(value) is not FIELDS[key]:
            wanted = "say it, or leave it out" if FIELDS[key] is bool else "give a text"
            raise RollOutFileError(f"{key}={value}: {wanted}")
    path, declared = values.pop("path", ""), values.pop("ms", None)
    return RollOutOption(name, path, FileConventions(**values), declared)


def parse_roll_out(text: str, *, named: bool = True) -> tuple[str, dict[str, Any]]:
    """Parse NAME=FILE[,key=value...] into the name and its table; without `named`, NAME= may be absent.

    Raises:
        RollOutFileError: there is no name or no file.

    >>> parse_roll_out("mine=out.npz,units=cm,ms=2.2")
    ('mine', {'path': 'out.npz', 'units': 'cm', 'ms': 2.2})
    """
    given, *pairs = text.split(",")
    name, equals, path = (part.strip() for part in given.partition("="))
    if not (named or equals):
        stem = Path(given.rstrip("/").replace(PLACE, "")).stem
        name, path = re.sub(rf"[^{CHARACTERS}]+", "-", stem).strip("_-+.") or "roll-out", given.strip()
    if not (name and path):
        raise RollOutFileError(f"{text}: give NAME=FILE, with ,units=cm and the like behind it")
    return name, {"path": path, **dict(map(_word, pairs))}


def _word(text: str) -> tuple[str, Any]:
    """Return key and value of key=value; of a key alone, True."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        return key, True
    try:
        return key, float(value)
    except ValueError:
        return key, value
