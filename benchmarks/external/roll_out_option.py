"""--rollout NAME=FILE: a stored roll-out as a method of a run."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

CHARACTERS = r"\w+.-"  # of a name, as a class of a regular expression
MODULE = "benchmarks.methods.outside.stored_roll_out"
PLACE = "{scene}"  # in a path: the scene's name, its slashes as hyphens
HELP = (
    "a roll-out of another program as a method; the path may have {scene}, the scene's name with hyphens for "
    "slashes; after it units=cm, up=z, fps=60, match-vertices or other-mesh, ms=2.2 (a frame, as its author "
    "says)"
)


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
                raise RollOutFileError(f"--{what} {value}: choose from {', '.join(known)}")
        if self.fps is not None and not 0.0 < self.fps < 1e6:
            raise RollOutFileError(f"--fps {self.fps}: give a positive number of frames per second")
        if self.match_vertices and self.other_mesh:
            raise RollOutFileError(
                "--match-vertices and --other-mesh: another mesh has no vertex to match, give one"
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


def parse_roll_out(text: str) -> RollOutOption:
    """Parse NAME=FILE[,key=value...]. Raises RollOutFileError.

    >>> parse_roll_out("mine=out.npz,units=cm,ms=2.2").declared_ms
    2.2
    """
    given, *pairs = text.split(",")
    name, equals, path = (part.strip() for part in given.partition("="))
    if not (name and equals and path):
        raise RollOutFileError(f"--rollout {text}: give NAME=FILE, with ,units=cm and the like behind it")
    fields: dict[str, Any] = {}
    for pair in pairs:
        key, equals, value = (part.strip() for part in pair.partition("="))
        if key not in (known := (*_WORDS, *_FLAGS)):
            raise RollOutFileError(f"--rollout {text}: unknown word '{key}'; there are {', '.join(known)}")
        if key in _FLAGS:
            if equals:
                raise RollOutFileError(f"--rollout {text}: {key} takes no value: say it, or leave it out")
            fields[_FLAGS[key]] = True
            continue
        field, convert = _WORDS[key]
        try:
            fields[field] = convert(value)
        except ValueError:
            raise RollOutFileError(f"--rollout {text}: {key}={value} is no number") from None
    declared = fields.pop("declared_ms", None)
    return RollOutOption(name, path, FileConventions(**fields), declared)


_WORDS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "units": ("units", str),
    "up": ("up", str),
    "fps": ("fps", float),
    "ms": ("declared_ms", float),
}
_FLAGS = {"match-vertices": "match_vertices", "other-mesh": "other_mesh"}  # words without a value
