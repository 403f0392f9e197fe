"""Options of a command for a garment from a file: a mesh that somebody made for the body.

Light to import; snug.garments.reading reads it.
"""

from __future__ import annotations

import argparse
import math
import re
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MESH_SUFFIXES = (".obj", ".ply", ".vtk", ".vtp", ".vtu", ".stl", ".off")
OPTION = "--garment-"
REST_SHAPES = ("mesh", "uv")


@dataclass(frozen=True, kw_only=True)
class GarmentFile:
    """A mesh file with all that it does not state itself.

    Attributes:
        path: OBJ, PLY, VTK, VTP, VTU, STL or OFF.
        units: of the file, "m", "cm", "mm" or "in".
        up: vertical axis of the file, "y" or "z".
        shift: (3,) [m], added after conversion.
        rest: shape without strain, "mesh" or "uv".
        uv_scale: metres per unit of the chart, by default the file's unit.
        material: a file of reference_sim.material.Material.
    """

    path: Path
    units: str = "m"
    up: str = "y"
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rest: str = "mesh"
    uv_scale: float | None = None
    material: Path | None = None

    @property
    def name(self) -> str:
        """Name in scenes and of networks."""
        return self.path.stem

    @property
    def weights(self) -> Path:
        """Place of authored skinning weights: array "weights" (V, 24) of <name>.weights.npz."""
        return self.path.with_name(f"{self.name}.weights.npz")

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that it is read from."""
        weights = [self.weights] if self.weights.is_file() else []
        return (self.path, *weights, *([self.material] if self.material else []))


def is_garment_file(word: str) -> bool:
    """Return whether an option names a mesh file instead of a template."""
    return Path(word).suffix.lower() in MESH_SUFFIXES


def add_garment_options(parser: ArgumentParser) -> None:
    """Add the options that say how to take a garment that is a file."""
    add = parser.add_argument_group("a garment that is a file").add_argument
    add(f"{OPTION}units", default="m", choices=("m", "cm", "mm", "in"), help="of the file (default m)")
    add(f"{OPTION}up", default="y", choices=("y", "z"), help="up axis of the file (default y)")
    add(f"{OPTION}shift", default="0,0,0", metavar="DX,DY,DZ",
        help="metres to add then, where the body stood elsewhere; with '=' if DX is below 0")  # fmt: skip
    add(f"{OPTION}rest", default="mesh", choices=REST_SHAPES,
        help="shape without strain: the mesh (default), or its UV chart, the sewing pattern")  # fmt: skip
    add(f"{OPTION}uv-scale", type=float, metavar="M",
        help="metres per unit of the chart (default: the file's unit)")  # fmt: skip
    add(f"{OPTION}material", metavar="FILE",
        help=".toml or .json of young_modulus [Pa], poisson_ratio, thickness [m], density [kg/m^3], "
        "bending_stiffness [J] (default: the cotton of the paper)")  # fmt: skip


def demand_garment_file(options: Namespace) -> None:
    """Raise ValueError for an option of `add_garment_options` where no garment is a file."""
    plain = ArgumentParser()
    add_garment_options(plain)
    for name, default in vars(plain.parse_args([])).items():
        if getattr(options, name) != default:
            raise ValueError(
                f"--{name.replace('_', '-')} is for a garment that is a file: add --garment FILE"
            )


def demand_usable_name(path: Path) -> None:
    """Raise ValueError unless scenes and networks can be named after the file of a garment."""
    if not re.fullmatch(r"\w[\w.+-]*", path.stem):
        raise ValueError(
            f"garment {path}: '{path.stem}' cannot name scenes and networks: give the file a name of letters "
            "and digits"
        )


def make_garment_file(path: str, options: Namespace) -> GarmentFile:
    """Return the file with the options of `add_garment_options`.

    Raises:
        ValueError: an option without sense, or a file whose name cannot name scenes and networks.
    """
    demand_usable_name(Path(path))
    try:
        shift = tuple(float(word) for word in options.garment_shift.split(","))
    except ValueError:
        shift = ()
    if len(shift) != 3 or not all(map(math.isfinite, shift)):
        raise ValueError(f"{OPTION}shift {options.garment_shift!r}: give three numbers [m], as 0,0.1,0")
    if options.garment_uv_scale is not None and options.garment_rest != "uv":
        raise ValueError(f"{OPTION}uv-scale is for a rest shape from UV: add {OPTION}rest uv")
    x, y, z = shift
    return GarmentFile(
        path=Path(path),
        units=options.garment_units,
        up=options.garment_up,
        shift=(x, y, z),
        rest=options.garment_rest,
        uv_scale=options.garment_uv_scale,
        material=Path(options.garment_material) if options.garment_material else None,
    )


@dataclass(frozen=True, kw_only=True)
class MotionFileOptions:
    """Facts that a motion's file does not state, and the treatment of recording errors.

    Attributes:
        up: vertical axis of the file, "y" or "z"; empty: found from the motion.
        fps: frames per second of a file that states none [1/s].
        joint_map: a TOML file, names of our joints = names of a BVH file's.
        repair: interpolate over recording errors instead of refusing them.
    """

    up: str = ""
    fps: float | None = None
    joint_map: Path | None = None
    repair: bool = False


def add_motion_options(add: Callable[..., Any]) -> None:
    """Add the options of every command that reads motions; add: `add_argument` of a parser or group."""
    add("--motion-up", choices=("y", "z"), default="",
        help="vertical axis of motion files (default: the axis along which the body stands)")  # fmt: skip
    add("--motion-fps", type=float, metavar="N", help="frames per second of motion files that state no rate "
        "(.amc: default 120)")  # fmt: skip
    add("--joint-map", metavar="FILE",
        help="TOML file for BVH: a name of our joints = a name of the file's, line by line (default: common "
        "names are known)")  # fmt: skip
    add("--repair", action="store_true",
        help="interpolate over recording errors of motion files: numbers that are not finite, joints that "
        "turn faster than 3600 degrees/s, a root faster than 10 m/s (default: refuse the file)")  # fmt: skip


def parse_motion_options(options: argparse.Namespace) -> MotionFileOptions:
    """Return the parsed options of `add_motion_options`. Raises ValueError for options without a file."""
    joint_map = Path(options.joint_map) if options.joint_map else None
    if joint_map and not joint_map.is_file():
        raise ValueError(f"--joint-map {joint_map}: no such file")
    parsed = MotionFileOptions(
        up=options.motion_up, fps=options.motion_fps, joint_map=joint_map, repair=options.repair
    )
    if parsed != MotionFileOptions() and not options.motions:
        raise ValueError("--motion-up, --motion-fps, --joint-map, --repair: say of which files by --motions")
    return parsed
