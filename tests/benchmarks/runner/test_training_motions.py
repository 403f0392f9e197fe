"""The training motions of a run, simulated, in one file."""

from __future__ import annotations

import numpy as np

from benchmarks import export
from benchmarks.runner import ground_truth, training_motions
from reference_sim.trajectory import Trajectory
from snug.motion.library import TRAIN
from snug.networks.dressed_body import DressedBody
from snug.training.simulated_data import DataSet
from tests.benchmarks.runner.tasks_by_hand import InProcess


def test_training_motions_are_simulated_and_written_once_all_are_whole(tmp_path, monkeypatch, capsys):
    done: list[str] = []

    def draped(scene, entry, folder):  # in place of a simulation: the garment skinned to the body
        if not done:
            done.append("broken")
            raise RuntimeError("no room")
        done.append(scene.dressed.motion.name)
        worn = scene.dressed
        positions = DressedBody(worn.body, worn.garment).skinned(worn.motion)
        return Trajectory(positions, worn.garment.faces, np.arange(len(positions)) / 30)

    monkeypatch.setattr(ground_truth, "simulated", draped)
    monkeypatch.setattr(training_motions, "Executor", lambda run, assets, workers: InProcess(run, assets))
    out = tmp_path / "motions.h5"
    arguments = ["tshirt/training-motions", "--set", "sizes=smoke", "-o", str(out)]
    assert export.main(arguments) == 2
    assert "failed: RuntimeError: no room" in capsys.readouterr().err and not out.exists()
    assert export.main(arguments) == 0  # what was finished is not simulated again
    motions = [motion.name for motion in DataSet.read(out).motions]
    assert sorted(done) == sorted([*motions, "broken"]) and set(motions) <= set(TRAIN)
    assert f"{len(motions)} training motions of tshirt in {out}" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["motions.h5"]
