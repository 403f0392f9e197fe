"""A roll-out of others is scored: its numbers are those of a run."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

from benchmarks import run, score
from benchmarks.methods import find_method
from benchmarks.metric import Estimate, RollOut, SceneRollOuts
from benchmarks.plan.study import StudyError
from benchmarks.presets import find_preset
from benchmarks.provenance import digest
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.measurements import measured
from benchmarks.runner.schedule import Schedule
from reference_sim import Trajectory
from reference_sim.trajectory import write_obj
from tests.benchmarks.plan.planned import planned, study_with
from tests.benchmarks.runner.tasks_by_hand import prepared, run_in_this_process, small_scene

SCENE = ["--scene", "hanging_sheet", "--set", "sizes=smoke"]
STUDY = study_with(sizes="smoke")


@pytest.fixture(scope="module", autouse=True)
def no_processes():
    """Every task is run in this process: none is begun, and nothing is compiled again."""
    with pytest.MonkeyPatch.context() as patch:
        run_in_this_process(patch)
        yield


@pytest.fixture
def without_report(monkeypatch):
    """Runs end with their rows: figures, page and PDF are three seconds."""
    monkeypatch.setattr("benchmarks.runner.execute_plan.make_report", lambda log: "")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of the simulation and of Newton cut after one iteration, and its two trajectories."""
    out = tmp_path_factory.mktemp("made") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("benchmarks.runner.execute_plan.make_report", lambda log: "")
        words = f"smoke --scenes hanging_sheet --methods simulation,newton-1 -o {out}"
        assert run.main(words.split()) == 0
    folder = RunFolder(out)
    paths = [str(folder.trajectory_path("hanging_sheet", name)) for name in ("newton-1", "simulation")]
    return folder, *paths


def numbers(folder: RunFolder, method: str) -> dict[str, float | None]:
    return {row.metric: row.value for row in folder.read_rows() if row.method == method}


def test_a_scored_roll_out_has_the_rows_of_the_run_it_comes_from(made, tmp_path, capsys):
    folder, mine, simulated = made
    options = [*SCENE, "-o", str(tmp_path / "out"), "--reference", simulated]
    assert score.main([f"mine={mine},ms=2.5", *options]) == 0
    line = capsys.readouterr().out
    assert line.count("\n") == 1 and "report.pdf" in line
    assert line.startswith("mine in hanging_sheet: energy/total -0.03")
    scored, expected = RunFolder(tmp_path / "out"), numbers(folder, "newton-1")
    metrics = numbers(scored, "mine")
    for name in [name for name in expected if name.startswith(("cost/", "solver/"))]:
        del expected[name]
    assert metrics.pop("cost/frame") == 2.5  # copying is not timed
    assert metrics == expected
    row = next(row for row in scored.read_rows() if row.method == "mine" and row.metric == "cost/frame")
    declared = "declared by its author, not measured"
    assert (row.status, row.reason, row.role) == ("ok", declared, "external")
    assert scored.read_config()["methods"]["mine"]["label"] == "mine (declared time)"
    assert numbers(scored, "reference")["energy/total"] == numbers(folder, "simulation")["energy/total"]
    assert (tmp_path / "out" / "report.pdf").stat().st_size > 1000


def test_numbers_come_as_json_and_in_python_without_a_report(made, tmp_path, capsys):
    folder, mine, simulated = made
    out = tmp_path / "out"
    assert score.main([f"mine={mine}", *SCENE, "--reference", simulated, "--json", "-o", str(out)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["name"], summary["scene"], summary["status"]) == ("mine", "hanging_sheet", "ok")
    expected = numbers(folder, "newton-1")
    assert summary["metrics"]["energy/strain"] == {"value": expected["energy/strain"], "unit": "J"}
    assert summary["metrics"]["gap/energy"]["value"] == expected["gap/energy"]
    assert not (out / "report.pdf").exists()
    beside = numbers(RunFolder(out), "reference")
    assert "energy/total" in beside and "cost/frame" not in beside
    more = {"study": STUDY, "reference": simulated, "folder": tmp_path / "again"}
    assert score.score(f"mine={mine}", "hanging_sheet", **more)["metrics"] == summary["metrics"]


def test_without_a_reference_the_reason_is_said(made, tmp_path, without_report):
    assert score.main([f"mine={made[1]}", *SCENE, "--no-reference", "-o", str(tmp_path / "out")]) == 0
    rows = RunFolder(tmp_path / "out").read_rows()
    reasons = [(row.status, row.reason) for row in rows if row.role == "reference"]
    assert reasons == [("skipped", score.NO_REFERENCE)]
    metrics = {row.metric for row in rows if row.role == "external"}
    assert {"energy/total", "gap/energy", "curvature/mean"} <= metrics
    assert not metrics & {"curvature/error", "distance/rms", "gap/relative", "cost/frame"}


def test_a_run_takes_roll_outs_where_there_is_a_file_and_knows_when_it_has_changed(made, tmp_path):
    def key_of_mine() -> str:
        plan = planned(*flags)
        (stored,) = (cell for cell in plan.cells if cell.method == "mine")  # the flag has no file
        assert stored.scene.name == "hanging_sheet" and stored.suites == ("speed",) and not stored.timed
        return digest(Schedule(plan).cell(stored).inputs)

    frames = Trajectory.load(made[1]).positions
    np.savez(tmp_path / "hanging_sheet.npz", positions=frames)
    flags = ["smoke:speed", "--scenes", "hanging_sheet,flag", "-o", str(made[0].path)]
    flags += ["--methods", "simulation,newton-1", "--rollout", f"mine={tmp_path}/{{scene}}.npz,ms=1"]
    key = key_of_mine()
    assert key_of_mine() == key
    np.savez(tmp_path / "hanging_sheet.npz", positions=frames + 1e-3)
    assert key_of_mine() != key
    flags[-1] = f"mine={tmp_path}/hanging_sheet.npz"
    with pytest.raises(StudyError, match="2 are asked for: name it with"):
        key_of_mine()


def test_a_pickle_that_brings_its_own_body_needs_no_scene(tmp_path, without_report, capsys):
    scene = small_scene("sheet_on_sphere")
    trajectory = prepared("newton-4", scene).run()
    pickled, rest, out = tmp_path / "pred.pkl", tmp_path / "rest.obj", tmp_path / "out"
    arguments = [str(pickled), "--rest-mesh", str(rest), "--no-reference", "--set", "sizes=smoke", "-o"]

    def write(scale: float) -> None:
        obstacle = np.repeat(scene.obstacle.positions, scene.frames, axis=0)
        held = {"pred": scale * trajectory.positions, "cloth_faces": trajectory.faces}
        held |= {"obstacle": scale * obstacle, "obstacle_faces": scene.obstacle.faces}
        pickled.write_bytes(pickle.dumps(held))
        write_obj(rest, scale * scene.cloth.rest_positions, scene.cloth.faces)

    write(1.0)
    assert score.main([*arguments, str(out)]) == 0
    metrics = {row.metric: row.value for row in RunFolder(out).read_rows() if row.role == "external"}
    group = SceneRollOuts(scene, gap_samples=find_preset("smoke").gap_samples)
    group.roll_outs.append(RollOut(group, find_method("newton-4"), trajectory, suites=("speed",)))
    values = measured(group.roll_outs[0])[0]
    values.pop("solver/relaxed_frames")  # which a file does not say
    expected = {
        name: value.value if isinstance(value, Estimate) else value for name, value in values.items()
    }
    assert metrics == expected and expected["energy/collision"] > 0.0 <= expected["penetration/vertices"]
    # All of it in centimetres, and nobody says so: nothing in the file contradicts it but its size.
    write(100.0)
    assert score.main([*arguments, str(tmp_path / "no")]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert "m across in units=m: say units=cm" in error and not (tmp_path / "no").exists()


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        ("mine.npz --scene flagg", "did you mean flag"),
        ("mine.npz --scene flag", "has 5 vertices, the cloth of flag 49"),
        ("snug.npz --scene flag", "snug=snug.npz: a method is called snug"),
        ("mine.npz --scene flag --reference r_{scene}.npz", "r_flag.npz: no such file"),
    ],
)
def test_a_refusal_is_one_line_and_leaves_nothing(words, hint, tmp_path, monkeypatch, refused):
    np.savez(tmp_path / "mine.npz", positions=np.ones((10, 5, 3)))
    monkeypatch.chdir(tmp_path)
    refused(hint, score.main, [*words.split(), "--set", "sizes=smoke", "-o", "out"])
