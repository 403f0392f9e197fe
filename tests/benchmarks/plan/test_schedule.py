"""The tasks of a plan, and what makes two of them different."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks import provenance
from benchmarks.methods import find_method
from benchmarks.methods.own_energies import find_own_reference
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.runner.schedule import tasks_of
from tests.benchmarks.runner.tasks_by_hand import dressed_scene, plan_of

KICK = dressed_scene("kick")
CELLS = tuple(Cell(KICK, find_method(name), 0, ("garments",)) for name in ("simulation", "snug"))


@pytest.fixture
def plan(tmp_path):
    return plan_of(tmp_path, motions=Motions(train=("walk",), test=("kick",)), cells=CELLS)


def inputs_of(plan):
    return {task.id: task.inputs for task in tasks_of(plan)}


def changed(plan, other) -> set[str]:
    """Return the kinds of tasks whose inputs differ."""
    before, after = inputs_of(plan), inputs_of(other)
    assert before.keys() == after.keys()
    return {id[0] for id in before if before[id] != after[id]}


def test_only_what_trains_depends_on_the_accelerator_and_nothing_on_the_cores(plan, monkeypatch):
    facts = {"processor": "a processor", "cores": 2, "python": "3", "accelerator": "a GPU"}
    hardware = {"cpu": facts | {"accelerator": None}, "cuda": facts}
    monkeypatch.setattr(provenance, "hardware", lambda device: hardware[device])
    on_gpu = dataclasses.replace(plan.study, device="cuda")
    assert changed(plan, dataclasses.replace(plan, study=on_gpu)) == {"network"}
    before = inputs_of(plan)
    hardware["cpu"]["cores"] = 7
    assert inputs_of(plan) == before


def test_what_is_measured_in_a_scene_is_no_part_of_its_cells(plan):
    some = dataclasses.replace(KICK, metrics=("energy", "cost", "dynamics"))
    fewer = tuple(dataclasses.replace(cell, scene=some) for cell in CELLS)
    assert changed(plan, dataclasses.replace(plan, cells=fewer)) == {"metrics"}


def test_a_network_is_measured_beside_the_minimum_of_its_own_energies_whatever_its_batch(plan):
    network = find_method("snug-no-gravity")
    cells = [Cell(KICK, e, 0, ("garments",)) for e in (network, find_own_reference(network))]
    tasks = {task.id: task for task in tasks_of(dataclasses.replace(plan, cells=(*CELLS, *cells)))}
    assert cells[1].id() in tasks[cells[0].id("metrics")].reads
