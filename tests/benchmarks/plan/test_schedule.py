"""The tasks of a plan, and what makes two of them different."""

from __future__ import annotations

import dataclasses

from benchmarks import provenance
from benchmarks.methods import find_method
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.plan.plan import Network
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.networks import NetworkTraining
from benchmarks.runner.schedule import Schedule, tasks_of
from tests.benchmarks.runner.tasks_by_hand import dressed_scene
from tests.benchmarks.runner.test_cell_tasks import plan_of

MOTIONS = Motions(train=("walk",), test=("kick",))


def training(plan, name: str = "snug") -> NetworkTraining:
    return Schedule(plan).training(Network(name, 0, "tshirt"))


def test_the_key_of_a_training_is_that_of_all_it_depends_on(tmp_path, monkeypatch):
    plan = plan_of(tmp_path, motions=MOTIONS)
    before = training(plan).key
    assert before and training(plan).key == before
    monkeypatch.setattr("benchmarks.provenance._version", lambda package: "another")
    assert training(plan).key != before


def test_a_cell_that_begins_removes_nothing_that_another_task_of_its_scene_has_made(tmp_path):
    scene, folder = dressed_scene("kick"), RunFolder(tmp_path)
    cells = tuple(Cell(scene, find_method(name), 0, ("garments",)) for name in ("simulation", "snug"))
    schedule = Schedule(plan_of(tmp_path, motions=MOTIONS, cells=cells))
    paths = (folder.start_path, folder.body_path, folder.rest_areas_path, folder.quasi_static_path)
    made = [path(scene.name) for path in paths]
    for path in made:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    for cell in cells:
        removed = {*schedule.cell(cell).files, *schedule.metrics(cell).files}
        assert removed.isdisjoint(map(folder.relative, made))


def test_only_what_trains_depends_on_the_accelerator(tmp_path, monkeypatch):
    facts = {"processor": "a processor", "cores": 2, "python": "3", "accelerator": "a GPU"}
    hardware = {"cpu": facts | {"accelerator": None}, "cuda": facts}
    monkeypatch.setattr(provenance, "hardware", lambda device: hardware[device])
    cell = Cell(dressed_scene("kick"), find_method("snug"), 0, ("garments",))
    plan = dataclasses.replace(plan_of(tmp_path), cells=(cell,), motions=MOTIONS)
    cuda_plan = dataclasses.replace(plan, device="cuda")
    inputs, other = ({task.id: task.inputs for task in tasks_of(p)} for p in (plan, cuda_plan))
    assert inputs.keys() == other.keys()
    assert {id[0] for id in inputs if inputs[id] != other[id]} == {"network"}


def test_nothing_depends_on_how_many_cores_there_are(tmp_path, monkeypatch):
    cell = Cell(dressed_scene("kick"), find_method("snug"), 0, ("garments",))
    plan = dataclasses.replace(plan_of(tmp_path), cells=(cell,), motions=MOTIONS)
    inputs = []
    for cores in (1, 2):
        monkeypatch.setattr(provenance, "usable_cores", lambda cores=cores: cores)
        inputs.append({task.id: task.inputs for task in tasks_of(plan)})
    assert inputs[0] == inputs[1]


def test_what_is_measured_in_a_scene_is_no_part_of_its_cells(tmp_path):
    cell = Cell(dressed_scene("kick"), find_method("simulation"), 0, ("garments",))
    plan = dataclasses.replace(plan_of(tmp_path), cells=(cell,), motions=MOTIONS)
    some = dataclasses.replace(cell.scene, metrics=("energy", "cost", "dynamics"))
    fewer = dataclasses.replace(cell, scene=some)
    inputs, other = (
        {t.kind: t.inputs for t in tasks_of(dataclasses.replace(plan, cells=(c,)))} for c in (cell, fewer)
    )
    assert {kind for kind in inputs if inputs[kind] != other[kind]} == {"metrics"}
