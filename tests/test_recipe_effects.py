"""The table of deviations: it covers every option in which the recipes differ, and never a test motion."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields
from types import SimpleNamespace

from dressing import swaying, tube_dress

from benchmarks import recipe_effects
from benchmarks.recipe_effects import DEVIATIONS, HELD_OUT, main, steps_within, variants
from benchmarks.results import RunFolder
from benchmarks.wardrobe import Wardrobe
from reports.findings import recipes
from snug.motion import TEST, TRAIN
from snug.recipe import DEFAULT, PAPER, Recipe


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


def test_a_trial_tells_the_steps():
    model = SimpleNamespace(history=[{"step": 10, "seconds": 9.0}, {"step": 30, "seconds": 11.0}])
    assert steps_within(60.0, lambda steps: model) == 600  # 0.1 s a step
    assert steps_within(0.1, lambda steps: model) == 10


def test_the_command_writes_rows_that_the_report_understands(tmp_path, monkeypatch, capsys):
    dressed = tube_dress()
    motions = {name: swaying(12, name=name) for name in TRAIN}
    wardrobe = Wardrobe(dressed.body, {"tshirt": dressed.garment}, motions)
    monkeypatch.setattr("benchmarks.wardrobe.open_wardrobe", lambda *whatever: wardrobe)
    monkeypatch.setattr(recipe_effects, "HELD_OUT", HELD_OUT[:1])
    words = ["--seconds", "0.01", "--recipes", "default*mixed*", "-o", str(tmp_path / "out")]
    assert main(words) == 0 and "default without mixed motions" in capsys.readouterr().out
    table = recipes(RunFolder(tmp_path / "out").read_rows())
    assert [line[0] for line in table.rows] == ["default without mixed motions"]
    assert all(cell is not None for cell in table.rows[0])


def test_a_wrong_word_is_one_line_and_the_list_needs_no_torch(capsys):
    assert main(["--recipes", "nothing like it"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    code = "import sys; from benchmarks.recipe_effects import main; main(['--list'])"
    code += "; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0
