"""Method that is a stored roll-out of another program: evaluated as a method, and never timed as one."""

from __future__ import annotations

import glob
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.external.roll_out_files import (
    MODULE,
    FileConventions,
    RollOutFileError,
    RollOutOption,
    first_not_finite,
    read_roll_out,
)
from benchmarks.external.scene_fit import fit_to_scene
from benchmarks.method import Method, MethodEntry
from benchmarks.provenance import digest
from benchmarks.scene import BuiltScene
from reference_sim.trajectory import Trajectory


@dataclass
class Stored(Method):
    """Positions of a file, once they have been shown to belong to the scene."""

    path: str
    stated: FileConventions

    def prepare(self, scene: BuiltScene) -> None:
        """Read the file and compare it with the scene. Raises RollOutFileError."""
        self.scene = scene
        try:
            self.stored, self.done = fit_to_scene(read_roll_out(self.path), scene, self.stated)
        except RollOutFileError as error:
            raise RollOutFileError(
                str(error) if self.path in str(error) else f"{self.path}: {error}"
            ) from None

    def run(self) -> Trajectory:
        """Return the roll-out of the file."""
        return self._trajectory(self.stored.positions)

    def quasi_static(self) -> Trajectory | None:
        """Return the quasi-static solutions of the file; None where it has none."""
        held = None if self.stated.other_mesh else self.stored.quasi_static
        return None if held is None else self._trajectory(held)

    def _trajectory(self, positions: np.ndarray) -> Trajectory:
        stored = self.stored
        changes, place = "; ".join(self.done), first_not_finite(positions)
        where = "frame {}, vertex {}".format(*place) if place else ""
        # Whoever claims nothing is held to nothing where a frame that claims to have converged is judged.
        claims = np.zeros(len(positions)) if stored.converged is None else stored.converged[: len(positions)]
        return Trajectory(
            positions=positions,
            faces=np.asarray(stored.faces if self.stated.other_mesh else self.scene.cloth.faces),
            times=np.arange(len(positions)) * self.scene.dt,
            status="diverged" if where else "ok",
            reason=f"{self.path}: {where}: a position is not finite" if where else changes,
            provenance={"method": "stored roll-out", "file": Path(self.path).name, "changes": changes},
            frame_fields={"converged": claims},
        )


def make(*, models: Path, seed: int, path: str, digest: str, **stated: object) -> Stored:
    """Make the roll-out of that file, without seed or model; digest: of its content, for the cache."""
    return Stored(path, FileConventions(**stated))  # type: ignore[arg-type]


def entry_of(option: RollOutOption, scene: str) -> MethodEntry | None:
    """Return the entry of that scene; None where it has no file. Raises RollOutFileError."""
    path = option.path_for(scene)
    if option.places and not Path(path).exists() and not glob.glob(path):
        return None
    stored = read_roll_out(path)
    declared = option.declared_ms is not None
    return MethodEntry(
        name=option.name,
        label=option.name,
        description=f"roll-out of {Path(path).name}" + ", time as its author says" * declared,
        module=MODULE,
        options={"path": path, "digest": digest(stored), **asdict(option.stated)},
        dtype=stored.dtype,
        gives_first_frame=True,
        conserving=not option.stated.other_mesh,
        timed=False,
        declared_ms=option.declared_ms,
        other_mesh=option.stated.other_mesh,
        static_known=False,
        role=option.role,
    )
