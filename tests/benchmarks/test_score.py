"""A roll-out of others is scored: its numbers are those of a run."""

from __future__ import annotations

import io
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import publish, references, run, score
from benchmarks.methods import find_method
from benchmarks.metric import Estimate, RollOut, SceneRollOuts
from benchmarks.plan.study import StudyError, option, read_study
from benchmarks.presets import find_preset
from benchmarks.provenance import digest
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.measurements import measure_roll_out
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
    out = tmp_path / "out"
    assert score.main([f"mine={mine},ms=2.5", *SCENE, "-o", str(out), "--reference", simulated]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split(" | ")[0] for line in printed[2:4]] == [
        "| Reference, from a file",
        "| mine (declared time)",
    ]
    assert printed[-1] == f"mine: ok; {out}"
    scored, expected = RunFolder(out), numbers(folder, "newton-1")
    metrics = numbers(scored, "mine")
    for name in [name for name in expected if name.startswith(("cost/", "solver/"))]:
        del expected[name]
    assert metrics.pop("cost/frame") == 2.5  # copying is not timed
    assert metrics == expected
    row = next(row for row in scored.read_rows() if row.method == "mine" and row.metric == "cost/frame")
    declared = "declared by its author, not measured"
    assert (row.status, row.reason, row.role) == ("ok", declared, "external")
    beside = numbers(scored, "reference")
    assert beside["energy/total"] == numbers(folder, "simulation")["energy/total"]
    assert (out / "for_your_paper.tex").stat().st_size > 500
    again = score.score(
        f"mine={mine}", SCENE[1], study=STUDY, reference=simulated, folder=tmp_path / "again"
    )
    assert (again["name"], again["scene"], again["status"]) == ("mine", "hanging_sheet", "ok")
    assert again["metrics"]["energy/strain"] == {"value": expected["energy/strain"], "unit": "J"}
    assert score.main([f"mine={mine}", *SCENE, "-o", str(folder.path)]) == 2
    assert "holds a run of another command" in capsys.readouterr().err


def test_without_a_reference_the_reason_is_said(made, tmp_path):
    assert score.main([f"mine={made[1]}", *SCENE, "--no-reference", "-o", str(tmp_path / "out")]) == 0
    rows = RunFolder(tmp_path / "out").read_rows()
    reasons = [(row.status, row.reason) for row in rows if row.role == "reference"]
    assert reasons == [("skipped", score.NO_REFERENCE)]
    metrics = {row.metric for row in rows if row.role == "external"}
    assert {"energy/total", "gap/energy", "curvature/mean"} <= metrics
    assert not metrics & {"curvature/error", "distance/rms", "gap/relative", "cost/frame"}


def test_a_shipped_reference_gives_the_numbers_of_a_fresh_simulation(tmp_path, monkeypatch, capsys):
    """No scene is simulated that has one; of other sizes it is, and that is said."""
    monkeypatch.setattr(references, "FOLDER", tmp_path / "shipped")
    monkeypatch.setattr(references, "METHODS", score.MEASURED_BESIDE)
    study = read_study("full:garments", [option("sizes", "smoke")])
    monkeypatch.setattr(publish, "read_study", lambda name: study)
    name, folder = "tshirt/sudden_stop", tmp_path / "made"
    study = replace(study, split="validation")
    publish.make_reference(name, folder)
    skinned = Trajectory.load(RunFolder(folder / "tshirt-sudden_stop").trajectory_path(name, "skinning"))
    np.savez(tmp_path / "mine.npz", positions=skinned.positions)
    fresh = score.score(tmp_path / "mine.npz", name, study=study, fresh=True, folder=tmp_path / "fresh")
    capsys.readouterr()
    monkeypatch.setattr("benchmarks.scenes.dressed_body.simulate", None)  # of the settling
    shipped = score.score(tmp_path / "mine.npz", name, study=study, folder=tmp_path / "quick")
    assert "it is simulated" not in capsys.readouterr().err
    for metric, number in fresh["metrics"].items():
        assert shipped["metrics"][metric]["value"] == pytest.approx(
            number["value"], rel=1e-3, abs=1e-6
        ), metric
    names = shipped["metrics"].keys()
    assert names == fresh["metrics"].keys() >= {"gap/relative", "dynamics/common_gain"}
    assert numbers(RunFolder(tmp_path / "quick"), "skinning") == pytest.approx(
        numbers(RunFolder(tmp_path / "fresh"), "skinning"), rel=1e-3, abs=1e-6
    )
    longer = replace(study, sizes=replace(study.sizes, settle_frames=13))
    other = score.score(tmp_path / "mine.npz", name, study=longer, folder=tmp_path / "other")
    assert other["status"] == "ok"
    error = capsys.readouterr().err  # what needs no simulation is kept
    assert "none is shipped for this scene" in error
    assert "quasi-static solutions: failed: TypeError" in error


@pytest.mark.slow  # minutes: a whole scene is simulated
def test_a_file_of_the_package_is_that_of_a_fresh_simulation(tmp_path):
    """On one kind of processor: simulations are chaotic."""
    name = "tshirt/push_recovery"
    shipped = (references.FOLDER / "tshirt-push_recovery.npz").read_bytes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(references, "FOLDER", tmp_path / "shipped")
        anew = publish.make_reference(name, tmp_path / "made")
    one, other = (dict(np.load(io.BytesIO(of))) for of in (shipped, anew.read_bytes()))
    assert all(np.array_equal(one[array], other[array]) for array in ("positions", "hem", "motion"))
    metrics, again = (json.loads(str(of["facts"]))["metrics"] for of in (one, other))
    for method, values in metrics.items():
        assert again[method] == pytest.approx(values, rel=1e-6), method


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


def test_a_pickle_that_brings_its_own_body_needs_no_scene(tmp_path, capsys):
    scene = small_scene("sheet_on_sphere")
    trajectory = prepared("newton-4", scene).run()
    pickled, rest, out = tmp_path / "pred.pkl", tmp_path / "rest.obj", tmp_path / "out"
    arguments = [str(pickled), "--rest-mesh", str(rest), "--no-reference", "--set", "sizes=smoke", "-o"]

    def write(scale: float) -> None:
        obstacle = np.repeat(scene.obstacle.positions, scene.frames, axis=0)
        arrays = {"pred": scale * trajectory.positions, "cloth_faces": trajectory.faces}
        arrays |= {"obstacle": scale * obstacle, "obstacle_faces": scene.obstacle.faces}
        pickled.write_bytes(pickle.dumps(arrays))
        write_obj(rest, scale * scene.cloth.rest_positions, scene.cloth.faces)

    write(1.0)
    assert score.main([*arguments, str(out)]) == 0
    metrics = {row.metric: row.value for row in RunFolder(out).read_rows() if row.role == "external"}
    group = SceneRollOuts(scene, gap_samples=find_preset("smoke").gap_samples)
    group.roll_outs.append(RollOut(group, find_method("newton-4"), trajectory, suites=("speed",)))
    values = measure_roll_out(group.roll_outs[0])[0]
    values.pop("solver/relaxed_frames")  # which a file does not say
    expected = {
        name: value.value if isinstance(value, Estimate) else value for name, value in values.items()
    }
    assert metrics == expected and expected["energy/collision"] > 0.0 <= expected["penetration/vertices"]
    # All of it in another unit, and nobody says so: nothing in the file contradicts it but its size.
    for scale, unit, hint in ((100.0, "m", "units=cm"), (1.0, "mm", "units=m")):
        write(scale)
        assert score.main([f"{pickled},units={unit}", *arguments[1:], str(tmp_path / "no")]) == 2
        error = capsys.readouterr().err.splitlines()[-1]
        assert f"m across in units={unit}: say " in error and hint in error
    assert not (tmp_path / "no").exists()


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
