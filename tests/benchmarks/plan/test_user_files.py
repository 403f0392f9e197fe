"""Methods, scenes, metrics, energies and programs of a user's files."""

from __future__ import annotations

import dataclasses
import sys
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from benchmarks import run
from benchmarks.method import MethodEntry, Training
from benchmarks.methods.outside import program
from benchmarks.methods.own_energies import find_energies, find_own_reference
from benchmarks.plan import user_files
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.schedule import Schedule
from benchmarks.scenes import find_scene
from reference_sim.files.array_file import read_arrays
from snug.recipe import DEFAULT
from tests.benchmarks.plan.outside_files import (
    HELPER,
    METRIC_FILE,
    PROGRAM,
    PROGRAM_FILE,
    SCENE_FILE,
    TINY,
    as_before,
    method_by,
)
from tests.benchmarks.runner.tasks_by_hand import dressed_scene, plan_of
from tests.benchmarks.test_provenance import forget

_as_before = pytest.fixture(autouse=True)(as_before)


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """A user's folder."""
    folder = tmp_path_factory.mktemp("user")
    (folder / "a.txt").write_text("weights")
    (folder / "mine.py").write_text(method_by("mine_helper", "mine"))
    (folder / "mine_helper.py").write_text(HELPER.format(shift=0.0))
    (folder / "lift.py").write_text(SCENE_FILE)
    (folder / "height.py").write_text(METRIC_FILE)
    (folder / "theirs.py").write_text(PROGRAM_FILE)
    (folder / "theirs_run.py").write_text(PROGRAM)
    (other := folder / "other").mkdir()
    (other / "other_method.py").write_text(method_by("other_helper", "other-1"))
    (other / "other_helper.py").write_text(HELPER.format(shift=0.001))
    (other / "broken.py").write_text(method_by("broken_helper", "broken"))
    (other / "broken_helper.py").write_text(
        "def place(*_):\n    raise RuntimeError('broken on\\npurpose')\n"
    )
    (other / "a.txt").write_text("weights")
    return folder


WORDS = ["smoke:speed", "--scenes", "lift.py", "--set", "metrics=height.py"]
METHODS = "simulation,skinning,./mine.py,other/other_method.py,other/broken.py,theirs.py"
WORDS += ["--methods", METHODS, "-o", "out"]


def command(files: Path, *more: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(files)
        return run.main([*WORDS, *more])


@pytest.fixture(scope="module")
def done(files) -> RunFolder:
    with contextmanager(as_before)(), redirect_stdout(StringIO()) as output:
        assert command(files) == 1  # one of the methods is broken
    assert output.getvalue().count(f"  {(files / 'out').resolve()}/") == 3  # page, PDF, rows
    (film,) = (line for line in output.getvalue().splitlines() if line.startswith("film  "))
    assert "reports.film out --scene lift --methods " in film and "skinning" not in film
    return RunFolder(files / "out")


def test_a_failed_cell_is_a_row_and_the_rest_goes_on(done):
    ended = {
        row.method: (row.status, row.reason) for row in done.read_rows() if row.metric == "cost/frame"
    }
    assert ended["broken"] == ("failed", "RuntimeError: broken on purpose")
    assert ended["skinning"][0] == "skipped" and "no body" in ended["skinning"][1]
    assert ended["simulation"] == ended["mine"] == ("ok", "")
    config = done.read_config()
    assert config["finished"] and config["commit"] and config["versions"]["numpy"]
    assert (done.path / "report.pdf").stat().st_size > 1000
    curves = read_arrays(done.curves_path("lift", "simulation"))
    assert {"energy/lift", "energy/inertia", "energy/total"} <= set(curves)
    assert not [path for path in done.path.rglob("*") if "part" in path.name]


def test_entries_of_files_and_as_a_program_are_rows_like_others(done):
    rows = {(row.method, row.metric): row for row in done.read_rows()}
    assert {row.scene for row in rows.values()} == {"lift"}
    off = {method: row.value for (method, metric), row in rows.items() if metric == "exact/distance"}
    assert max(off["simulation"], off["mine"], off["theirs"]) < 1e-9 and len(off) == 4
    assert off["other-1"] == pytest.approx(0.001 * 3**0.5)
    assert all((method, "energy/lift") in rows and (method, "height/highest") in rows for method in off)
    assert rows["mine", "height/highest"].unit == "m" and rows["mine", "height/highest"].value > 0.4


def test_a_program_is_not_timed_and_its_own_time_is_marked(done):
    costs = {(row.method, row.metric): row for row in done.read_rows() if row.metric.startswith("cost")}
    assert [metric for method, metric in costs if method == "theirs"] == ["cost/frame"]
    declared, measured = costs["theirs", "cost/frame"], costs["mine", "cost/frame"]
    assert (declared.value, declared.reason) == (2.0, "declared by its author, not measured")
    assert done.read_config()["methods"]["theirs"]["label"] == "theirs (declared time)"
    assert measured.reason == "" and measured.value > 0.0


def test_what_is_unchanged_is_cached_and_what_is_edited_is_done_again(done, files, capsys):
    def stale() -> set[str]:
        forget()
        assert command(files, "--dry-run") == 0
        lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  cell")]
        return {line.split(":")[0].split()[-1] for line in lines if ": run" in line}

    assert stale() == set()
    (files / "theirs_run.py").write_text(PROGRAM + "# every byte counts\n")
    assert "theirs" in stale()
    (files / "theirs_run.py").write_text(PROGRAM)
    (files / "a.txt").write_text("other weights")
    assert stale() == {"mine"}
    (files / "a.txt").write_text("weights")
    (files / "mine_helper.py").write_text(HELPER.format(shift=0.5))
    beside = {"simulation", "mine", "theirs", "other-1", "broken"}
    assert stale() == beside  # the helper lies beside the scene's file too


ANSWERS = """
from benchmarks import known_answer

@known_answer({"half": {"of": 2.0}, "third": {"of": 3.0}}, expected=0.5, tolerance=0.1, reason="by hand")
def share(of):
    '''Return the share.'''
    return 1.0 / of

@known_answer("all", expected=1.0, tolerance=0.1, reason="by hand")
def whole():
    return 1.0
"""
STUDY = """
[parts.answers]
question = "does a study bring known answers?"
cases = ["./{}"]
"""


def test_a_study_brings_known_answers_of_its_own(tmp_path):
    (tmp_path / "of_mine.py").write_text(ANSWERS)
    (tmp_path / "study.toml").write_text(STUDY.format("of_mine.py"))
    out = tmp_path / "out"
    assert run.main([str(tmp_path), "-o", str(out)]) == 1  # one of the two is wrong
    rows = {row.scene: row for row in RunFolder(out).read_rows()}
    statuses = {"half": "ok", "third": "failed", "all": "ok"}
    assert {name: row.status for name, row in rows.items()} == statuses
    assert rows["half"].suite == "answers" and rows["third"].value == pytest.approx(1 / 3)
    assert "half,1,0.5,0.5,0.1" in (RunFolder(out).tables / "validation.csv").read_text()


def test_an_energy_of_a_file_can_be_trained_on_once_it_is_loaded(tmp_path):
    with pytest.raises(ValueError, match=r"unknown energy 'levity'.*import the file of your own"):
        dataclasses.replace(DEFAULT, terms=("levity",))
    (tmp_path / "levity.py").write_text(SCENE_FILE + "class Levity(Lift):\n    name = 'levity'\n")
    user_files.import_file(str(tmp_path / "levity.py"))
    assert dataclasses.replace(DEFAULT, terms=("strain", "levity")).terms[1] == "levity"


def test_own_energies_of_a_users_file_are_known_where_the_file_was_not_loaded(tmp_path):
    home = tmp_path / "draught.py"
    home.write_text(SCENE_FILE + "class Draught(Lift):\n    name = 'draught'\n")
    recipe = dataclasses.replace(DEFAULT, contact_margin=0.001)
    object.__setattr__(recipe, "terms", (*DEFAULT.terms, "draught"))  # as it comes to a task's process
    entry = MethodEntry(
        name="mine", description="", trained="mine", training=Training("snug", recipe), role="network",
        declared_in=str(home),
    )  # fmt: skip
    assert find_energies(entry).terms == recipe.terms
    reference = find_own_reference(entry)
    assert reference.declared_in == str(home) and find_energies(reference) == find_energies(entry)
    assert (reference.name, reference.options["contact_margin"]) == ("simulation-of-mine", 0.001)


def test_a_method_brings_the_training_of_its_network(tmp_path):
    home = str(tmp_path / "windy.py")
    Path(home).write_text("")
    recipe = dataclasses.replace(DEFAULT, name="windy", window=4)
    entry = MethodEntry(
        name="windy", description="", module="benchmarks.methods.networks", declared_in=home,
        needs_body=True, trained="windy", training=Training("snug", recipe), options={"kind": "windy"},
    )  # fmt: skip
    cell = Cell(dressed_scene("kick", preset=TINY), entry, 0, ("garments",))
    plan = plan_of(tmp_path, preset=TINY, cells=(cell,), motions=Motions(("walk",), ("kick",)))
    (task,) = (task for task in Schedule(plan).tasks() if task.kind == "network")
    job = Schedule(plan).training(plan.networks[0])
    assert job.network.training == Training("snug", recipe)
    assert (job.network.declared_in, job.steps) == (home, TINY.steps["snug"])
    assert home in task.code and home in Schedule(plan).cell(cell).code


@pytest.mark.parametrize(
    ("body", "seconds", "message"),
    [
        ("import time; print('loading', flush=True); time.sleep(9)", 2, "was ended after 2 s: loading"),
        ("pass", 9, "has not written {out}"),
        ("import numpy as n; x = n.load(scene + '/cloth.npz')['start_positions']\n"
         "n.savez(out, positions=n.stack(6 * [x]), seconds_per_frame=-1.0)", 9, "no positive number"),
    ],
)  # fmt: skip
def test_a_program_that_goes_wrong_says_so_in_its_last_line(body, seconds, message, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(f"import sys\n_, scene, out = sys.argv\n{body}\n")
    entry = program("p", f"{sys.executable} -I {script} {{scene}} {{out}}", seconds=seconds)
    method = entry.make(models=tmp_path, seed=0)
    method.prepare(find_scene("free_fall").at(TINY).build())
    with pytest.raises(Exception) as raised:
        method.run()
    assert message in str(raised.value) and "\n" not in str(raised.value)
