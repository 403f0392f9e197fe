"""The plan of one scene with the simulation alone: for benchmarks.export and benchmarks.check."""

from __future__ import annotations

import argparse
from dataclasses import replace

from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import scene_fields, split
from benchmarks.plan.plan import Plan
from benchmarks.plan.request import Request


def plan_scene(name: str, options: argparse.Namespace) -> Plan:
    """Return the plan of one scene and its simulation alone.

    Args:
        name: of the scene, as in benchmarks.run --list.
        options: those of `add_scene_options`.

    Raises:
        ValueError: one line for the first thing that cannot be met.
    """
    # Nobody simulates scenes for networks alone: the networks are there to find them, and taken out again.
    methods = ("simulation", "untrained", "snug")
    fields = scene_fields(options)
    plan = make_plan(Request(scenes=split([name]), methods=methods, one_scene=True, **fields))
    first = plan.cells[0]
    return replace(plan, cells=(replace(first, entry=replace(first.entry, trained=None)),))
