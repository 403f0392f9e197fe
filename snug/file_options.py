"""Words behind the path of a file, as in shirt.obj,units=cm,up=z; every command reads them so.

Light to import; snug.garments.reading and snug.motion.files read the files.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Collection
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

MESH_SUFFIXES = (".obj", ".ply")
UNITS, AXES, REST_SHAPES = ("m", "cm", "mm", "in"), ("y", "z"), ("mesh", "uv")
GARMENT_WORDS = """behind the path of a garment, as in shirt.obj,units=cm,up=z: units (m, cm, mm, in),
up (y, z), shift='0 0.1 0' [m] where the body stood elsewhere, rest=uv where the UV chart is the pattern,
uv_scale (metres per unit of the chart), material (.toml of young_modulus [Pa], poisson_ratio,
thickness [m], density [kg/m^3], bending_stiffness [J]), weld [m]: joins closer vertices"""
# name -> role -> numbers of clips, with their sources
SPLITS = tomllib.loads((Path(__file__).parent / "motion/splits.toml").read_text(encoding="utf-8"))
MOTION_WORDS = f"""behind the path of motions, as in clips/,up=z: up (y, z), fps (of files that state none),
split ({", ".join(SPLITS)}: of a folder of CMU's or AMASS's files the clips of that paper alone)"""


@dataclass(frozen=True, kw_only=True)
class GarmentFile:
    """A mesh file with all that it does not state itself.

    Attributes:
        path: OBJ or PLY.
        units: of the file, "m", "cm", "mm" or "in".
        up: vertical axis of the file, "y" or "z".
        shift: (3,) [m], added after conversion.
        rest: shape without strain, "mesh" or "uv".
        uv_scale: metres per unit of the chart, by default the file's unit.
        material: a file of reference_sim.material.Material.
        weld: distance [m] below which two vertices are one.

    Raises:
        ValueError: a word without sense, or a file whose name cannot name scenes and networks.
    """

    path: Path
    units: str = "m"
    up: str = "y"
    shift: tuple[float, ...] = (0.0, 0.0, 0.0)
    rest: str = "mesh"
    uv_scale: float | None = None
    material: Path | None = None
    weld: float = 1e-6

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))
        for name, choices in (("units", UNITS), ("up", AXES), ("rest", REST_SHAPES)):
            _demand_one_of(choices, name, getattr(self, name))
        if len(self.shift) != 3 or not all(map(_is_number, self.shift)):
            raise ValueError(f"shift={self.shift}: give three numbers [m], as '0 0.1 0'")
        if not _is_number(self.weld) or self.weld <= 0.0:
            raise ValueError(f"weld={self.weld}: give a distance above 0 [m]")
        scale = self.uv_scale
        if scale is not None and (self.rest != "uv" or not _is_number(scale) or scale <= 0.0):
            raise ValueError(
                f"uv_scale={scale}: is a number above 0 for a rest shape from UV: add rest=uv"
            )
        if not re.fullmatch(r"\w[\w.+-]*", self.name):
            raise ValueError(
                f"garment {self.path}: '{self.name}' cannot name scenes and networks: give the file a name "
                "of letters and digits"
            )

    @property
    def name(self) -> str:
        """Name in scenes and of networks."""
        return self.path.stem


@dataclass(frozen=True, kw_only=True)
class MotionFileOptions:
    """Facts that a motion's file does not state.

    Attributes:
        up: vertical axis of the file, "y" or "z"; empty: found from the motion.
        fps: frames per second of a file that states none [1/s].
        split: name of one of SPLITS; its clips alone are read, from the folder and all below it.

    Raises:
        ValueError: a word without sense.
    """

    up: str = ""
    fps: float | None = None
    split: str = ""

    def __post_init__(self) -> None:
        _demand_one_of(("", *AXES), "up", self.up)
        _demand_one_of(("", *SPLITS), "split", self.split)
        if self.fps is not None and not _is_number(self.fps):
            raise ValueError(f"fps={self.fps}: give a number of frames per second")

    def clips(self, *roles: str) -> tuple[str, ...]:
        """Return the clips of the split in the roles "train" and "test"; none without a split."""
        return tuple(clip for role in roles for clip in SPLITS.get(self.split, {}).get(role, ()))

    def absent(self, motions: Collection[str]) -> str:
        """Return a line on the clips of the split that are not among these motions; empty: all are there."""
        clips = self.clips("test", "train")
        gaps = [clip for clip in clips if clip not in motions]
        title = f"split {self.split}: {len(gaps)} of {len(clips)} clips are absent"
        return f"{title}: {', '.join(gaps)}" if gaps else ""


def _demand_one_of(choices: tuple[str, ...], name: str, value: object) -> None:
    if value not in choices:
        raise ValueError(f"{name}={value}: choose from {', '.join(filter(None, choices))}")


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value)


def split_words(text: str) -> tuple[str, dict[str, Any]]:
    """Split FILE[,key=value...] into the path and its words; a key alone is true.

    >>> split_words("shirt.obj,units=cm,shift=0 0.1 0")
    ('shirt.obj', {'units': 'cm', 'shift': [0.0, 0.1, 0.0]})
    """
    path, *pairs = text.split(",")
    table = dict(map(_word, pairs))
    if len(table) < len(pairs):
        raise ValueError(f"{text}: a word stands there twice: give each once")
    return path.strip(), table


def _word(text: str) -> tuple[str, Any]:
    key, equals, value = (part.strip() for part in text.partition("="))
    name = key.replace("-", "_")
    if not equals:
        return name, True
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return name, value
    return name, (numbers if len(numbers) > 1 else numbers[0]) if numbers else value


def is_garment_file(word: str) -> bool:
    """Return whether an option names a mesh file instead of a template."""
    return Path(split_words(word)[0]).suffix.lower() in MESH_SUFFIXES


def parse_garment_file(text: str) -> GarmentFile:
    """Return the garment file that FILE[,key=value...] means. Raises ValueError."""
    path, options = split_words(text)
    if "shift" in options:
        shift = options["shift"]
        options["shift"] = tuple(shift) if isinstance(shift, list) else (shift,)
    return _make(GarmentFile, options, text, path=path)


def parse_motion_files(text: str) -> tuple[str, MotionFileOptions]:
    """Return the path that PATH[,key=value...] means, and how to read it. Raises ValueError."""
    path, options = split_words(text)
    return path, _make(MotionFileOptions, options, text)


def _make(kind: Any, options: dict[str, Any], text: str, **path: str) -> Any:
    names = [field.name for field in fields(kind) if field.name not in path]
    for name in options:
        if name not in names:
            raise ValueError(f"{text}: no word is called '{name}'; there are {', '.join(names)}")
    options = path | options
    try:
        for name in {"path", "material"} & options.keys():
            if not (place := options[name]) or place is True:
                raise ValueError(f"{name}={place}: give a path")
            options[name] = Path(str(place))
        return kind(**options)
    except ValueError as error:
        raise ValueError(f"{text}: {error}") from None
