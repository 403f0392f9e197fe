"""The plan of benchmarks.score: a roll-out from outside is a method of a run, beside the simulation."""

from __future__ import annotations

import argparse
import re
from dataclasses import replace
from pathlib import Path

from benchmarks.cell import Cell
from benchmarks.external.roll_out_option import (
    CHARACTERS,
    PLACE,
    FileConventions,
    RollOutFileError,
    RollOutOption,
)
from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import scene_fields, split
from benchmarks.plan.plan import Plan
from benchmarks.plan.request import Request

SOLVED_AGAIN = "speed"  # the suite in which steps are solved again: gaps and one-step errors
NO_REFERENCE = (
    "left out by --no-reference: curvature error and histogram, distances, dynamics, relative energy gap"
)


def plan_roll_out(options: argparse.Namespace, command: str) -> Plan:
    """Return the plan of a roll-out and of the simulation in one scene.

    Args:
        options: of benchmarks.score.
        command: the command line, for run.json.

    Raises:
        ValueError: one line for the first thing that cannot be met.
    """
    stated = FileConventions(
        options.units, options.up, options.fps, options.match_vertices, options.other_mesh
    )
    stem = Path(options.roll_out.rstrip("/").replace(PLACE, "")).stem
    name = options.name or re.sub(rf"[^{CHARACTERS}]+", "-", stem).strip("_-+.") or "roll-out"
    option = RollOutOption(name, options.roll_out, stated, options.declared_ms)
    fields, scenes = scene_fields(options), split([options.scene or ""])
    if options.rest_mesh and options.other_mesh:
        raise RollOutFileError("--other-mesh compares with a scene: give --scene, not --rest-mesh")
    if options.rest_mesh:
        from benchmarks.scenes.from_roll_out import declared  # loads the simulator

        scene = declared(option, options.rest_mesh)
        scenes, fields = (scene.name,), fields | {"further_scenes": (scene,), "suites": (SOLVED_AGAIN,)}
        # The rate that the user has stated of the file is now that of the scene.
        option = replace(option, stated=replace(stated, fps=None))
    request = Request(
        command=command,
        scenes=scenes,
        methods=("simulation", "skinning"),  # relative excess is the share of skinning's
        one_scene=True,
        roll_outs=(option,),
        folder=Path(options.out) if options.out else None,
        **fields,
    )
    plan = make_plan(request)
    cells = tuple(_reference(cell, options) for cell in plan.cells)
    if options.no_report:  # nobody looks at times and gaps of what the roll-out is compared with
        cells = tuple(replace(cell, entry=replace(cell.entry, timed=False)) for cell in cells)
    looked_at = {name} if options.no_report else {cell.method for cell in cells}
    cells = tuple(_solved_again(cell) if cell.method in looked_at else cell for cell in cells)
    return replace(plan, cells=cells, suites=tuple(dict.fromkeys((*plan.suites, SOLVED_AGAIN))))


def _reference(cell: Cell, options: argparse.Namespace) -> Cell:
    """Return the simulation's cell, or the one that takes its place; others as they are."""
    if cell.entry.role != "reference":
        return cell
    if options.no_reference:
        return replace(cell, entry=replace(cell.entry, left_out=NO_REFERENCE))
    if options.reference is None:
        return cell
    from benchmarks.methods.outside.stored_roll_out import entry_of  # loads numpy

    stored = RollOutOption("reference", options.reference, FileConventions(), role="reference")
    entry = entry_of(stored, cell.scene.name)
    if entry is None:
        raise RollOutFileError(f"--reference {stored.path_for(cell.scene.name)}: no such file")
    return replace(cell, entry=replace(entry, label="Reference, from a file"))


def _solved_again(cell: Cell) -> Cell:
    """Return the cell in the suite, too, in which steps are solved again."""
    return replace(cell, suites=tuple(dict.fromkeys((*cell.suites, SOLVED_AGAIN))))
