"""The table of deviations: it covers every option in which the recipes differ, and never a test motion."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace
from types import SimpleNamespace

import pytest
from benchmarks.wardrobe import Wardrobe
from dressing import swaying, tube_dress
from reports.findings import recipes

from benchmarks import presets, recipe_trials, workers
from benchmarks.recipe_effects import DEVIATIONS, main, variants
from benchmarks.recipe_trials import HELD_OUT, learned, steps_within
from benchmarks.results import RunFolder
from snug.motion_library import TEST, TRAIN
from snug.recipe import DEFAULT, PAPER, Recipe
from snug.training_set import TrainingError


def differing(a: Recipe, b: Recipe) -> set[str]:
    names = (field.name for field in fields(Recipe))
    return {name for name in names if name != "name" and getattr(a, name) != getattr(b, name)}


def test_every_deviation_has_its_line_and_changes_nothing_else():
    listed = [option for deviation in DEVIATIONS for option in deviation.options]
    assert sorted(listed) == sorted(differing(DEFAULT, PAPER))
    found = {recipe.name: recipe for recipe in variants()}
    assert len(found) == 2 + 2 * len(DEVIATIONS)
    for deviation in DEVIATIONS:
        undone, added = found[f"default without {deviation.name}"], found[f"paper with {deviation.name}"]
        assert differing(undone, DEFAULT) == differing(added, PAPER) == set(deviation.options)
        assert differing(undone, PAPER) == differing(DEFAULT, PAPER) - set(deviation.options)


def test_held_out_motions_are_training_motions():
    assert set(HELD_OUT) < set(TRAIN) and not set(HELD_OUT) & set(TEST)
    assert sorted([*learned(TRAIN), *HELD_OUT]) == sorted(TRAIN)


def test_a_trial_tells_the_steps():
    model = SimpleNamespace(history=[{"step": 10, "seconds": 9.0}, {"step": 30, "seconds": 11.0}])
    assert steps_within(60.0, lambda steps: model) == 600  # 0.1 s a step
    assert steps_within(0.1, lambda steps: model) == 10


@pytest.fixture
def small(tmp_path, monkeypatch):
    """The command's words for two recipes on a tube; jobs are done here and now, and counted."""
    dressed, done = tube_dress(), []
    motions = {name: swaying(12, name=name) for name in TRAIN}
    wardrobe = Wardrobe(dressed.body, {"tshirt": dressed.garment}, motions)

    def at_once(jobs, wardrobe, **_):
        monkeypatch.setattr(workers, "_wardrobe", wardrobe)
        monkeypatch.setattr(workers, "_progress", SimpleNamespace(put=done.append))
        return [workers._call(job) for job in jobs]

    monkeypatch.setattr("benchmarks.wardrobe.open_wardrobe", lambda *whatever: wardrobe)
    monkeypatch.setattr(workers, "run_jobs", at_once)
    monkeypatch.setattr(recipe_trials, "HELD_OUT", HELD_OUT[:1])
    monkeypatch.setattr(recipe_trials, "_kept", {})
    words = ["--seconds", "0.01", "--recipes", "*without mixed*", "-o", str(tmp_path / "out")]
    return SimpleNamespace(words=words, done=done, out=tmp_path / "out")


def test_the_command_writes_rows_that_the_report_understands(small, capsys):
    assert main(small.words) == 0 and "default without mixed motions" in capsys.readouterr().out
    table = recipes(RunFolder(small.out).read_rows())
    assert [line[:2] for line in table.rows] == [("default", "without mixed motions")]
    assert all(cell is not None for cell in table.rows[0])


def test_what_has_ended_is_not_done_again(small, monkeypatch):
    def interrupted(jobs, wardrobe, **_):
        workers.run_jobs = whole
        workers.run_jobs(jobs[:1], wardrobe)
        raise KeyboardInterrupt

    whole = workers.run_jobs
    monkeypatch.setattr(workers, "run_jobs", interrupted)
    words = [*small.words, "--seeds", "0,1"]
    with pytest.raises(KeyboardInterrupt):
        main(words)
    before = RunFolder(small.out).read_rows()
    assert {row.seed for row in before} == {0} and small.done == [1]
    assert main(words) == 0 and small.done == [1, 1]
    after = RunFolder(small.out).read_rows()
    assert {row.seed for row in after} == {0, 1} and after[: len(before)] == before
    assert main([*words, "--seconds", "0.02"]) == 0 and len(small.done) == 4  # other work


def test_what_a_changed_preset_or_another_command_left_is_not_taken_for_its_own(small, monkeypatch, capsys):
    assert main(small.words) == 0 and len(small.done) == 1
    quick = presets.find_preset("quick")
    monkeypatch.setattr(presets, "find_preset", lambda name: replace(quick, frames=quick.frames + 1))
    assert main(small.words) == 0 and len(small.done) == 2
    folder = RunFolder(small.out)
    folder.write_config(folder.read_config() | {"command": "python -m benchmarks.run"})
    before = folder.rows_path.read_bytes()
    assert main(small.words) == 2
    assert "holds the results of another command" in capsys.readouterr().err
    assert folder.rows_path.read_bytes() == before


def test_a_training_that_fails_is_a_row_and_one_that_is_killed_a_line(small, monkeypatch, capsys):
    def failing(*_):
        raise TrainingError("no steps")

    monkeypatch.setattr(recipe_trials, "steps_within", failing)
    assert main(small.words) == 1
    (row,) = RunFolder(small.out).read_rows()
    assert (row.status, row.value) == ("diverged", None) and "no steps" in row.reason
    monkeypatch.setattr(
        workers, "run_jobs", lambda jobs, *_, **__: [workers.Failure(jobs[0].label, "killed")]
    )
    assert main([*small.words, "--seconds", "0.02"]) == 1
    assert capsys.readouterr().err.splitlines() == [
        "recipe_effects: default without mixed motions, seed 0: killed"
    ]


def test_a_file_in_place_of_the_folder_is_one_line(tmp_path, capsys):
    (tmp_path / "mine").write_text("precious")
    for out in (tmp_path / "mine", tmp_path / "mine" / "deeper"):
        assert main(["--recipes", "paper", "-o", str(out)]) == 2
        assert "there is a file in the way; name another folder" in capsys.readouterr().err
    assert (tmp_path / "mine").read_text() == "precious"


def test_a_wrong_word_is_one_line_and_the_list_needs_no_torch(capsys):
    assert main(["--recipes", "nothing like it"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    code = "import sys; from benchmarks.recipe_effects import main; main(['--list'])"
    code += "; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0
