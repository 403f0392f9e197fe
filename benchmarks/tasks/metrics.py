"""Metrics of finished cells, from their files: a new metric needs no new run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..metric import RollOut, SceneRollOuts
from ..metrics import modules, names_of
from .cell import Cell, built
from .task import Context, Outcome, Task, TaskId


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasureCell(Task):
    """What is measured of a cell's trajectory, beside those of the reference and its variants.

    compared: all cells that it may be compared with, in the order in which their roll-outs are measured;
    quasi_static: the simulator's answer to poses held still; counterpart: the same method in another scene.
    """

    kind = "metrics"
    stage = "metrics"
    unit = "cell"
    cell: Cell
    place: int
    compared: tuple[tuple[int, Cell], ...]
    gap_samples: int
    quasi_static: TaskId | None = None
    counterpart: Cell | None = None

    @classmethod
    def run_together(
        cls, tasks: Sequence[Task], context: Context, needed: Mapping[TaskId, Outcome]
    ) -> Iterator[Outcome]:
        """The cells of one scene beside each other: they share search trees, and the energies of references.

        The energies of each frame, and other curves, are added to the trajectory files.
        """
        own = {task.cell: task for task in tasks if isinstance(task, MeasureCell)}
        first, folder = next(iter(own.values())), context.folder
        scene = built(first.cell.scene, context)
        group = SceneRollOuts(scene, gap_samples=first.gap_samples)
        if first.quasi_static in needed:
            group.quasi_static = _positions(folder.quasi_static_path(scene.name, "simulation"))
        places = {cell: place for task in own.values() for place, cell in task.compared}
        places |= {cell: task.place for cell, task in own.items()}
        found = {}
        for cell in sorted(places, key=lambda cell: places[cell]):
            outcome = needed.get(("cell", cell.name))
            if outcome is not None and outcome.files:
                found[cell] = _roll_out(group, cell, outcome, own.get(cell), context)
                group.roll_outs.append(found[cell])
        for cell, task in own.items():
            metrics, curves, (status, reason) = measured(found[cell], cell.scene.metrics)
            _add_curves(cell.trajectory(folder), curves, found[cell].trajectory.frames)
            context.tell(task.units)
            yield Outcome(status, reason, result=metrics)


def measured(
    roll_out: RollOut, chosen: Sequence[str] | None = None
) -> tuple[dict[str, float], dict[str, np.ndarray], tuple[str, str]]:
    """Metrics and curves of a roll-out by all modules that apply, or by those chosen; and status and reason
    where one of them says that it has failed.
    """
    metrics: dict[str, float] = {}
    curves: dict[str, np.ndarray] = {}
    ended = ("ok", "")
    for module in (modules()[name] for name in names_of(chosen) if len(roll_out.positions)):
        suites = getattr(module, "SUITES", roll_out.suites)
        if any(suite in suites for suite in roll_out.suites):
            values = module.measure(roll_out)
            metrics |= values
            curves |= module.series(roll_out) if hasattr(module, "series") else {}
            ended = (module.judge(roll_out, values) if hasattr(module, "judge") else None) or ended
    return metrics, curves, ended


def _add_curves(path: Path, curves: Mapping[str, np.ndarray], frames: int) -> None:
    from reference_sim.trajectory import replace_frame_fields

    padded = {
        name: np.pad(curve, (0, frames - len(curve)), constant_values=np.nan)
        for name, curve in curves.items()
    }
    replace_frame_fields(path, padded, family="energy/")


def _roll_out(
    group: SceneRollOuts, cell: Cell, outcome: Outcome, task: MeasureCell | None, context: Context
) -> RollOut:
    from reference_sim import Trajectory

    folder, counterpart = context.folder, None
    if task is not None and task.counterpart is not None:
        path = task.counterpart.trajectory(folder)
        counterpart = _positions(path) if path.is_file() else None
    return RollOut(
        group, cell.entry, Trajectory.load(cell.trajectory(folder)), seed=cell.seed, status=outcome.status,
        suites=cell.suites,
        quasi_static=_positions(cell.quasi_static(folder)) if len(outcome.files) > 1 else None,
        counterpart=counterpart,
    )  # fmt: skip


def _positions(path: Path) -> np.ndarray:
    from reference_sim import Trajectory

    return Trajectory.load(path).positions
