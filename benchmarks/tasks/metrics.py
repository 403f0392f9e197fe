"""Metrics of finished cells, from their files: a new metric needs no new run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..metric import RollOut, SceneRollOuts
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
        from reference_sim.trajectory import replace_frame_fields

        own = {task.cell: task for task in tasks if isinstance(task, MeasureCell)}
        first = next(iter(own.values()))
        group = SceneRollOuts(first.cell.scene, built(first.cell.scene, context), first.gap_samples)
        if first.quasi_static in needed:
            path = context.folder.quasi_static_path(first.cell.scene.name, "simulation")
            group.simulated_quasi_static = _positions(path)
        places = {cell: place for task in own.values() for place, cell in task.compared}
        places |= {cell: task.place for cell, task in own.items()}
        found = {}
        for cell in sorted(places, key=lambda cell: places[cell]):
            outcome = needed.get(("cell", cell.name))
            if outcome is not None and outcome.files:
                found[cell] = _roll_out(group, cell, outcome, own.get(cell), context)
                group.roll_outs.append(found[cell])
        for (cell, task), (metrics, curves) in zip(own.items(), group.measure([found[c] for c in own])):
            frames = found[cell].trajectory.frames
            padded = {
                name: np.pad(curve, (0, frames - len(curve)), constant_values=np.nan)
                for name, curve in curves.items()
            }
            replace_frame_fields(cell.trajectory(context.folder), padded, family="energy/")
            context.tell(task.units)
            yield Outcome(result=metrics)


def _roll_out(
    group: SceneRollOuts, cell: Cell, outcome: Outcome, task: MeasureCell | None, context: Context
) -> RollOut:
    from reference_sim import Trajectory

    folder = context.folder
    quasi_static, counterpart = cell.quasi_static(folder), None
    if task is not None and task.counterpart is not None:
        path = task.counterpart.trajectory(folder)
        counterpart = _positions(path) if path.is_file() else None
    return RollOut(
        group=group, entry=cell.entry, seed=cell.seed, status=outcome.status, suites=cell.suites,
        trajectory=Trajectory.load(cell.trajectory(folder)),
        quasi_static=_positions(quasi_static) if task and len(outcome.files) > 1 else None,
        counterpart=counterpart,
    )  # fmt: skip


def _positions(path) -> np.ndarray:
    from reference_sim import Trajectory

    return Trajectory.load(path).positions
