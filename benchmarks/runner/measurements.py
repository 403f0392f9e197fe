"""Metrics of finished cells, from their files: a new metric runs no cell again."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.metric import Estimate, RollOut, SceneRollOuts, measurements_in
from benchmarks.metrics import MEASUREMENTS, find_metric, pick_measured
from benchmarks.plan.cell import Cell, id_of
from benchmarks.results.protocol import noise
from benchmarks.results.row import STATUSES, USABLE
from benchmarks.results.run_folder import SECONDS
from benchmarks.runner.cells import build_scene
from benchmarks.runner.task import Context, Needed, Outcome, one_line
from reference_sim.files.atomic_files import replacing

VERDICTS = tuple(status for status in STATUSES if status not in ("ok", "skipped"))  # of judge()


def measure_cell(
    cell: Cell, cells: tuple[Cell, ...], gap_samples: int, outside: tuple[str, ...], context: Context,
    outcomes: Needed,
) -> Outcome:  # fmt: skip
    """Measure the trajectory, and write energies of frames and other curves beside it.

    Args:
        cell: what is measured.
        cells: all of the scene, in the order of their roll-outs.
        gap_samples: frames in which the energy gap is measured.
        outside: files of metrics not the project's, measured in every scene.
        context: roll-outs of a batch share search trees, and energies of references.
        outcomes: of cells, the quasi-static solution, and the method in another scene.
    """
    if "roll-outs" not in context.memo:
        context.memo["roll-outs"] = roll_outs_of(cells, gap_samples, context, outcomes)
    roll_out, folder = context.memo["roll-outs"][cell], context.folder
    if cell.scene.counterpart:
        other = replace(cell, scene=replace(cell.scene, name=cell.scene.counterpart))
        if outcomes.get(other.id(), Outcome("skipped")).status in USABLE:
            roll_out.counterpart = _positions(folder.trajectory_path(*other.key))
    metrics, curves, (status, reason) = measure_roll_out(roll_out, cell.scene.metrics, outside)
    path = folder.curves_path(*cell.key)
    if curves:
        curves[SECONDS] = np.array(roll_out.trajectory.times[: len(roll_out.positions)], dtype=float)
        curves[SECONDS][: roll_out.scene.warm_up] = np.nan
    frames = roll_out.trajectory.frames
    padded: dict[str, Any] = {  # nan after the last frame that was measured
        name: np.pad(x, [(0, frames - len(x))] + [(0, 0)] * (x.ndim - 1), constant_values=np.nan)
        for name, x in curves.items()
    }
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **padded)
    return Outcome(status, reason, result=metrics, files=(folder.relative(path),))


def roll_outs_of(
    cells: tuple[Cell, ...], gap_samples: int, context: Context, outcomes: Needed
) -> dict[Cell, RollOut]:
    """Return the roll-outs of a scene's cells."""
    from reference_sim import Trajectory

    folder, scene = context.folder, cells[0].scene
    group = SceneRollOuts(build_scene(scene, context), gap_samples=gap_samples)
    if id_of("quasi-static", scene) in outcomes:
        group.quasi_static = _positions(folder.quasi_static_path(scene.name))
    roll_outs = {}
    for cell in cells:
        outcome = outcomes.get(cell.id())
        if outcome is not None and outcome.files:
            roll_outs[cell] = RollOut(
                group, cell.entry, Trajectory.load(folder.trajectory_path(*cell.key)),
                status=outcome.status, suites=cell.suites,
                quasi_static=_positions(folder.path / outcome.files[1]) if outcome.files[1:] else None,
            )  # fmt: skip
            if not cell.entry.other_mesh:  # others are measured together, vertex by vertex
                group.roll_outs.append(roll_outs[cell])
    return roll_outs


def measure_roll_out(
    roll_out: RollOut, chosen: Sequence[str] | None = None, outside: tuple[str, ...] = ()
) -> tuple[dict[str, float | Estimate], dict[str, np.ndarray], tuple[str, str]]:
    """Return metrics, curves, and status and reason of the first metric that says it failed.

    Without a frame after the warm-up all are empty. chosen: measurements, None for all; outside: files.
    """
    metrics: dict[str, float | Estimate] = {}
    curves: dict[str, np.ndarray] = {}
    ended = ("ok", "")
    has_frames = len(roll_out.positions) > roll_out.scene.warm_up
    if roll_out.entry.other_mesh:
        entries = [entry for entry in MEASUREMENTS if entry.other_meshes]
    else:
        entries = [*pick_measured(chosen), *map(measurements_in, outside)]
    for entry in entries if has_frames else ():
        suites = entry.suites or roll_out.suites
        if not any(suite in suites for suite in roll_out.suites):
            continue
        try:
            values = dict(entry.measure(roll_out)) if entry.measure else {}
            if entry.compare:
                values |= compare_family(roll_out, entry.compare)
            names = {metric.name for metric in entry.metrics}
            if alien := [n for n in values if not {n, f"{n.rpartition('/')[0]}/*"} & names]:
                raise KeyError(f"{alien[0]} is not among its METRICS: declare it there")
            metrics |= {find_metric(name, outside).name: number(name, v) for name, v in values.items()}
            curves |= entry.series(roll_out) if entry.series else {}
            verdict = entry.judge(roll_out, values) if entry.judge else None
            if verdict and not (verdict[0] in VERDICTS and any(verdict[1:])):
                raise ValueError(f"judge() gives {verdict!r}: expected None, or a status and a reason")
            ended = verdict if verdict and not ended[1] else ended
        except MemoryError:
            raise
        except Exception as error:
            raise RuntimeError(f"{entry.name}: {one_line(error)}") from error
    return metrics, curves, ended


def number(metric: str, value: Any) -> float | Estimate:
    """Return the value as a number that JSON can keep. Raises TypeError."""
    if isinstance(value, Estimate):
        return Estimate(float(value.value), float(value.uncertainty), value.moved)
    if not isinstance(value, numbers.Real):
        raise TypeError(f"{metric} is {value!r:.60}: give a number or an Estimate, or leave it out")
    return float(value)


def compare_family(
    roll_out: RollOut, compare: Callable[[RollOut, RollOut], dict[str, float]]
) -> dict[str, float | Estimate]:
    """Return the numbers against the reference, and their change against its family."""
    if roll_out.reference is None:
        return {}
    values = compare(roll_out, roll_out.reference)
    twins = [other for other in roll_out.group.family if other is not roll_out]
    others = {other.entry.name: compare(roll_out, other) for other in twins}
    estimates: dict[str, float | Estimate] = {}
    for name, value in values.items():
        moved = {twin: row[name] - value for twin, row in others.items() if name in row}
        spread = noise(moved)
        uncertainty = math.nan if spread is None else spread
        estimates[name] = Estimate(value, uncertainty, tuple(moved.items())) if moved else value
    return estimates


def _positions(path: Path) -> np.ndarray:
    from reference_sim import Trajectory

    return Trajectory.load(path).positions
