"""Cells of stored roll-outs: each meets the scenes of a run for which it has a file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.cell import Cell
from benchmarks.methods.catalogue.all_methods import METHODS
from benchmarks.plan.plan import PlanError

if TYPE_CHECKING:
    from benchmarks.external.roll_out_option import RollOutOption


def roll_out_cells(roll_outs: Sequence[RollOutOption], cells: Sequence[Cell]) -> list[Cell]:
    """Return the cells of stored roll-outs in the scenes of these cells, and in their suites.

    Raises:
        PlanError: a name that a method has, or a file of one scene where several are asked for.
        RollOutFileError: a file that cannot be read.
    """
    if not roll_outs:
        return []
    from benchmarks.methods.outside.stored_roll_out import entry_of  # loads numpy

    scenes = {cell.scene.name: cell.scene for cell in cells if not cell.scene.networks_only}
    suites: dict[str, tuple[str, ...]] = {}
    for cell in cells:
        suites[cell.scene.name] = tuple(dict.fromkeys((*suites.get(cell.scene.name, ()), *cell.suites)))
    taken = {entry.name for entry in METHODS} | {cell.method for cell in cells}
    stored: list[Cell] = []
    for option in roll_outs:
        if option.name in taken:
            raise PlanError(
                f"{option.path}: a method is called {option.name}: give another name, by --rollout NAME=FILE "
                "or by --name of benchmarks.score"
            )
        taken.add(option.name)
        if len(scenes) != 1 and not option.places:
            raise PlanError(
                f"--rollout {option.name}={option.path}: is of one scene, and {len(scenes)} are asked for: "
                "name it with --scenes, or put {scene} into the path"
            )
        entries = {name: entry for name in scenes if (entry := entry_of(option, name))}
        if not entries:
            raise PlanError(f"--rollout {option.name}={option.path}: no file for {', '.join(scenes)}")
        stored += [Cell(scenes[name], entry, 0, suites[name]) for name, entry in entries.items()]
    return stored
