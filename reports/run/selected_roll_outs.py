"""Stored roll-outs selected by the names of scene and methods, for commands that film or export them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.trajectory import Trajectory
from reports.run.finished_run import Run
from reports.run.reading import read_run


@dataclass(frozen=True)
class SelectedRollOuts:
    """Roll-outs of one scene by method, as many frames as are finite, and the body where there is one."""

    run: Run
    cloths: dict[str, Trajectory]
    body: Trajectory | None

    @property
    def longest(self) -> Trajectory:
        """The roll-out with the most frames; its dt is nan where it has one."""
        return max(self.cloths.values(), key=lambda cloth: cloth.frames)


def select_roll_outs(
    folder: RunFolder, scene: str, methods: Sequence[str], seed: int | None = None
) -> SelectedRollOuts:
    """Read the methods' roll-outs of a scene.

    Args:
        folder: of the run.
        scene: as results.csv names it.
        methods: as results.csv names them.
        seed: of methods that have one; None takes the first that the run has.

    Raises:
        ResultsError: for a scene, method or seed that the run did not keep; the message names those it has.
    """
    run = read_run(folder)
    rows = run.frame[run.frame["case"] == ""]
    _demand_known(folder, "scene", scene, dict.fromkeys(rows["scene"]))
    of_scene = rows[rows["scene"] == scene]
    cloths = {}
    for method in methods:
        _demand_known(folder, f"method in {scene}", method, run.ordered(of_scene["method"]))
        of_method = of_scene[of_scene["method"] == method]
        seeds = sorted({int(s) for s in of_method["seed"]})
        chosen = seeds[0] if seed is None or not of_method["seeded"].any() else seed
        _demand_known(folder, f"seed of {method} in {scene}", str(chosen), map(str, seeds))
        path = folder.trajectory_path(scene, method, chosen)
        cloths[method] = _finite(run, run.roll_outs.cloth(scene, method, chosen), str(path))
    body_path = folder.trajectory_path(scene, "body")
    body = _finite(run, run.roll_outs.body(scene), str(body_path)) if body_path.is_file() else None
    return SelectedRollOuts(run, cloths, body)


def _finite(run: Run, trajectory: Trajectory | None, path: str) -> Trajectory:
    """Return the frames that are finite. Raises ResultsError where there are none."""
    if trajectory is None:
        raise ResultsError(run.problems[-1] if run.problems else f"{path}: this run kept no such roll-out")
    if not (trajectory := trajectory.finite()).frames:
        raise ResultsError(f"{path}: its first frame is not finite")
    return trajectory


def _demand_known(folder: RunFolder, kind: str, name: str, known: Iterable[str]) -> None:
    names = list(known)
    if name not in names:
        raise ResultsError(f"{folder.path}: no {kind} is called '{name}'; there are {', '.join(names)}")
