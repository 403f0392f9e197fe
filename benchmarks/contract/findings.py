"""What is found wrong, with its remedy; and what a check reads before and after, to see what has changed."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from benchmarks.fingerprint.dependencies import code_of
from benchmarks.fingerprint.digest import digest

if TYPE_CHECKING:
    from benchmarks.scene import BuiltScene


class Broken(Exception):
    """What was called has raised: there is nothing further to look at. The message is the finding."""


@dataclass
class Findings:
    """wrong: what has to be mended, each with its remedy; notes: what should be known. home: of the entry."""

    home: str
    wrong: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def demand(self, fine: bool, otherwise: str) -> bool:
        """Keep what is wrong; gives `fine`."""
        if not fine:
            self.wrong.append(otherwise)
        return fine

    @contextmanager
    def call(self, what: str, remedy: str = "") -> Iterator[None]:
        """Around a call of the user's code. Raises Broken where that raises, with its file and line."""
        try:
            yield
        except Exception as error:
            where = raised_at(error, self.home)
            said = " ".join(f"{type(error).__name__}: {error}".split())
            raise Broken(f"{what} raises {said}{f' ({where})' if where else ''}{remedy}") from None

    def look(self, check: Callable[[Findings], None]) -> None:
        """Do a check, until it has broken."""
        try:
            check(self)
        except Broken as broken:
            self.wrong.append(str(broken))


def raised_at(error: BaseException, home: str) -> str:
    """File and line, of the user's own code, where something was raised; empty where it was elsewhere."""
    code = code_of(home)
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in code]
    return f"{own[-1].filename}: line {own[-1].lineno}" if own else ""


def fingerprints(scene: BuiltScene) -> dict[str, str]:
    """Name -> digest of what a scene holds and nobody may alter."""
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
    """The names of what is not as it was, in one text."""
    now = fingerprints(scene)
    return ", ".join(name for name in before if now.get(name) != before[name])


class Connections:
    """Watches to which hosts this process connects, from now on."""

    def __init__(self) -> None:
        self.hosts: list[str] = []
        sys.addaudithook(self._notice)

    def _notice(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "socket.connect" and isinstance(arguments[1], tuple):
            self.hosts.append(f"{arguments[1][0]}:{arguments[1][1]}")
        elif event == "socket.getaddrinfo":
            self.hosts.append(str(arguments[0]))
