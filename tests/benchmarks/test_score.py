"""A roll-out of others is scored: its numbers are those of a run."""

from __future__ import annotations

import json
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import run, score
from benchmarks.external.scene_files import write_obj
from benchmarks.methods import find_method
from benchmarks.metric import Estimate, RollOut, SceneRollOuts
from benchmarks.plan.cell import Cell
from benchmarks.plan.study import StudyError
from benchmarks.presets import find_preset
from benchmarks.provenance import digest
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.measurements import measured
from benchmarks.runner.schedule import Schedule
from reference_sim import Trajectory
from tests.benchmarks.plan.planned import planned, study_with
from tests.benchmarks.runner.tasks_by_hand import run_in_this_process, small_scene

SMOKE = find_preset("smoke")


# --- a run, and its roll-outs scored ---------------------------------------------------------------------


def without_report(patch: pytest.MonkeyPatch) -> None:
    """Let runs end with their rows: figures, page and PDF are three seconds."""
    patch.setattr("benchmarks.runner.execute_plan.make_report", lambda log: "")


@pytest.fixture(scope="module", autouse=True)
def no_processes():
    """Every task is run in this process: none is begun, and nothing is compiled again."""
    with pytest.MonkeyPatch.context() as patch:
        run_in_this_process(patch)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of the simulation and of Newton cut after one iteration."""
    out = tmp_path_factory.mktemp("made") / "run"
    options = ["smoke", "--scenes", "hanging_sheet", "-o", str(out)]
    with pytest.MonkeyPatch.context() as patch:
        without_report(patch)
        assert run.main([*options, "--methods", "simulation,newton-1"]) == 0
    return RunFolder(out)


def numbers(folder: RunFolder, method: str) -> dict[str, float | None]:
    return {row.metric: row.value for row in folder.read_rows() if row.method == method}


def test_a_scored_roll_out_has_the_rows_of_the_run_it_comes_from(made, tmp_path, capsys):
    files = [str(made.trajectory_path("hanging_sheet", name)) for name in ("newton-1", "simulation")]
    options = ["--scene", "hanging_sheet", "--set", "sizes=smoke", "-o", str(tmp_path / "out")]
    assert score.main([f"mine={files[0]},ms=2.5", *options, "--reference", files[1]]) == 0
    line = capsys.readouterr().out
    assert line.count("\n") == 1 and "report.pdf" in line
    assert line.startswith("mine in hanging_sheet: energy/total -0.03")
    scored, expected = RunFolder(tmp_path / "out"), numbers(made, "newton-1")
    metrics = numbers(scored, "mine")
    costs = {name for name in {**expected, **metrics} if name.startswith(("cost/", "solver/"))}
    assert {name: metrics[name] for name in metrics.keys() - costs} == {
        name: expected[name] for name in expected.keys() - costs
    }
    # Copying is not timed.
    assert {name: metrics[name] for name in metrics.keys() & costs} == {"cost/frame": 2.5}
    row = next(row for row in scored.read_rows() if row.method == "mine" and row.metric == "cost/frame")
    assert (row.status, row.reason, row.role) == ("ok", "declared by its author, not measured", "external")
    assert scored.read_config()["methods"]["mine"]["label"] == "mine (declared time)"
    assert numbers(scored, "reference")["energy/total"] == numbers(made, "simulation")["energy/total"]
    assert (tmp_path / "out" / "report.pdf").stat().st_size > 1000


def test_numbers_come_as_json_and_in_python_without_a_report(made, tmp_path, capsys):
    files = [str(made.trajectory_path("hanging_sheet", name)) for name in ("newton-1", "simulation")]
    options = ["--scene", "hanging_sheet", "--set", "sizes=smoke", "--reference", files[1]]
    printed = ["--json", "-o", str(tmp_path / "out")]
    assert score.main([f"mine={files[0]}", *options, *printed]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["name"], summary["scene"], summary["status"]) == ("mine", "hanging_sheet", "ok")
    strain = numbers(made, "newton-1")["energy/strain"]
    assert summary["metrics"]["energy/strain"] == {"value": strain, "unit": "J"}
    assert not (tmp_path / "out" / "report.pdf").exists() and (tmp_path / "out" / "results.csv").is_file()
    assert summary["metrics"]["gap/energy"]["value"] == numbers(made, "newton-1")["gap/energy"]
    beside = numbers(RunFolder(tmp_path / "out"), "reference")
    assert "energy/total" in beside and "cost/frame" not in beside
    scene, more = ("hanging_sheet",), {"study": study_with(sizes="smoke"), "reference": files[1]}
    returned = score.score(f"mine={files[0]}", *scene, **more, folder=tmp_path / "again")
    assert returned["metrics"]["energy/strain"]["value"] == strain
    with pytest.raises(ValueError, match="no such file"):
        score.score(tmp_path / "absent.npz", *scene, **more, folder=tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("status", "rows", "error", "says"),
    [(130, [], KeyboardInterrupt, None), (1, [], ValueError, "the disk is full")],
)
def test_an_evaluation_that_broke_off_is_no_result(made, tmp_path, monkeypatch, status, rows, error, says):
    def broken(plan, **_):
        RunFolder(plan.folder).write_rows(rows)
        print("the disk is full", file=sys.stderr)
        return status

    monkeypatch.setattr(score, "carry_out", broken)
    file = f"mine={made.trajectory_path('hanging_sheet', 'newton-1')}"
    study = study_with(sizes="smoke")
    with pytest.raises(error, match=says):
        score.score(file, "hanging_sheet", study=study, folder=tmp_path / "out")


def test_without_a_reference_the_reason_is_said(made, tmp_path, monkeypatch):
    without_report(monkeypatch)
    file = str(made.trajectory_path("hanging_sheet", "newton-1"))
    options = ["--scene", "hanging_sheet", "--set", "sizes=smoke", "--no-reference"]
    options += ["-o", str(tmp_path / "out")]
    assert score.main([f"mine={file}", *options]) == 0
    rows = RunFolder(tmp_path / "out").read_rows()
    assert [(row.status, row.reason) for row in rows if row.role == "reference"] == [
        ("skipped", score.NO_REFERENCE)
    ]
    metrics = {row.metric for row in rows if row.role == "external"}
    assert {"energy/total", "gap/energy", "curvature/mean"} <= metrics
    assert not metrics & {"curvature/error", "distance/rms", "gap/relative", "cost/frame"}


def test_a_run_takes_roll_outs_where_there_is_a_file_and_knows_when_it_has_changed(made, tmp_path):
    def of_mine() -> Cell:
        plan = planned(*flags)
        (stored,) = (cell for cell in plan.cells if cell.method == "mine")  # the flag has no file
        return digest(Schedule(plan).cell(stored).inputs), stored

    frames = Trajectory.load(made.trajectory_path("hanging_sheet", "newton-1")).positions
    np.savez(tmp_path / "hanging_sheet.npz", positions=frames)
    flags = ["smoke:speed", "--scenes", "hanging_sheet,flag", "-o", str(made.path)]
    flags += ["--methods", "simulation,newton-1", "--rollout", f"mine={tmp_path}/{{scene}}.npz,ms=1"]
    key, stored = of_mine()
    assert stored.scene.name == "hanging_sheet" and stored.suites == ("speed",) and not stored.timed
    assert of_mine()[0] == key
    np.savez(tmp_path / "hanging_sheet.npz", positions=frames + 1e-3)
    assert of_mine()[0] != key
    flags[-1] = f"mine={tmp_path}/hanging_sheet.npz"
    with pytest.raises(StudyError, match="2 are asked for: name it with"):
        of_mine()


def test_a_pickle_that_brings_its_own_body_needs_no_scene(tmp_path, monkeypatch, capsys):
    without_report(monkeypatch)
    scene = small_scene("sheet_on_sphere")
    obstacle = np.repeat(scene.obstacle.positions, scene.frames, axis=0)
    made = find_method("newton-4").make(models=Path(), seed=0)
    made.prepare(scene)
    trajectory = made.run()
    held = {"pred": trajectory.positions, "cloth_faces": trajectory.faces}
    held |= {"obstacle": obstacle, "obstacle_faces": scene.obstacle.faces}
    (tmp_path / "pred.pkl").write_bytes(pickle.dumps(held))
    write_obj(tmp_path / "rest.obj", scene.cloth.rest_positions, scene.cloth.faces, None)
    arguments = [str(tmp_path / "pred.pkl"), "--rest-mesh", str(tmp_path / "rest.obj"), "--no-reference"]
    assert score.main([*arguments, "--set", "sizes=smoke", "-o", str(tmp_path / "out")]) == 0
    metrics = {
        row.metric: row.value for row in RunFolder(tmp_path / "out").read_rows() if row.role == "external"
    }
    group = SceneRollOuts(scene, gap_samples=SMOKE.gap_samples)
    group.roll_outs.append(RollOut(group, find_method("newton-4"), trajectory, suites=("speed",)))
    values = measured(group.roll_outs[0])[0]
    expected = {name: value.value if isinstance(value, Estimate) else value for name, value in values.items()}
    expected.pop("solver/relaxed_frames")  # which a file does not say
    assert (
        metrics == expected and metrics["penetration/vertices"] >= 0.0 and metrics["energy/collision"] > 0.0
    )
    assert score.main([arguments[0], "--rest-mesh", arguments[0], "-o", str(tmp_path / "no")]) == 2
    assert capsys.readouterr().err.splitlines()[-1].count("pred.pkl") >= 1 and not (tmp_path / "no").exists()
    # All of it in centimetres, and nobody says so: nothing in the file contradicts it but its size.
    large = {**held, "pred": 100.0 * held["pred"], "obstacle": 100.0 * obstacle}
    (tmp_path / "pred.pkl").write_bytes(pickle.dumps(large))
    write_obj(tmp_path / "rest.obj", 100.0 * scene.cloth.rest_positions, scene.cloth.faces, None)
    assert score.main([*arguments, "--set", "sizes=smoke", "-o", str(tmp_path / "no")]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert "m across in units=m: say units=cm" in error and not (tmp_path / "no").exists()


REFUSED = {
    "no file": (["nowhere.npz", "--scene", "flag"], "nowhere.npz: no such file"),
    "no scene": (["mine.npz", "--scene", "flagg"], "did you mean flag"),
    "two scenes": (["mine.npz", "--scene", "tshirt/*"], "are asked for"),
    "kind": (["mine.abc", "--scene", "flag"], "unknown kind of roll-out"),
    "shape": (["mine.npz", "--scene", "flag"], "has 5 vertices, the cloth of flag 49"),
    "taken by the file": (["snug.npz", "--scene", "flag"], "snug=snug.npz: a method is called snug"),
    "pattern": (["mine.npz", "--scene", "flag", "--reference", "r_{scene}.npz"], "r_flag.npz: no such file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_is_one_line_and_leaves_nothing(name, tmp_path, monkeypatch, refused):
    arguments, hint = REFUSED[name]
    np.savez(tmp_path / "mine.npz", positions=np.ones((10, 5, 3)))
    monkeypatch.chdir(tmp_path)
    refused(hint, score.main, [*arguments, "--set", "sizes=smoke", "-o", "out"])
