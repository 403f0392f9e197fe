"""A study is read from its file and from options; a wrong field is refused with its place."""

from __future__ import annotations

from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import pytest

from benchmarks import run
from benchmarks.plan.study import locate, option, parse_setting, read_study, study_names
from benchmarks.presets import find_preset
from reports.blocks import FIGURES
from snug.file_options import GarmentFile
from tests.benchmarks.plan.planned import planned

MINE = """question = "Does it fall, mine.py"
like = "smoke"
body = "mine.npz"
motions = ["clips", "library"]
metrics = "height.py"
sizes = { base = "quick", frames = 60, steps.snug = 7, dependence.frames = 3 }

[garment]
path = "shirt.obj"
shift = [0, 0.1, 0]

[parts.speed]
scenes = ["flag"]
methods = ["simulation", "mine.py"]

[rollouts]
theirs = "out/{scene}.npz"
others = { path = "o.pc2", units = "cm", ms = 2.5 }
"""


@pytest.fixture
def mine(tmp_path) -> Path:
    """The folder of a user's study, beside whose study.toml lie the files that it names."""
    (tmp_path / "study.toml").write_text(MINE)
    return tmp_path


def test_a_study_has_its_own_fields_those_that_it_is_like_and_paths_beside_its_file(mine):
    study = read_study(str(mine))
    assert study == read_study(str(mine / "study.toml")) and study.question == "Does it fall, mine.py"
    assert study.body == mine / "mine.npz" and study.motions == (str(mine / "clips"), "library")
    assert study.metrics == (str(mine / "height.py"),)
    assert study.parts["speed"].methods == ("simulation", str(mine / "mine.py"))
    assert list(study.parts) == ["garments", "speed", "validation", "extremes", "shapes"]
    quick = find_preset("quick")
    dependence = replace(quick.dependence, frames=3)
    assert study.sizes == replace(
        quick, frames=60, steps={**quick.steps, "snug": 7}, dependence=dependence
    )
    assert study.garment.path == mine / "shirt.obj" and study.garment.shift == (0.0, 0.1, 0.0)
    assert study.rollouts["theirs"].path == str(mine / "out/{scene}.npz")
    assert (study.rollouts["others"].units, study.rollouts["others"].ms) == ("cm", 2.5)
    assert study.written["sizes"]["frames"] == 60 and "like" not in study.written
    (mine / "other.toml").write_text('like = "study.toml"\nbody = "other.npz"\n')
    assert read_study(str(mine / "other.toml")).body == mine / "other.npz"


def test_options_hold_before_the_file_and_their_paths_are_relative_to_where_one_is(mine):
    options = [parse_setting(text) for text in ("sizes.frames=9", "garment.units=cm", "body=b.npz")]
    study = read_study(f"{mine}:speed", options)
    assert (study.sizes.frames, study.sizes.name, study.garment.units) == (9, "quick", "cm")
    assert study.body == Path("b.npz") and study.garment.path == mine / "shirt.obj"
    assert list(study.parts) == ["speed"]
    again = [option("garment", {"path": "b.obj"}), option("rollouts", {"others": {"path": "b.pc2"}})]
    study = read_study(str(mine), [*again, parse_setting("sizes=smoke")])
    assert study.garment == GarmentFile(path="b.obj") and study.sizes == find_preset("smoke")
    assert study.rollouts["others"].units == "m" and study.rollouts["theirs"].path.endswith("}.npz")


@pytest.mark.parametrize("name", study_names())
def test_every_study_of_the_package_has_a_question_and_can_be_planned(name):
    study = read_study(name)
    assert study.question.endswith((".", "?")) or ":" in study.question
    words = ("--methods", "simulation") if name == "full" else ()
    plan = planned(name, *words)
    assert plan.study.written["name"] == name
    cells = [cell for cell in plan.cells if cell.entry.skip(cell.scene) is None]
    assert {cell.scene.name for cell in cells} == {scene.name for scene in plan.scenes}


def test_the_list_is_a_screen_with_the_studys_scenes_and_a_word_gives_names_that_have_it(capsys):
    assert run.main(["smoke:speed", "--list"]) == 0
    overview = capsys.readouterr().out
    assert f"\n  speed  {', '.join(scene.name for scene in planned('smoke:speed').scenes)}\n" in overview
    assert len(overview.splitlines()) < 45
    assert run.main(["--list", "kick"]) == 0 and capsys.readouterr().out.count("/kick ") == 6


def test_published_pictures_are_those_that_reports_draw():
    patterns = [f"{figure.name}*" for figure in FIGURES]
    shows = [show for name in study_names() if (show := read_study(name).show)]
    assert len(shows) >= 10
    for picture in (picture for show in shows for picture in show.pictures):
        assert any(fnmatch(f"{picture}.png", pattern) for pattern in patterns), picture


def test_a_fault_of_no_field_of_the_file_gets_none_of_its_lines(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("# mine\n\nseeds = [0]\n\n[sizes]\n# small\nframes = 4\n")
    for field, line in (("seeds", 3), ("sizes.frames", 7), ("sizes.steps", 5), ("trained", 0)):
        place = f"{path}: line {line}: " * bool(line)
        assert locate(f"{field}: wrong", str(path), []) == f"{place}{field}: wrong"
    assert locate("seeds: wrong", str(path), ["--seeds", "1"]) == "seeds: wrong"
