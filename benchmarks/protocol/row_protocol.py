"""Protocol of a row: the number, or `own` where scene, metric or settings are a user's."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from benchmarks.cell import Cell
from benchmarks.external.roll_out_option import MODULE as STORED
from benchmarks.plan.plan import Plan, network_of
from benchmarks.presets import find_preset
from benchmarks.results.protocol import NUMBER, OWN
from benchmarks.scene import Scene
from benchmarks.scenes import all_scenes
from benchmarks.validation.registry import CASES


def protocol_of(cell: Cell, plan: Plan) -> str:
    """Return the protocol of a cell's rows: its number, or OWN where scene or settings are a user's.

    Settings are the preset, the body, the garment with its material, the motion, the reference, and what the
    project's own networks train on.
    """
    scene, inputs = cell.scene, plan.inputs
    given = scene.dressed and (inputs.body or scene.motion in inputs.motions)
    if given or plan.preset != find_preset(plan.preset.name) or not _is_declared(scene, plan.preset.name):
        return OWN
    if any(c.entry.role == "reference" and c.entry.module == STORED for c in plan.cells if c.scene == scene):
        return OWN
    network = network_of(cell)
    return NUMBER if network is None or network.users_training or _trains_as_declared(plan) else OWN


def protocol_of_case(scene: str, metric: str) -> str:
    """Return the protocol of a row that no cell gives: OWN of a case that is not the project's."""
    known = scene in _places() or (scene, metric) in _places()
    return NUMBER if known else OWN


@cache
def _places() -> frozenset[Any]:
    return frozenset({case.name for case in CASES} | {(case.scene, case.metric) for case in CASES})


@cache
def _declared_with(motion: str) -> dict[str, Scene]:
    motions = (motion,) * bool(motion)
    return all_scenes(motions, motions)


def _is_declared(scene: Scene, preset: str) -> bool:
    """Return whether the project declares the scene so; a run may leave out what is measured in it."""
    declared = _declared_with(scene.motion).get(scene.name)
    return declared is not None and replace(declared.at(find_preset(preset)), metrics=scene.metrics) == scene


def _trains_as_declared(plan: Plan) -> bool:
    from snug.motion.library import TRAIN

    return plan.motions.train == TRAIN[: plan.preset.train_motions] and not plan.inputs.motions
