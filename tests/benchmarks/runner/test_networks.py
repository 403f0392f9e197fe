"""Networks: a killed training goes on; files in the place of trainings, what is taken, refused and said."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest
import torch

from benchmarks import run
from benchmarks.method import Training
from benchmarks.methods import find_method
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.plan.plan import Network, Plan
from benchmarks.results.row import BEFORE_FRAMES
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.networks import NetworkTraining, find_pretrained, put_into_package, take, train
from benchmarks.runner.rows import rows_of
from benchmarks.runner.run_json import describe_plan
from benchmarks.runner.schedule import Schedule, tasks_of
from benchmarks.runner.task import Outcome
from snug.named_recipes import PBNS
from snug.networks.trained_model import TrainedModel
from snug.training.optimisation_step import Trainer
from tests.benchmarks.runner.tasks_by_hand import (
    TINY,
    assets_of,
    context,
    dressed_scene,
    plan_of,
    training,
)
from tests.snug.training.dressing import swaying, tube_dress

WALK = dataclasses.replace(swaying(16), name="walk")
FEW = dataclasses.replace(TINY, steps={"snug": 2, "pbns": 2})
RAN = Outcome(result={"seconds": 1.0, "frames": 4, "peak": 70.0, "terms": "strain"}, files=("x",))


def plan_with(folder: Path, *methods: str, **changes) -> Plan:
    """A plan of these methods in a scene of the T-shirt."""
    cells = tuple(
        Cell(dressed_scene("kick", preset=FEW), find_method(m), 0, ("garments",)) for m in methods
    )
    motions = Motions(train=("walk",), test=("kick",))
    return plan_of(folder, **{"cells": cells, "motions": motions, "preset": FEW} | changes)


def training_of(plan: Plan, name: str = "pbns", seed: int = 0) -> NetworkTraining:
    return Schedule(plan).training(Network(name, seed, "tshirt"))


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, Outcome]:
    """The folder of a run that trained PBNS, and what the training left."""
    folder = tmp_path_factory.mktemp("made")
    job = training_of(plan_with(folder, "pbns"))
    return folder, train(job, context(folder, assets_of(tube_dress(), WALK)), {})


def weights(path: Path) -> dict[str, torch.Tensor]:
    return TrainedModel.load(path).network.state_dict()


def test_a_file_takes_the_place_of_the_training_that_made_it(made, tmp_path):
    folder, outcome = made
    job = training_of(plan_with(tmp_path, "pbns"))
    source, refusal = find_pretrained(job, folder)
    assert source and not refusal
    result = take(job, source, context(tmp_path), {})
    tensors, other = (weights(job.path(RunFolder(place))) for place in (folder, tmp_path))
    assert all(torch.equal(tensors[name], other[name]) for name in tensors | other)
    facts = {"pretrained": "pbns-seed0", "trained_at": result.result["trained_at"], "data_seconds": 0}
    assert result.result == outcome.result | facts and result.origin["hardware"]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"preset": dataclasses.replace(FEW, steps={"pbns": 3})}, "(steps)"),
        ({"preset": dataclasses.replace(FEW, garment_vertices=99)}, "(assets)"),
        ({"motions": Motions(train=("walk", "kick"))}, "(motions)"),
        ({"preset": dataclasses.replace(FEW, frames=5, test_motions=3)}, ""),  # how long tests are
    ],
)
def test_a_network_of_another_training_is_refused_and_says_in_what(made, tmp_path, changes, named):
    _, refusal = find_pretrained(training_of(plan_with(tmp_path, "pbns", **changes)), made[0])
    assert named in refusal and bool(refusal) == bool(named) and "\n" not in refusal


def test_a_network_of_another_processor_is_taken_and_what_is_none_is_refused_in_one_line(made, tmp_path):
    job = training_of(plan_with(tmp_path, "pbns"))
    elsewhere = dataclasses.replace(job, inputs={**job.inputs, "machine": "another"}, key="another")
    assert find_pretrained(elsewhere, made[0])[1] == ""
    none = "no pretrained network pbns-tshirt: benchmarks.run"
    assert find_pretrained(job, tmp_path)[1].startswith(none)
    path = tmp_path / "pbns-tshirt.safetensors"
    path.write_bytes(b"half")
    assert "pbns-tshirt.safetensors: not a safetensors file" in find_pretrained(job, tmp_path)[1]
    dataclasses.replace(TrainedModel.load(job.path(RunFolder(made[0]))), origin={}).save(path)
    assert "a network of another training (assets, " in find_pretrained(job, tmp_path)[1]


def test_a_run_from_files_simulates_and_trains_nothing_but_a_users_own(made, tmp_path):
    entry = dataclasses.replace(
        find_method("pbns"), name="mine", trained="mine", training=Training("pbns", PBNS), declared_in=""
    )
    plan = plan_with(tmp_path, "pbns", "supervised", trained=made[0])
    cell = dataclasses.replace(plan.cells[0], entry=entry)
    tasks = tasks_of(dataclasses.replace(plan, cells=(*plan.cells, cell)))
    kinds = {task.name: task.stage for task in tasks if task.kind == "network"}
    assert kinds == {
        "tshirt/pbns-seed0": "pretrained networks", "tshirt/supervised-seed0": "pretrained networks",
        "tshirt/mine-seed0": "training",
    }  # fmt: skip
    assert "data" not in {task.kind for task in tasks}
    trained = tasks_of(plan_with(tmp_path, "pbns", "supervised"))
    assert "data" in {task.kind for task in trained}


def test_a_network_of_the_package_stands_beside_the_trained_one_where_it_fits(tmp_path):
    def networks(**sizes) -> dict[str, tuple[str, str, int]]:
        preset = dataclasses.replace(FEW, **sizes)
        tasks = tasks_of(plan_with(tmp_path, "pbns", "pbns-packaged", preset=preset))
        return {t.label: (t.stage, t.skip, len(t.files)) for t in tasks if t.kind == "network"}

    fitting = networks(garment_vertices=1000, train_frames=5)  # however few steps and frames train here
    assert fitting["pbns seed 0 (tshirt)"] == ("training", "", 1)
    assert fitting["pbns-packaged seed 0 (tshirt)"] == ("pretrained networks", "", 0)  # no copy of it
    assert "(assets)" in networks()["pbns-packaged seed 0 (tshirt)"][1]


def test_every_row_of_a_pretrained_network_says_so(made, tmp_path):
    plan = plan_with(tmp_path, "pbns", "skinning", trained=made[0])
    (import_task,) = (task for task in tasks_of(plan) if task.kind == "network")
    outcome = import_task.run(context(tmp_path), {})
    outcome = dataclasses.replace(outcome, origin={"hardware": "a processor of theirs"})
    outcomes = {cell.id(): RAN for cell in plan.cells} | {import_task.id: outcome}
    outcomes |= {cell.id("metrics"): Outcome(result={"energy/strain": 0.1}) for cell in plan.cells}
    rows = rows_of(plan, tasks_of(plan), outcomes)
    remark = f"pretrained network pbns-seed0 of {outcome.result['trained_at']}"
    assert {row.reason for row in rows if row.method == "pbns"} == {remark}
    assert {row.pretrained for row in rows} == {remark, ""}
    theirs = {row.metric for row in rows if row.hardware == "a processor of theirs"}
    assert theirs == set(BEFORE_FRAMES)
    assert describe_plan(plan, rows)["methods"]["pbns"]["label"] == "PBNS (pretrained)"


def test_networks_of_a_run_become_those_of_the_package(made, tmp_path):
    run = RunFolder(shutil.copytree(made[0], tmp_path / "run"))
    assert put_into_package(run.path, tmp_path) == ["pbns-tshirt"]
    file = tmp_path / "pbns-tshirt.safetensors"
    assert file.read_bytes() == (run.models / "pbns-seed0.safetensors").read_bytes()


CHECKPOINT = ".snug-seed0.checkpoint.safetensors"


def test_a_training_that_was_killed_goes_on_where_it_was(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.runner.networks.CHECKPOINT_MINUTES", 1e-9)
    dressed, motion = tube_dress(), swaying(30)
    assets, step, steps = assets_of(dressed, motion), Trainer.step, []

    def trained(folder, key, stop=99):
        """Train, in this run as far as some steps; `done` are those of this run."""

        def counted(self, number):
            if len(steps) == stop:
                raise KeyboardInterrupt
            steps.append(number)
            return step(self, number)

        steps.clear()
        monkeypatch.setattr(Trainer, "step", counted)
        return train(training("snug", motion.name, steps=5, key=key), context(folder, assets), {})

    models = RunFolder(tmp_path).models
    for key in ("before", "now"):  # the first is another training: of other inputs, or of other code
        with pytest.raises(KeyboardInterrupt):
            trained(tmp_path, key, 3)
        assert steps == list(range(3))
        assert [path.name for path in models.iterdir()] == [CHECKPOINT]
    assert trained(tmp_path, "now").result["steps"] == 5 and steps == [3, 4]
    (tmp_path / "damaged" / "models").mkdir(parents=True)
    (tmp_path / "damaged" / "models" / CHECKPOINT).write_bytes(b"half")
    trained(tmp_path / "damaged", "now")
    assert steps == list(range(5))
    assert [path.name for path in models.iterdir()] == ["snug-seed0.safetensors"]


def test_weights_of_another_mesh_are_refused_before_anything_is_simulated(tmp_path, capsys):
    words = "--scenes tshirt/01_01_a --methods snug,skinning --set sizes=smoke --trained -o"
    assert run.main([*words.split(), str(tmp_path)]) == 2 and not list(tmp_path.rglob("*.*"))
    assert "a network of another training (assets, " in capsys.readouterr().err
