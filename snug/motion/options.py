"""Options of a command about files of motions. Nothing heavy is imported here: --help answers at once."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


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
