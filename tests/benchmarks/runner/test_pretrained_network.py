"""Networks from files in the place of trainings: which are taken, which refused, and what rows say."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest
import torch

from benchmarks.methods import find_method
from benchmarks.plan.cell import Cell
from benchmarks.plan.make_plan import check_machines
from benchmarks.plan.motions import Motions
from benchmarks.plan.options import make_parser, study_of
from benchmarks.plan.plan import Network, Plan
from benchmarks.plan.study import Study, StudyError
from benchmarks.results.row import BEFORE_FRAMES
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.execute_plan import remarks
from benchmarks.runner.networks import (
    NetworkTraining,
    pretrained_network,
    put_into_package,
    take,
    train,
    without_machine,
)
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import described
from benchmarks.runner.schedule import TRAINING, Schedule, tasks_of
from benchmarks.runner.task import Outcome
from benchmarks.training import Training
from snug import trained
from snug.named_recipes import PBNS
from snug.networks.trained_model import TrainedModel
from tests.benchmarks.runner.tasks_by_hand import assets_of, context, dressed_scene
from tests.benchmarks.runner.test_cell_tasks import TINY, plan_of
from tests.snug.training.dressing import swaying, tube_dress

WALK = dataclasses.replace(swaying(16), name="walk")
FEW = dataclasses.replace(TINY, steps={"snug": 2, "pbns": 2})
RAN = Outcome(result={"seconds": 1.0, "frames": 4, "peak": 70.0, "terms": "strain"}, files=("x",))


def plan_with(folder: Path, *methods: str, **changes) -> Plan:
    """A plan of these methods in a scene of the T-shirt."""
    cells = tuple(Cell(dressed_scene("kick", preset=FEW), find_method(m), 0, ("garments",)) for m in methods)
    motions = Motions(train=("walk",), test=("kick",))
    return plan_of(folder, **{"cells": cells, "motions": motions, "preset": FEW} | changes)


def training_of(plan: Plan, name: str = "pbns", seed: int = 0) -> NetworkTraining:
    return Schedule(plan).training(Network(name, seed, "tshirt"))


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, Outcome]:
    """The folder of a run that trained PBNS, and what the training left."""
    folder = tmp_path_factory.mktemp("made")
    task = training_of(plan_with(folder, "pbns"))
    return folder, train(task, context(folder, assets_of(tube_dress(), WALK)), {})


def weights(path: Path) -> dict[str, torch.Tensor]:
    return TrainedModel.load(path).network.state_dict()


def test_a_file_takes_the_place_of_the_training_that_made_it(made, tmp_path):
    folder, outcome = made
    task = training_of(plan_with(tmp_path, "pbns"))
    taken = pretrained_network(task, folder)
    assert not taken.refusal and taken.differing == ()
    done = take(taken, context(tmp_path), {})
    tensors, other = (weights(task.path(RunFolder(place))) for place in (folder, tmp_path))
    assert all(torch.equal(tensors[name], other[name]) for name in tensors | other)
    assert done.result == outcome.result | {
        "pretrained": "pbns-seed0", "trained_at": done.result["trained_at"], "differing": [],
        "data_seconds": 0,
    }  # fmt: skip
    assert done.origin["hardware"]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"preset": dataclasses.replace(FEW, steps={"pbns": 3})}, "steps"),
        ({"preset": dataclasses.replace(FEW, garment_vertices=99)}, "assets"),
        ({"motions": Motions(train=("walk", "kick"))}, "motions"),
    ],
)
def test_a_network_of_another_training_is_refused_and_says_in_what(made, tmp_path, changes, named):
    taken = pretrained_network(training_of(plan_with(tmp_path, "pbns", **changes)), made[0])
    assert f"pbns-seed0.safetensors: a network of another training ({named})" in taken.refusal
    assert not taken.refusal.count("\n")


def test_how_long_tests_are_does_not_matter_to_a_training(made, tmp_path):
    shorter = dataclasses.replace(FEW, frames=5, test_motions=3)
    taken = pretrained_network(training_of(plan_with(tmp_path, "pbns", preset=shorter)), made[0])
    assert taken.refusal == "" and taken.differing == ()


@pytest.mark.parametrize("part", [*TRAINING, "package torch", "machine"])
def test_other_code_packages_and_processors_are_said(made, tmp_path, part):
    task = training_of(plan_with(tmp_path, "pbns"))
    field = "inputs" if part in task.inputs else "software"
    parts = getattr(task, field)
    assert part in parts
    changed = dataclasses.replace(task, **{field: {**parts, part: "another"}})
    taken = pretrained_network(changed, made[0])
    assert taken.refusal == "" and taken.differing == (part,)


def test_what_is_no_network_of_ours_is_refused_in_one_line(made, tmp_path):
    task = training_of(plan_with(tmp_path, "pbns"))
    assert (
        "no pretrained network pbns-tshirt: benchmarks.run -o DIR"
        in pretrained_network(task, tmp_path).refusal
    )
    path = tmp_path / "pbns-tshirt.safetensors"
    path.write_bytes(b"half")
    assert "pbns-tshirt.safetensors: not a safetensors file" in pretrained_network(task, tmp_path).refusal
    dataclasses.replace(TrainedModel.load(task.path(RunFolder(made[0]))), origin={}).save(path)
    assert "says nothing of its training" in pretrained_network(task, tmp_path).refusal


def test_a_run_from_files_simulates_and_trains_nothing_but_a_users_own(made, tmp_path):
    entry = dataclasses.replace(
        find_method("pbns"), name="mine", trained="mine", training=Training("pbns", PBNS), declared_in=""
    )
    plan = plan_with(tmp_path, "pbns", "supervised", "untrained", trained=made[0])
    cell = dataclasses.replace(plan.cells[0], entry=entry)
    tasks = tasks_of(dataclasses.replace(plan, cells=(*plan.cells, cell)))
    kinds = {task.name: task.stage for task in tasks if task.kind == "network"}
    assert kinds == {
        "tshirt/pbns-seed0": "pretrained networks", "tshirt/supervised-seed0": "pretrained networks",
        "tshirt/untrained-seed0": "training", "tshirt/mine-seed0": "training",
    }  # fmt: skip
    assert "data" not in {task.kind for task in tasks}
    assert "data" in {task.kind for task in tasks_of(dataclasses.replace(plan, trained=None))}


def test_every_row_of_a_pretrained_network_says_so(made, tmp_path):
    plan = plan_with(tmp_path, "pbns", "skinning", trained=made[0])
    (taken,) = (task for task in tasks_of(plan) if task.kind == "network")
    done = taken.run(context(tmp_path), {})
    done = dataclasses.replace(done, origin={"hardware": "a processor of theirs"})
    outcomes = {cell.task_id: RAN for cell in plan.cells} | {taken.id: done}
    outcomes |= {cell.metrics_id: Outcome(result={"energy/strain": 0.1}) for cell in plan.cells}
    rows = rows_of(plan, tasks_of(plan), outcomes)
    remark = f"pretrained network pbns-seed0 of {done.result['trained_at']}"
    for row in rows:
        assert row.reason.startswith(remark) == (row.method == "pbns")
    assert all("a training here gives the same bits" in row.reason for row in rows if row.method == "pbns")
    theirs = {row.metric for row in rows if row.hardware == "a processor of theirs"}
    assert theirs == set(BEFORE_FRAMES)
    assert described(plan, rows)["methods"]["pbns"]["label"] == "PBNS (pretrained)"
    assert remarks(rows, 0, {}) == ["pretrained, not trained here: pbns; a training here gives the same bits"]
    another = dataclasses.replace(rows[0], method="snug", reason=f"{remark}; a training here differs in a")
    (line,) = remarks([*rows, another], 0, {})
    assert line.endswith("here: pbns, snug; the reasons of their rows say what differs")
    differing = dataclasses.replace(done, result={**done.result, "differing": ["a", "b", "c", "d", "e"]})
    rows = rows_of(plan, tasks_of(plan), outcomes | {taken.id: differing})
    assert any("a training here differs in a, b, c and 2 more" in row.reason for row in rows)


def test_the_option_takes_the_package_or_a_folder(tmp_path):
    def folder(*options: str) -> Path | None:
        return study_of(make_parser().parse_args(list(options))).trained

    assert folder() is None and folder("--trained") == trained.FOLDER
    assert folder("--trained", str(tmp_path)) == tmp_path
    with pytest.raises(StudyError, match="no such folder"):
        check_machines(Study(trained=tmp_path / "none"), tmp_path / "run", "")
    with pytest.raises(StudyError, match="leave out --scheduler"):
        check_machines(Study(trained=tmp_path), tmp_path / "run", "tcp://there")
    with pytest.raises(StudyError, match="the folder of this run itself: give another by --out"):
        check_machines(Study(trained=tmp_path), tmp_path / "deeper" / "..", "")


def test_networks_of_a_run_become_those_of_the_package(made, tmp_path, monkeypatch):
    package = tmp_path / "package"
    package.mkdir()
    run = RunFolder(shutil.copytree(made[0], tmp_path / "run"))
    config = {"preset": "quick", "body": "of the package", "garment": "tailored", "pretrained": None}
    run.write_config(config)
    monkeypatch.setattr("snug.motion.library.TRAIN", ("walk",))
    assert put_into_package(run.path, package) == ["pbns-tshirt"]
    file = package / "pbns-tshirt.safetensors"
    assert file.read_bytes() == (run.models / "pbns-seed0.safetensors").read_bytes()
    before = file.read_bytes()
    monkeypatch.setattr("snug.motion.library.TRAIN", ("walk", "kick"))
    with pytest.raises(ValueError, match="learned from other motions"):
        put_into_package(run.path, package)
    for name, other in {"preset": "smoke", "body": ["mine.npz", "1"], "garment": ["cape.obj", {}]}.items():
        run.write_config(config | {name: other})
        with pytest.raises(ValueError, match=f"its {name} is "):
            put_into_package(run.path, package)
    assert file.read_bytes() == before


def test_parts_of_simulations_do_not_depend_on_the_machine():
    parts = {"machine": "1", "package numba": "0.6", "reference_sim": "2", "scene": "3"}
    assert without_machine(parts) == {"reference_sim": "2", "scene": "3"}
