"""A plan of a single scene, for commands that take the options of a scene and no others of benchmarks.run."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import add_scene_options, make_parser
from benchmarks.plan.plan import Plan, PlanError


def plan_of_scene(
    options: argparse.Namespace, scene: str, methods: Sequence[str], *, out: str | None = None
) -> Plan:
    """These methods in that scene. options: those of `add_scene_options`. Raises ValueError, one line."""
    of_run = make_parser().parse_args([])
    vars(of_run).update({name: getattr(options, name) for name in _defaults()})
    of_run.scenes, of_run.methods, of_run.out = [scene], list(methods), out
    plan = make_plan(of_run, [])
    if len(plan.scenes) != 1:
        raise PlanError(f"{scene}: name one scene; see python -m benchmarks.run --list")
    return replace(plan, cases=(), microbenchmarks=())  # some have the name of a scene


def words_of_scene(options: argparse.Namespace) -> list[str]:
    """The options of `add_scene_options` that were given, as words of a command; the preset always."""
    words = ["--preset", options.preset]
    for name, default in _defaults().items():
        value, option = getattr(options, name), f"--{name.replace('_', '-')}"
        if value == default or name == "preset":
            continue
        if value is True:
            words.append(option)
        for each in value if isinstance(value, list) else [] if value is True else [value]:
            words += [option, str(each)]
    return words


def _defaults() -> dict[str, object]:
    plain = argparse.ArgumentParser()
    add_scene_options(plain)
    return vars(plain.parse_args([]))
