"""Roll-outs that a run kept, by the names of scene and methods, for commands that show or write them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.results.json_file import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.trajectory.trajectory import Trajectory
from reports.run.read import read_run, read_trajectory
from reports.run.rows import Run


@dataclass(frozen=True)
class Kept:
    """The run, its roll-outs of one scene by method, as many frames as are finite, and the body, if any."""

    run: Run
    cloths: dict[str, Trajectory]
    body: Trajectory | None


def read_kept(folder: RunFolder, scene: str, methods: Sequence[str], seed: int | None = None) -> Kept:
    """seed: of methods that have one; None takes the first that the run has.

    Raises ResultsError for a scene, method or seed that the run did not keep; the message names those it has.
    """
    run = read_run(folder)
    rows = run.frame[run.frame["case"] == ""]
    scenes = list(dict.fromkeys(rows["scene"]))
    _demand(folder, "scene", scene, scenes)
    own = rows[rows["scene"] == scene]
    cloths = {}
    for method in methods:
        _demand(folder, f"method in {scene}", method, run.ordered(own["method"]))
        its = own[own["method"] == method]
        seeds = sorted({int(s) for s in its["seed"]})
        chosen = seeds[0] if seed is None or not its["seeded"].any() else seed
        _demand(folder, f"seed of {method} in {scene}", str(chosen), [str(s) for s in seeds])
        cloths[method] = _read(folder, folder.trajectory_path(scene, method, chosen))
    path = folder.trajectory_path(scene, "body")
    return Kept(run, cloths, _read(folder, path) if path.is_file() else None)


def _read(folder: RunFolder, path: Path) -> Trajectory:
    problems: list[str] = []
    found = read_trajectory(folder, path, problems)
    if found is None:
        raise ResultsError(problems[0] if problems else f"{path}: this run kept no such roll-out")
    if not (found := found.finite()).frames:
        raise ResultsError(f"{path}: its first frame is not finite")
    return found


def _demand(folder: RunFolder, what: str, name: str, known: Iterable[str]) -> None:
    if name not in (names := list(known)):
        raise ResultsError(f"{folder.path}: no {what} is called '{name}'; there are {', '.join(names)}")
