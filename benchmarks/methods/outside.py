"""Methods from outside: stored roll-outs, and programs with their own environment.

A program reads an exported scene and writes a roll-out. A time that it writes beside it is reported, and
marked as declared.
"""

from __future__ import annotations

import glob
import os
import shlex
import shutil
import subprocess
import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.declarations import DeclarationError
from benchmarks.external.roll_out_files import (
    MODULE,
    PLACE,
    RollOutFileError,
    RollOutOption,
    fit_to_scene,
    read_roll_out,
)
from benchmarks.external.scene_files import facts_of, write_scene_files
from benchmarks.method import Method, MethodEntry, WorkerDied
from benchmarks.provenance import digest
from benchmarks.scene import BuiltScene
from reference_sim.files.array_file import read_arrays
from reference_sim.trajectory import Trajectory


@dataclass
class Stored(Method):
    """Positions of a file, shown to belong to the scene; stated: of a RollOutOption."""

    path: str
    stated: dict[str, Any] = field(default_factory=dict)

    def prepare(self, scene: BuiltScene) -> None:
        """Read the file and compare it with the scene. Raises RollOutFileError."""
        self.scene, stored = scene, read_roll_out(self.path)
        try:
            self.stored = fit_to_scene(stored, scene, **self.stated)
        except RollOutFileError as error:
            raise RollOutFileError(f"{self.path}: {error}") from None

    def run(self) -> Trajectory:
        """Return the roll-out of the file."""
        return self._trajectory(self.stored.positions)

    def quasi_static(self) -> Trajectory | None:
        """Return the quasi-static solutions of the file; None where it has none."""
        solutions = None if self.stated.get("other_mesh") else self.stored.quasi_static
        return None if solutions is None else self._trajectory(solutions)

    def _trajectory(self, positions: np.ndarray) -> Trajectory:
        stored, bad = self.stored, np.argwhere(~np.isfinite(positions).all(axis=-1))
        place = f"frame {bad[0, 0]}, vertex {bad[0, 1]}" if len(bad) else ""
        # Whoever claims nothing is held to nothing where a frame that claims to have converged is judged.
        claims = (
            np.zeros(len(positions)) if stored.converged is None else stored.converged[: len(positions)]
        )
        return Trajectory(
            positions=positions,
            faces=np.asarray(stored.faces if self.stated.get("other_mesh") else self.scene.cloth.faces),
            times=np.arange(len(positions)) * self.scene.dt,
            status="diverged" if place else "ok",
            reason=f"{self.path}: {place}: a position is not finite" if place else "",
            provenance={"method": "stored roll-out", "file": Path(self.path).name},
            frame_fields={"converged": claims},
        )


def make_stored(*, models: Path, seed: int, path: str, digest: str, **stated: Any) -> Stored:
    """Make the roll-out of that file, without seed or model; digest: of its content, for the cache."""
    return Stored(path, stated)


def entry_of(option: RollOutOption, scene: str) -> MethodEntry | None:
    """Return the entry of that scene; None where it has no file. Raises RollOutFileError."""
    path = option.path_for(scene)
    if PLACE in option.path and not Path(path).exists() and not glob.glob(path):
        return None
    stored = read_roll_out(path)
    declared = option.ms is not None
    stated = {name: getattr(option, name) for name in ("units", "up", "fps", "other_mesh")}
    return MethodEntry(
        name=option.name,
        label=option.name,
        description=f"roll-out of {Path(path).name}" + ", time as its author says" * declared,
        module=MODULE,
        options={"path": path, "digest": digest(stored), **stated},
        dtype=stored.dtype,
        gives_first_frame=True,
        timed=False,
        declared_ms=option.ms,
        other_mesh=option.other_mesh,
        static_known=False,
        role=option.role,
    )


TIME_LIMIT = 100.0  # after which it is ended
PLACES = ("{scene}", "{out}")
OWN_ENVIRONMENT = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")  # another environment has its own


def program(
    name: str, command: str, *, seconds: float = TIME_LIMIT, description: str = "", **fields: Any
) -> MethodEntry:
    """Return the entry of a program.

    Args:
        name: of the method.
        command: words as in a shell, which is not used. {scene} becomes the folder of the exported scene,
            {out} the npz file to be written: positions (T,V,3) [m], and what else benchmarks.score reads.
            In it seconds_per_frame, one number, is its declared time. {seed} becomes the seed.
        seconds: after which it is ended.
        description: one line; by default that it is this program.
        fields: of MethodEntry, as label, files and needs_body.

    Raises:
        DeclarationError: the command lacks {scene} or {out}.

    >>> program("mine", "python mine.py {scene} {out}").role
    'external'
    """
    for place in PLACES:
        if place not in command:
            raise DeclarationError(f"program {name}: its command has no {place}: {command}")
    return MethodEntry(**{
        "name": name, "description": description or f"the program {shlex.split(command)[0]}",
        "module": f"{__name__}:make_program",
        "options": {"command": command, "seconds": seconds}, "timed": False,
        "gives_first_frame": True, "static_known": False, "role": "external", **fields,
    })  # fmt: skip


@dataclass
class Program(Stored):
    """Roll-out that a program writes when it is asked for."""

    command: str = ""
    seconds: float = TIME_LIMIT
    seed: int = 0

    def prepare(self, scene: BuiltScene) -> None:
        """Remember the scene: to start the program is work of run(). Raises RuntimeError without it."""
        self.scene = scene
        word = shlex.split(self.command)[0]
        if shutil.which(word) is None:
            raise RuntimeError(f"the program cannot be started: no {word} is here")

    def run(self) -> Trajectory:
        """Return what the program writes, in a folder that is gone afterwards.

        Raises:
            RuntimeError: the program fails.
            WorkerDied: it takes too long.
            RollOutFileError: what it has written does not belong to the scene.
        """
        with tempfile.TemporaryDirectory(prefix="program-") as folder:
            exported, out, output = (Path(folder) / name for name in ("scene", "out.npz", "said.txt"))
            exported.mkdir()
            write_scene_files(exported, self.scene, facts_of(self.scene))
            places = {"{scene}": str(exported), "{out}": str(out), "{seed}": str(self.seed)}
            self._execute(places, output)
            if not out.is_file():
                last_line = _last_line(output)
                raise RuntimeError(f"the program has ended well and has not written {{out}}{last_line}")
            self.path = str(out)
            super().prepare(self.scene)
            declared = read_arrays(out, ("seconds_per_frame",)).get("seconds_per_frame")
        provenance: dict[str, Any] = {"method": "program"}
        if declared is not None:
            if declared.size != 1 or not 0.0 < float(declared.item()) < 1e6:
                raise ValueError("seconds_per_frame of the program is no positive number of seconds")
            provenance["declared_ms"] = 1e3 * float(declared.item())
        return replace(super().run(), provenance=provenance)

    def _execute(self, places: dict[str, str], output: Path) -> None:
        command = shlex.split(self.command)
        for place, path in places.items():
            command = [word.replace(place, path) for word in command]
        environment = {name: value for name, value in os.environ.items() if name not in OWN_ENVIRONMENT}
        with output.open("wb") as stream:
            try:
                status = subprocess.run(
                    command, stdin=subprocess.DEVNULL, stdout=stream, stderr=stream, env=environment,
                    timeout=self.seconds,
                ).returncode  # fmt: skip
            except OSError as error:
                raise RuntimeError(f"the program cannot be started: {error}") from None
            except subprocess.TimeoutExpired:
                reason = f"the program was ended after {self.seconds:g} s{_last_line(output)}"
                raise WorkerDied(reason, "timeout") from None
        if status:
            raise RuntimeError(f"the program has ended with status {status}{_last_line(output)}")


def _last_line(output: Path) -> str:
    """Return its last line, behind a colon; empty where it has said nothing."""
    lines = output.read_text("utf-8", "replace").split("\n")
    last = next((" ".join(line.split()) for line in reversed(lines) if line.strip()), "")
    return f": {last}" if last else ""


def make_program(*, models: Path, seed: int, command: str, seconds: float) -> Program:
    """Make a fresh one; it has no model."""
    return Program("", command=command, seconds=seconds, seed=seed)
