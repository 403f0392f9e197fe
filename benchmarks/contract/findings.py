"""Findings of a check, each with its remedy; digests that tell whether a scene was altered."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from benchmarks.fingerprint.dependencies import code_of
from benchmarks.fingerprint.digest import digest
from benchmarks.process.errors import one_line
from benchmarks.tasks.task import Outcome

if TYPE_CHECKING:
    from benchmarks.scene import BuiltScene


class Broken(Exception):
    """The user's code has raised, so that nothing further can be looked at; the message is the finding."""


@dataclass
class Findings:
    """wrong: what has to be mended, each with its remedy; notes: what should be known. home: of the entry."""

    home: str
    wrong: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def demand(self, fine: bool, otherwise: str) -> bool:
        """Note `otherwise` as wrong unless fine; return `fine`."""
        if not fine:
            self.wrong.append(otherwise)
        return fine

    @contextmanager
    def call(self, what: str, remedy: str = "") -> Iterator[None]:
        """Guard a call of the user's code. Raises Broken where that raises, with its file and line."""
        try:
            yield
        except Exception as error:
            where = raised_at(error, self.home)
            raise Broken(f"{what} raises {one_line(error)}{f' ({where})' if where else ''}{remedy}") from None

    def look(self, check: Callable[[], None]) -> Outcome:
        """Run a check, until the user's code raises; return the findings as the result."""
        try:
            check()
        except Broken as broken:
            self.wrong.append(str(broken))
        return Outcome(result={"wrong": self.wrong, "notes": self.notes})


def raised_at(error: BaseException, home: str) -> str:
    """Return file and line of the user's code where something was raised; empty where it was elsewhere."""
    code = code_of(home)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in code]
    return f"{frames[-1].filename}: line {frames[-1].lineno}" if frames else ""


def fingerprints(scene: BuiltScene) -> dict[str, str]:
    """Return name -> digest of the arrays of a scene, which nobody may alter."""
    import numpy as np

    cloth, worn, obstacle = scene.cloth, scene.dressed, scene.obstacle
    held: dict[str, Any] = {
        "cloth.rest_positions": cloth.rest_positions,
        "cloth.faces": cloth.faces,
        "cloth.masses": cloth.masses,
        "start": scene.start,
        "start_velocity": scene.start_velocity,
        "obstacle.positions": None if obstacle is None else obstacle.positions,
        "origin_heights": scene.origin_heights,
        "exact": scene.exact,
        "dressed.motion.poses": worn and worn.motion.poses,
        "dressed.motion.translations": worn and worn.motion.translations,
        "dressed.garment.rest_positions": worn and worn.garment.rest_positions,
    }
    return {name: digest(np.asarray(value)) for name, value in held.items() if value is not None}


def altered(before: dict[str, str], scene: BuiltScene) -> str:
    """Return the names of the arrays that have changed, in one text."""
    now = fingerprints(scene)
    return ", ".join(name for name in before if now.get(name) != before[name])


class Connections:
    """Hosts to which this process connects from now on."""

    def __init__(self) -> None:
        self.hosts: list[str] = []
        sys.addaudithook(self._notice)

    def _notice(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "socket.connect" and isinstance(arguments[1], tuple):
            self.hosts.append(f"{arguments[1][0]}:{arguments[1][1]}")
        elif event == "socket.getaddrinfo":
            self.hosts.append(str(arguments[0]))
