"""GAUGE's textile experiments (Wang et al. 2026), from a folder that the user has downloaded.

    FOLDER/metadata/textile/<task>.json                      fabrics, markers and their mesh
    FOLDER/data/textile/<task>/json/<fabric>/<trial>.json    positions of the markers over time

A metadata file gives each fabric's mass per area [kg/m^2] and bending stiffness, taken as [N m] because no
unit is stated. A trial is {"FPS": 30, "translation unit": "mm", <object>: {<marker>: {"x": [...], "y": ...,
"z": ...}}}, as that data set's foam trials are; the object is known by its markers, not by its name, and
markers by where they begin. docs/notebook/fabric.md says which of this has been seen. MIT licence; none of
its files is part of this project.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fabrics.fabric import Fabric, plain_name
from benchmarks.fabrics.markers import FULL_ANGLES, Markers
from benchmarks.fabrics.measured import RANGES
from benchmarks.fingerprint.digest import digest, digest_of_file

TASKS = ("stretching", "bending")  # "textile stretching", "textile bending"
UNITS = {"mm": 1e-3, "m": 1.0}


class GaugeFileError(ValueError):
    """Folder or file of GAUGE that cannot be used; the message names file, place and remedy."""


@dataclass(frozen=True, eq=False)
class Task:
    """An experiment.

    Attributes:
        name: one of TASKS.
        rate: frames a second.
        fabrics: those it is done with.
        markers: on the sheet.
    """

    name: str
    rate: float
    fabrics: tuple[Fabric, ...]
    markers: Markers


def read_tasks(folder: Path) -> tuple[Task, ...]:
    """Read the metadata of a folder: the tasks of TASKS that it has.

    Raises:
        GaugeFileError: no such folder, no task, or a file that is not understood.
    """
    paths = {name: folder / "metadata" / "textile" / f"textile {name}.json" for name in TASKS}
    tasks = tuple(_task(name, path) for name, path in paths.items() if path.is_file())
    if not tasks:
        raise GaugeFileError(
            f"--gauge {folder}: no file '{paths['bending'].relative_to(folder)}': give the folder that "
            "GAUGE-Dataset was downloaded to"
        )
    return tasks


def _task(name: str, path: Path) -> Task:
    """Read a task's metadata. Raises GaugeFileError."""
    content = _content(path)
    try:
        materials = content["assets"]["textile"]["material"]
        rate = float(content["tasks"]["default"]["record"]["fps"])
        described = content["markers"]
        rest = np.array(described["translation"], dtype=float).reshape(-1, 3)
        full = np.zeros(len(rest))
        for place, angle in FULL_ANGLES.items():
            full[described.get(place, [])] = angle
        markers = Markers(rest, _angles(described), full)
        if not (full > 0).all() or markers.angles.max() >= len(rest) or markers.angles.min() < 0:
            raise ValueError("a marker is neither inner, edge nor corner, or the mesh names one more")
        fabrics = tuple(_fabric(path, key, material) for key, material in materials.items())
    except (KeyError, TypeError, IndexError, AttributeError, ValueError) as error:
        if isinstance(error, GaugeFileError):
            raise
        raise GaugeFileError(
            f"--gauge {path}: not the metadata of a textile task ({type(error).__name__}: {error}): "
            "download it again"
        ) from None
    return Task(name, rate, fabrics, markers)


def _angles(described: dict[str, Any]) -> np.ndarray:
    """Return the angles (K, 3) of a mesh of faces, or of lines: there one where two lines meet."""
    if "faces" in described:
        faces = np.array(described["faces"], dtype=int).reshape(-1, 3)
        return np.concatenate([np.roll(faces, -turn, axis=1) for turn in range(3)])
    neighbours: dict[int, list[int]] = {}
    for one, other in described["lines"]:
        neighbours.setdefault(one, []).append(other)
        neighbours.setdefault(other, []).append(one)
    return np.array([(at, *ends) for at, ends in sorted(neighbours.items()) if len(ends) == 2], dtype=int)


def _fabric(path: Path, key: str, material: dict[str, Any]) -> Fabric:
    """Return a fabric of the metadata. Raises GaugeFileError."""
    density, stiffness = float(material["density"]), float(material["bend stiffness"])
    for field, value, title in (("density", density, "density"), ("warp", stiffness, "bend stiffness")):
        low, high = RANGES[field]
        if not low <= value <= high:
            raise GaugeFileError(
                f"--gauge {path}: {key}: {title} {value:g} is outside {low:g} to {high:g} in SI units: "
                "check its unit"
            )
    return Fabric(plain_name(key), density, stiffness, stiffness)


def trial_files(folder: Path, task: str, fabric: str) -> tuple[Path, ...]:
    """Return the trials of a task with a fabric in the order of their numbers; none without a folder."""
    files = (folder / "data" / "textile" / f"textile {task}" / "json" / fabric).glob("*.json")
    return tuple(sorted(files, key=lambda path: (len(path.stem), path.stem)))


def version(folder: Path, task: str, fabric: str) -> str:
    """Return a digest of all files that the trials of a task with a fabric are read from. Raises OSError."""
    metadata = folder / "metadata" / "textile" / f"textile {task}.json"
    files = (metadata, *trial_files(folder, task, fabric))
    return digest({str(path.relative_to(folder)): digest_of_file(path) for path in files})


def read_trial(path: Path, task: Task) -> np.ndarray:
    """Read a trial: positions (T, M, 3) [m] of the markers in the order of the metadata.

    Raises:
        GaugeFileError: not such a file, other markers than the task's, or a marker that was lost.
    """
    content = _content(path)
    rest = task.markers.rest
    if content.get("FPS") != task.rate or content.get("translation unit") not in UNITS:
        raise GaugeFileError(
            f"--gauge {path}: expected 'FPS' {task.rate:g} and a 'translation unit' of {' or '.join(UNITS)}"
        )
    clouds = [value for value in content.values() if _is_cloud(value, len(rest))]
    if len(clouds) != 1:
        raise GaugeFileError(
            f"--gauge {path}: {len(clouds)} objects of {len(rest)} markers with x, y and z: expected one"
        )
    try:
        paths = [[marker[axis] for axis in "xyz"] for marker in clouds[0].values()]
        x = np.moveaxis(np.array(paths, dtype=float), -1, 0) * UNITS[content["translation unit"]]
    except (TypeError, ValueError):
        raise GaugeFileError(f"--gauge {path}: a marker has gaps or another length: leave it out") from None
    if x.ndim != 3 or not len(x) or not np.isfinite(x).all():
        raise GaugeFileError(f"--gauge {path}: a marker has no position in some frame: leave the trial out")
    return x[:, _order(path, x[0], rest)]


def _is_cloud(value: Any, count: int) -> bool:
    """Return whether a value of a trial is an object of so many markers."""
    return (
        isinstance(value, dict)
        and len(value) == count
        and all(isinstance(marker, dict) and set("xyz") <= set(marker) for marker in value.values())
    )


def _order(path: Path, start: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return which marker of a trial, at start (M, 3), is which of the metadata. Raises GaugeFileError."""
    from scipy.optimize import linear_sum_assignment

    apart = np.linalg.norm(rest[:, None] - rest[None], axis=-1)
    most = apart[apart > 0].min() / 2  # beyond half the spacing two markers could be taken for each other
    distance = np.linalg.norm(rest[:, None] - start[None], axis=-1)
    ours, theirs = linear_sum_assignment(distance)
    if (far := distance[ours, theirs].max()) > most:
        raise GaugeFileError(
            f"--gauge {path}: a marker begins {1e3 * far:.0f} mm from its place in the metadata, more than "
            f"{1e3 * most:.0f}: which is which cannot be told"
        )
    return theirs


def _content(path: Path) -> dict[str, Any]:
    """Read a JSON object. Raises GaugeFileError."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise GaugeFileError(f"--gauge {path}: cannot be read ({error}): download it again") from None
    if not isinstance(content, dict):
        raise GaugeFileError(f"--gauge {path}: holds no JSON object: download it again")
    return content
