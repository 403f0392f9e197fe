"""The benchmark of training and run time: its command, its parts on a small garment, its curve."""

from __future__ import annotations

import csv
import functools
import json
import subprocess
import sys

import numpy as np
import pytest
from dressing import swaying, tube_dress

import benchmarks.solver_speed.__main__ as solver_speed
import snug.train
from benchmarks import parts
from benchmarks.training_speed import convergence, inference, step
from benchmarks.training_speed.__main__ import PARTS, main
from benchmarks.training_speed.settings import VALIDATION, Settings
from reports.convergence import main as draw
from snug.motion_library import TEST, TRAIN
from snug.trained_model import TrainedModel


@pytest.fixture
def small(tmp_path, monkeypatch):
    """Every part on the tube dress and two short motions; the settings of a short run."""
    motions = [swaying(20), swaying(10, name=VALIDATION, degrees=15.0)]
    for part in (convergence, inference, step):
        monkeypatch.setattr(part, "dressed_body", lambda vertices: tube_dress())
        monkeypatch.setattr(part, "training_motions", lambda: motions)
    monkeypatch.setattr(step, "BLOCK", 2)
    monkeypatch.setattr(step, "WARM_UP", 1)
    monkeypatch.setattr(convergence, "POINTS", 3)
    return Settings(device="cpu", repeats=2, steps=6, folder=tmp_path)


def values(rows):
    return {metric: value for metric, value, _ in rows}


def lines(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_help_lists_every_part_without_torch():
    code = "import sys; from benchmarks.training_speed.__main__ import main\n"
    code += "try: main(['--help'])\nexcept SystemExit: sys.exit('torch' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert said.returncode == 0 and all(f"  {part} " in said.stdout for part in PARTS)


@pytest.mark.parametrize(
    "wrong", [["--parts", "step,nonsense"], ["--repeats", "0"], ["--steps", "0"], ["--device", "abacus"]]
)
def test_a_wrong_word_is_one_line_and_exit_2(wrong, capsys):
    assert main(wrong) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert said.err.startswith("benchmarks.training_speed: ")


def test_the_command_writes_rows_and_where_they_come_from(tmp_path, monkeypatch):
    monkeypatch.setattr(inference, "CASES", ("pbns, 300",))
    assert main(["--parts", "inference", "--repeats", "1", "-o", str(tmp_path)]) == 0
    rows = {row["metric"]: row for row in lines(tmp_path / "training_speed.csv")}
    assert rows["frame, median"]["unit"] == "ms" and float(rows["frame, median"]["value"]) > 0
    assert abs(int(rows["vertices"]["value"]) - 300) < 30
    facts = json.loads((tmp_path / "training_speed.json").read_text())
    assert facts["commit"] and facts["hardware"]["processor"] and facts["complete"] is True
    assert facts["configuration"]["recipe"]["window"] == 3 and facts["configuration"]["repeats"] == 1


def test_a_folder_that_cannot_be_made_is_one_line_before_anything_is_measured(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(parts, "measure_parts", lambda *_: pytest.fail("it was begun"))
    (tmp_path / "file").write_text("mine")
    for command in (main, solver_speed.main):
        assert command(["-o", str(tmp_path / "file" / "new")]) == 2
        said = capsys.readouterr()
        assert said.out == "" and said.err.count("\n") == 1 and "file/new" in said.err


@pytest.mark.parametrize(("error", "status"), [(KeyboardInterrupt, 130), (ImportError, None)])
def test_what_was_measured_is_written_whatever_comes_later(error, status, tmp_path, monkeypatch, capsys):
    def measured(*_):
        yield {"part": "inference", "case": "pbns, 300", "metric": "frames timed", "value": 3, "unit": ""}
        raise error("later")

    monkeypatch.setattr(parts, "measure_parts", measured)
    words = ["--parts", "inference", "-o", str(tmp_path)]
    if status is None:
        with pytest.raises(error):
            main(words)
    else:
        assert main(words) == status and "interrupted; 1 rows" in capsys.readouterr().err
    assert [row["value"] for row in lines(tmp_path / "training_speed.csv")] == ["3"]
    assert json.loads((tmp_path / "training_speed.json").read_text())["complete"] is False


def test_an_interrupt_before_the_first_row_leaves_the_last_results(tmp_path, monkeypatch):
    def measured(*_):
        raise KeyboardInterrupt
        yield {}

    (tmp_path / "training_speed.csv").write_text("whole")
    monkeypatch.setattr(parts, "measure_parts", measured)
    assert main(["-o", str(tmp_path)]) == 130
    assert (tmp_path / "training_speed.csv").read_text() == "whole"


@pytest.mark.parametrize("kind", ["snug", "supervised", "pbns"])
def test_a_step_has_a_time_and_parts(small, kind):
    found = values(step.measure(f"{kind}, 150", small))
    assert 0 < found["step, least"] <= found["step, median"]
    shares = {metric: value for metric, value in found.items() if metric.startswith("step: ")}
    assert shares["step: backward"] > 0 and ("step: energies" in shares) == (kind != "supervised")
    assert found["60000 steps at the median"] == pytest.approx(found["step, median"] / 60)


def test_a_frame_has_a_time_and_a_network_a_size(small):
    found = values(inference.measure("snug, 150", small))
    assert 0 < found["frame, least"] <= found["frame, median"] <= found["frame, 95 %"]
    assert found["frames timed"] == 2 * 20
    assert 4e-6 * found["parameters"] <= found["memory of the network"] <= found["model file"]


def test_a_killed_convergence_goes_on_to_the_same_curve(small, monkeypatch):
    found = values(convergence.measure("snug, 150", small))
    whole = lines(small.folder / "convergence.csv")
    assert [row["step"] for row in whole] == ["2", "4", "6"] and found["steps"] == 6
    assert 20 < found["frames to learn from"] <= 20 * 13  # mixed motions too, the held-out one not
    model = TrainedModel.load(small.folder / "models" / "snug.safetensors")
    assert model.steps == 6 and all(row["seconds/validation"] > 0 for row in model.history)
    assert 0 < float(whole[-1]["seconds"]) < model.history[-1]["seconds"]

    (small.folder / "convergence.csv").unlink()
    asked = iter([False, False, False, True])
    stopped = functools.partial(snug.train.train, stop=lambda: next(asked))
    with monkeypatch.context() as patch:
        patch.setattr(snug.train, "train", stopped)
        with pytest.raises(Exception, match="stopped after step 4"):
            convergence.measure("snug, 150", small)
    begun = []
    step_of = snug.train.train
    monkeypatch.setattr(snug.train, "train", lambda *a, **k: step_of(*a, log=begun.append, **k))
    convergence.measure("snug, 150", small)
    assert [row["step"] for row in begun] == [6]  # only what was left
    again = lines(small.folder / "convergence.csv")
    for name in ("step", "loss", "validation", "strain"):
        assert [row[name] for row in again] == [row[name] for row in whole], name
    assert [p.name for p in (small.folder / "models").iterdir()] == ["snug.safetensors"]


def test_the_time_of_validations_is_left_out():
    history = [
        {"step": 2.0, "seconds": 3.0, "loss": 2.0, "validation": 4.0, "seconds/validation": 0.5},
        {"step": 4.0, "seconds": 5.0, "loss": 1.0, "validation": 3.0, "seconds/validation": 0.5},
    ]
    assert [point["seconds"] for point in convergence.curve(history)] == [2.0, 3.0]


def test_a_validation_that_is_no_number_is_near_to_nothing():
    rows = [{"step": 2.0 * k, "seconds": 3.0 * k, "loss": 2.0, "validation": 4.0} for k in (1, 2, 3)]
    del rows[1]["validation"]
    values = np.array([point["validation"] for point in convergence.curve(rows)])
    assert np.isnan(values[1]) and convergence.arrival(values, 0.1) == 2
    assert convergence.arrival(np.array([4.0, 4.0, np.nan]), 0.1) == 2
    found = {name: value for name, value, _ in convergence._found(convergence.curve(rows))}
    assert found["validation at its best"] == 4.0


def test_arrival_is_for_good():
    falling = np.array([3.0, 1.02, 1.2, 1.02, 1.005, 1.0])
    assert convergence.arrival(falling, 0.03) == 3  # not 1, for it left again
    assert convergence.arrival(falling, 0.01) == 4
    assert convergence.arrival(np.ones(3), 0.01) == 0


def test_the_held_out_motion_is_one_to_train_on():
    assert VALIDATION in TRAIN and VALIDATION not in TEST


def test_the_curve_is_drawn_and_a_missing_one_is_one_line(tmp_path, capsys):
    assert draw([str(tmp_path)]) == 2 and capsys.readouterr().err.count("\n") == 1
    curve = tmp_path / "convergence.csv"
    curve.write_text("step,seconds,loss,validation\n10,1.5,2.0,1.9\n20,2.5,0.6,0.7\n")
    assert draw([str(tmp_path)]) == 0 and (tmp_path / "convergence.png").stat().st_size > 5000
    curve.write_text("step,seconds\n10,1\n")
    assert draw([str(tmp_path)]) == 2
