"""Motions made by code at 30 fps: actions on the spot, of tables of key angles; gaits and stops."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from snug.motion.motion import Motion
from snug.motion.posture import LIBRARY_FPS, RATE, SIDED, poses_from_angles, root_path
from snug.motion.walks import GAITS, STOPS

Key = Sequence[float]  # time [s], angle [degrees]


@dataclass(frozen=True)
class Action:
    """An entry of actions.toml, where the columns are explained; repeated `cycles` times.

    Between keys the angle is monotone (PCHIP: continuous slope, no overshoot), before the first and after
    the last it rests.
    """

    kind: str
    seconds: float
    keys: Mapping[str, Sequence[Key]]
    flights: Sequence[Key] = ()
    cycles: int = 1

    @property
    def frames(self) -> int:
        """Number of frames at RATE."""
        return round(self.seconds * self.cycles * RATE)

    def angles(self) -> tuple[dict[str, np.ndarray], list[tuple[float, float]]]:
        """Return angles by name, (T,) [degrees] at RATE, and the flights [s]."""
        within = (np.arange(self.frames) / RATE) % self.seconds
        angles = {}
        for name, keys in self.keys.items():
            at, degrees = np.array(keys, dtype=float).T
            if len(keys) == 1:
                values = np.full(self.frames, degrees[0])
            else:
                values = PchipInterpolator(at, degrees)(np.clip(within, at[0], at[-1]))
            sided = name in SIDED
            for full_name in (f"left_{name}", f"right_{name}") if sided else (name,):
                if not (sided and full_name in self.keys):
                    angles[full_name] = values
        starts = self.seconds * np.arange(self.cycles)
        return angles, [(s + start, s + end) for s in starts for start, end in self.flights]


TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
ACTIONS = {name: Action(**table) for name, table in TABLES.items()}


def make_clip(name: str) -> Motion:
    """Make the library's motion of that name, arms as in its tables. Raises KeyError for an unknown name."""
    if name in STOPS:
        poses, path = STOPS[name].motion()
        return Motion(name, poses, path, LIBRARY_FPS, "stop", "embedded library: stops within a frame")
    if name in ACTIONS:
        action = ACTIONS[name]
        kind, source = action.kind, "embedded library: key angles"
        angles, flights = action.angles()
        poses = poses_from_angles(angles, action.frames)
        path = root_path(poses, flights)
    else:
        kind, source = GAITS[name].kind, "embedded library: normative gait curves"
        poses, path = GAITS[name].motion()
    path[:, [0, 2]] -= path[0, [0, 2]]
    every = round(RATE / LIBRARY_FPS)
    return Motion(name, poses[::every], path[::every], LIBRARY_FPS, kind, source)
