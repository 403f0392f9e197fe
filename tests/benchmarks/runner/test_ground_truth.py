"""Mixed clips are simulated once, like motions, and taught to every network that asks for them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

from benchmarks import export
from benchmarks.method import Simulated
from benchmarks.methods import find_method
from benchmarks.methods.declared_networks import TRAININGS
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.plan.plan import Network
from benchmarks.presets import find_preset
from benchmarks.runner import ground_truth, training_motions
from benchmarks.runner.ground_truth import simulate_clips
from benchmarks.runner.networks import train
from benchmarks.runner.schedule import Schedule, tasks_of
from benchmarks.runner.task import Outcome
from reference_sim import Trajectory
from reference_sim.files.array_file import read_arrays
from snug.motion.library import TRAIN
from snug.networks.dressed_body import DressedBody
from snug.training.augmentation import CLIP_FRAMES, make_shared_clips
from tests.benchmarks.runner.tasks_by_hand import (
    InProcess,
    assets_of,
    context,
    dressed_scene,
    plan_of,
    training,
)
from tests.snug.training.dressing import swaying, tube_dress

MOTION = swaying(90)


def clips_of(part: int, folder, assets, method: str = "simulation"):
    """Return the outcome of a part of the clips."""
    scene, entry = dressed_scene(MOTION.name), find_method(method)
    return simulate_clips(scene, entry, (MOTION.name,), part, 1.0, context(folder, assets), {})


def still(clip, entry) -> Trajectory:
    """Return a converged trajectory of this clip, every coordinate equal to the number in the clip's name."""
    positions = np.full((clip.frames, 150, 3), float(clip.name.split("_")[1]))
    faces = tube_dress().garment.faces
    return Trajectory(positions, faces, np.arange(clip.frames) / 30.0, status="converged")


def whole(folder, name: str) -> Outcome:
    """Return the outcome of a simulation of 90 frames, whose file is there."""
    still(dataclasses.replace(MOTION, name="still_1"), None).save(folder / f"{name}.vtkhdf")
    return Outcome(result={"whole": True, "motion": name}, files=(f"{name}.vtkhdf",))


@pytest.fixture
def quickly(monkeypatch):
    """Clips that cost nothing: name -> how it ends otherwise; those that were asked for."""
    odd, asked = {}, []

    def quick(scene, entry, folder):
        clip = scene.dressed.motion
        asked.append(clip.name)
        return odd.get(clip.name, still)(clip, entry)

    monkeypatch.setattr(ground_truth, "simulate_scene", quick)
    return odd, asked


def test_parts_are_all_clips_once_and_what_is_not_whole_is_left_out(tmp_path, quickly):
    odd, asked = quickly

    def ended(clip, entry):
        return dataclasses.replace(still(clip, entry), status="stalled", reason="stuck")

    def refused(clip, entry):
        raise RuntimeError("no room")

    def halved(clip, entry):
        whole = still(clip, entry)
        return dataclasses.replace(whole, positions=whole.positions[:9], times=whole.times[:9])

    odd |= {"mixed_0": ended, "mixed_2": refused, "mixed_3": halved}
    assets = assets_of(tube_dress(), MOTION)
    outcomes = [clips_of(part, tmp_path, assets) for part in range(4)]
    assert asked == [clip.name for clip in make_shared_clips([MOTION], 4, turns=1.0, vertices=150)]
    assert [o.result["clips"] for o in outcomes] == [["mixed_1"], [], [], ["mixed_4", "mixed_5"]]
    left_out = {name: why for o in outcomes for name, why in o.result["left_out"].items()}
    assert left_out == {"mixed_0": "stalled: stuck", "mixed_2": "no room", "mixed_3": "converged: "}
    clips = read_arrays(tmp_path / outcomes[0].files[0])
    assert clips.keys() == {"mixed_1"} and clips["mixed_1"].dtype == np.float32
    truncated = clips_of(0, tmp_path, assets, "fast-lbfgs-10")
    assert truncated.result["clips"] == ["mixed_0", "mixed_1"]  # it is stopped on purpose


def test_a_network_learns_from_given_motions_and_from_the_clips_that_are_there(tmp_path, quickly):
    odd, _ = quickly
    odd["mixed_1"] = lambda clip, entry: dataclasses.replace(still(clip, entry), status="stalled")
    assets = assets_of(tube_dress(), MOTION)
    clips = {("clips", str(part)): clips_of(part, tmp_path, assets) for part in range(2)}
    outcome = whole(tmp_path, MOTION.name)
    task = training("supervised", MOTION.name, steps=1)
    task = dataclasses.replace(task, reads=(*task.reads, *clips))
    result = train(task, context(tmp_path, assets), {("data", MOTION.name): outcome, **clips}).result
    assert result["frames"] == 90 + 2 * CLIP_FRAMES
    assert result["clips_left_out"] == 1 and result["left_out"] == []
    lost = train(task, context(tmp_path, assets), {("data", MOTION.name): outcome}).result
    assert lost["frames"] == 90


def test_sizes_limit_what_is_simulated_and_turned():
    small, quick = find_preset("small"), find_preset("quick")
    simulated = TRAININGS["supervised"].at(small).simulated
    assert simulated.mixed == small.simulated_mixed == 2
    assert (simulated.method, simulated.clips_by, simulated.turns) == ("simulation", "fast-lbfgs-10", 0.5)
    assert TRAININGS["snug"].at(small).recipe.turn == small.turns * 0.2 == 0.1
    assert all(training.at(quick) == training for training in TRAININGS.values())


def test_the_same_simulations_serve_every_seed_and_training(tmp_path, monkeypatch):
    rough = "fast-lbfgs-10"
    for name, simulated in (("tailornet", Simulated(2, rough)), ("supervised", Simulated(3))):
        training = dataclasses.replace(TRAININGS[name], simulated=simulated)
        monkeypatch.setitem(TRAININGS, name, training)
    scene, names = dressed_scene("kick"), ("supervised", "santesteban2019", "tailornet", "snug")
    cells = tuple(
        Cell(scene, find_method(name), seed, ("garments",)) for name in names for seed in (0, 1)
    )
    plan = plan_of(tmp_path, motions=Motions(train=("walk", "run"), test=("kick",)), cells=cells)
    tasks = [task for task in tasks_of(plan) if task.stage == "ground truth"]
    labels = [task.label for task in tasks]
    assert len(labels) == len(set(labels)) == len({task.id for task in tasks}) == 1 + 2 + 3 + 2 + 2
    assert "tshirt/walk" in labels and "tshirt/walk by fast-lbfgs-10" in labels
    *_, first, second = Schedule(plan).training(Network("tailornet", 0, "tshirt")).reads
    assert [first, second] == [("clips", f"tshirt-mixed-2-turns-1/{rough}-{part}") for part in (0, 1)]
    clips = Schedule(plan).clips("tshirt", Simulated(clips_by="newton-4", turns=0.5), ("walk",), 0)
    assert clips.id == ("clips", "tshirt-mixed-1-turns-0.5/newton-4-0") and "turns" in clips.inputs


@pytest.mark.slow
def test_training_motions_are_simulated_and_written_once_all_are_whole(tmp_path, monkeypatch, capsys):
    names: list[str] = []

    def draped(scene, entry, folder):  # in place of a simulation: the garment skinned to the body
        if not names:
            names.append("broken")
            raise RuntimeError("no room")
        names.append(scene.dressed.motion.name)
        worn = scene.dressed
        positions = DressedBody(worn.body, worn.garment).skin(worn.motion)
        return Trajectory(positions, worn.garment.faces, np.arange(len(positions)) / 30)

    monkeypatch.setattr(ground_truth, "simulate_scene", draped)
    monkeypatch.setattr(training_motions, "Executor", lambda run, assets, workers: InProcess(run, assets))
    monkeypatch.chdir(tmp_path)
    Path("reports").touch()  # no folder of runs can be made here, nor is one needed
    out = tmp_path / "motions.h5"
    arguments = ["tshirt/training-motions", "--set", "sizes=smoke", "-o", str(out)]
    assert export.main([*arguments, "--reference"]) == 2 and "are of a scene" in capsys.readouterr().err
    assert export.main(arguments) == 2
    assert "failed: RuntimeError: no room" in capsys.readouterr().err and not out.exists()
    assert export.main(arguments) == 0  # what was finished is not simulated again
    with h5py.File(out) as file:
        motions = [group.attrs["name"] for group in file.values()]
    assert sorted(names) == sorted([*motions, "broken"]) and set(motions) <= set(TRAIN)
    assert f"{len(motions)} training motions of tshirt in {out}" in capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["motions.h5", "reports"]
