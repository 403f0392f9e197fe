"""A scene is exported, made elsewhere and scored: the numbers are those of a run."""

from __future__ import annotations

import dataclasses
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from benchmarks import export, run, score
from benchmarks.cell import Cell
from benchmarks.external.exported_scene import write_scene
from benchmarks.external.roll_out_option import FileConventions, RollOutOption
from benchmarks.external.scene_files import write_obj
from benchmarks.external.scene_fit import expected_positions
from benchmarks.fingerprint.digest import digest
from benchmarks.methods.catalogue.all_methods import find_method
from benchmarks.methods.outside.stored_roll_out import entry_of
from benchmarks.metric import Estimate, RollOut, SceneRollOuts
from benchmarks.metrics.energies.energy import energy_series
from benchmarks.metrics.surface.curvature import curvature_series
from benchmarks.plan.make_plan import make_plan
from benchmarks.plan.options import make_parser, request_of_run
from benchmarks.plan.plan import PlanError
from benchmarks.plan.plan_roll_out import NO_REFERENCE
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.schedule import Schedule
from benchmarks.tasks.metric_task import measured
from reference_sim import Trajectory
from reference_sim.files.mesh_files import read_mesh
from snug.motion.files import read_motion
from snug.motion.options import MotionFileOptions
from snug.networks.dressed_body import DressedBody
from tests.benchmarks.runner.tasks_by_hand import InProcess, assets_of, dressed_scene, small_scene, thirds
from tests.snug.training.dressing import swaying, tube_dress

SMOKE = find_preset("smoke")


# --- a run, and its roll-outs scored ---------------------------------------------------------------------


@pytest.fixture(scope="module", autouse=True)
def no_processes():
    """Every task is run in this process: none is begun, and nothing is compiled again."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "benchmarks.runner.execute_plan.LocalExecutor",
            lambda folder, assets, _: InProcess(folder, assets),
        )
        yield


def without_report(patch: pytest.MonkeyPatch) -> None:
    """Let runs end with their rows: figures, page and PDF are three seconds."""
    patch.setattr("benchmarks.runner.execute_plan.make_report", lambda log: "")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of the simulation and of Newton cut after one iteration."""
    out = tmp_path_factory.mktemp("made") / "run"
    words = ["--preset", "smoke", "--scenes", "hanging_sheet", "-o", str(out)]
    with pytest.MonkeyPatch.context() as patch:
        without_report(patch)
        assert run.main([*words, "--methods", "simulation,newton-1"]) == 0
    return RunFolder(out)


def numbers(folder: RunFolder, method: str) -> dict[str, float | None]:
    return {row.metric: row.value for row in folder.read_rows() if row.method == method}


def test_a_scored_roll_out_has_the_rows_of_the_run_it_comes_from(made, tmp_path, capsys):
    files = [str(made.trajectory_path("hanging_sheet", name)) for name in ("newton-1", "simulation")]
    words = ["--scene", "hanging_sheet", "--preset", "smoke", "--name", "mine", "-o", str(tmp_path / "out")]
    assert score.main([files[0], *words, "--reference", files[1], "--declared-ms", "2.5"]) == 0
    said = capsys.readouterr().out
    assert (
        said.count("\n") == 1
        and said.startswith("mine in hanging_sheet: total -0.03")
        and "report.pdf" in said
    )
    scored, own = RunFolder(tmp_path / "out"), numbers(made, "newton-1")
    found = numbers(scored, "mine")
    costs = {name for name in {**own, **found} if name.startswith(("cost/", "solver/"))}
    assert {name: found[name] for name in found.keys() - costs} == {
        name: own[name] for name in own.keys() - costs
    }
    assert {name: found[name] for name in found.keys() & costs} == {"cost/frame": 2.5}  # copying is not timed
    row = next(row for row in scored.read_rows() if row.method == "mine" and row.metric == "cost/frame")
    assert (row.status, row.reason, row.role) == ("ok", "declared by its author, not measured", "external")
    assert scored.read_config()["methods"]["mine"]["label"] == "mine (declared time)"
    assert numbers(scored, "reference")["energy/total"] == numbers(made, "simulation")["energy/total"]
    assert (tmp_path / "out" / "report.pdf").stat().st_size > 1000


def test_numbers_come_as_json_and_in_python_without_a_report(made, tmp_path, capsys):
    files = [str(made.trajectory_path("hanging_sheet", name)) for name in ("newton-1", "simulation")]
    words = ["--scene", "hanging_sheet", "--preset", "smoke", "--name", "mine", "--reference", files[1]]
    printed = ["--json", "--no-report", "-o", str(tmp_path / "out")]
    assert score.main([files[0], *words, *printed]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["name"], said["scene"], said["status"]) == ("mine", "hanging_sheet", "ok")
    strain = numbers(made, "newton-1")["energy/strain"]
    assert said["metrics"]["energy/strain"] == {"value": strain, "unit": "J"}
    assert not (tmp_path / "out" / "report.pdf").exists() and (tmp_path / "out" / "results.csv").is_file()
    assert said["metrics"]["gap/energy"]["value"] == numbers(made, "newton-1")["gap/energy"]
    beside = numbers(RunFolder(tmp_path / "out"), "reference")
    assert "energy/total" in beside and "cost/frame" not in beside
    returned = score.score(files[0], *words, "-o", str(tmp_path / "again"))
    assert returned["metrics"]["energy/strain"]["value"] == strain
    with pytest.raises(ValueError, match="no such file"):
        score.score(tmp_path / "absent.npz", *words, "-o", str(tmp_path / "none"))
    assert not (tmp_path / "none").exists()


def test_a_roll_out_on_another_mesh_is_scored_by_its_surface_alone(made, tmp_path, monkeypatch, capsys):
    without_report(monkeypatch)
    simulated = str(made.trajectory_path("hanging_sheet", "simulation"))
    cloth = Trajectory.load(simulated)
    positions, faces = thirds(cloth.positions, cloth.faces)
    np.savez(tmp_path / "fine.npz", positions=positions + np.array([0.0, 0.0, 2e-3]), faces=faces)
    words = [
        "--scene",
        "hanging_sheet",
        "--preset",
        "smoke",
        "--reference",
        simulated,
        "-o",
        str(tmp_path / "out"),
    ]
    assert score.main([str(tmp_path / "fine.npz"), *words]) == 2
    assert "give --other-mesh" in capsys.readouterr().err
    assert score.main([str(tmp_path / "fine.npz"), *words, "--other-mesh"]) == 0
    assert "Chamfer distance" in capsys.readouterr().out
    found = numbers(RunFolder(tmp_path / "out"), "fine")
    assert set(found) == {"surface/chamfer", "surface/normals"}
    assert 0.0 < found["surface/chamfer"] <= 2.0  # mm: it is shifted along itself too
    assert "energy/total" in numbers(RunFolder(tmp_path / "out"), "reference")


def test_without_a_reference_the_reason_is_said(made, tmp_path, monkeypatch):
    without_report(monkeypatch)
    file = str(made.trajectory_path("hanging_sheet", "newton-1"))
    words = ["--scene", "hanging_sheet", "--preset", "smoke", "--no-reference", "-o", str(tmp_path / "out")]
    assert score.main([file, *words, "--name", "mine"]) == 0
    rows = RunFolder(tmp_path / "out").read_rows()
    assert [(row.status, row.reason) for row in rows if row.role == "reference"] == [
        ("skipped", NO_REFERENCE)
    ]
    found = {row.metric for row in rows if row.role == "external"}
    assert {"energy/total", "gap/energy", "curvature/mean"} <= found
    assert not found & {"curvature/error", "distance/rms", "gap/relative", "cost/frame"}


def test_a_run_takes_roll_outs_where_there_is_a_file_and_knows_when_it_has_changed(made, tmp_path):
    def planned() -> Cell:
        plan = make_plan(request_of_run(make_parser().parse_args(words), words))
        (stored,) = (cell for cell in plan.cells if cell.method == "mine")  # the flag has no file
        return digest(Schedule(plan).cell(stored).inputs), stored

    frames = Trajectory.load(made.trajectory_path("hanging_sheet", "newton-1")).positions
    np.savez(tmp_path / "hanging_sheet.npz", positions=frames)
    words = ["--preset", "smoke", "--scenes", "hanging_sheet,flag", "--suite", "speed", "-o", str(made.path)]
    words += ["--methods", "simulation,newton-1", "--rollout", f"mine={tmp_path}/{{scene}}.npz,ms=1"]
    key, stored = planned()
    assert stored.scene.name == "hanging_sheet" and stored.suites == ("speed",) and not stored.timed
    assert planned()[0] == key
    np.savez(tmp_path / "hanging_sheet.npz", positions=frames + 1e-3)
    assert planned()[0] != key
    words[-1] = f"mine={tmp_path}/hanging_sheet.npz"
    with pytest.raises(PlanError, match="2 are asked for: name it with"):
        planned()


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
    words = [str(tmp_path / "pred.pkl"), "--rest-mesh", str(tmp_path / "rest.obj"), "--no-reference"]
    assert score.main([*words, "--preset", "smoke", "-o", str(tmp_path / "out")]) == 0
    found = {
        row.metric: row.value for row in RunFolder(tmp_path / "out").read_rows() if row.role == "external"
    }
    group = SceneRollOuts(scene, gap_samples=SMOKE.gap_samples)
    group.roll_outs.append(RollOut(group, find_method("newton-4"), trajectory, suites=("speed",)))
    values = measured(group.roll_outs[0])[0]
    expected = {name: value.value if isinstance(value, Estimate) else value for name, value in values.items()}
    expected.pop("solver/relaxed_frames")  # which a file does not say
    assert found == expected and found["penetration/vertices"] >= 0.0 and found["energy/collision"] > 0.0
    assert score.main([words[0], "--rest-mesh", words[0], "-o", str(tmp_path / "no")]) == 2
    assert capsys.readouterr().err.splitlines()[-1].count("pred.pkl") >= 1 and not (tmp_path / "no").exists()
    # All of it in centimetres, and nobody says so: nothing in the file contradicts it but its size.
    large = {**held, "pred": 100.0 * held["pred"], "obstacle": 100.0 * obstacle}
    (tmp_path / "pred.pkl").write_bytes(pickle.dumps(large))
    write_obj(tmp_path / "rest.obj", 100.0 * scene.cloth.rest_positions, scene.cloth.faces, None)
    assert score.main([*words, "--preset", "smoke", "-o", str(tmp_path / "no")]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "m across in --units m: say --units cm" in said and not (tmp_path / "no").exists()


REFUSED = {
    "no file": (["nowhere.npz", "--scene", "flag"], "nowhere.npz: no such file"),
    "no scene": (["mine.npz", "--scene", "flagg"], "did you mean flag"),
    "two scenes": (["mine.npz", "--scene", "hanging_sheet,flag"], "name one scene"),
    "kind": (["mine.abc", "--scene", "flag"], "unknown kind of roll-out"),
    "units": (["mine.npz", "--scene", "flag", "--units", "inch"], "choose from m, cm, mm"),
    "time": (["mine.npz", "--scene", "flag", "--declared-ms", "0"], "positive"),
    "both": (["mine.npz", "--scene", "flag", "--reference", "a", "--no-reference"], "not allowed"),
    "shape": (["mine.npz", "--scene", "flag"], "has 5 vertices, the cloth of flag 49"),
    "taken": (["mine.npz", "--scene", "flag", "--name", "snug"], "a method has that name"),
    "name": (["mine.npz", "--scene", "flag", "--name", "a, b"], "the name 'a, b' has other than letters"),
    "long": (["mine.npz", "--scene", "flag", "--reference", "a" * 300 + ".npz"], "a" * 300),
    "pattern": (["mine.npz", "--scene", "flag", "--reference", "r_{scene}.npz"], "r_flag.npz: no such file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_is_one_line_and_leaves_nothing(name, tmp_path, monkeypatch, capsys):
    words, hint = REFUSED[name]
    np.savez(tmp_path / "mine.npz", positions=np.ones((10, 5, 3)))
    monkeypatch.chdir(tmp_path)
    assert score.main([*words, "--preset", "smoke", "-o", "out"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and hint in err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.npz"]


# --- a scene taken home ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """The files of a dressed scene, the scene, and nothing else."""
    tube, motion = tube_dress(), swaying(12)
    garment = dataclasses.replace(tube.garment, loops={"hem": np.arange(15), "neck": np.arange(135, 150)})
    assets = assets_of(DressedBody(tube.body, garment), motion)
    declared = dataclasses.replace(
        dressed_scene("sway"), options={"settle_frames": 4, "warm_up_frames": 2}, sizes=()
    )
    built = declared.build(assets)
    start = built.start_state
    scene = dataclasses.replace(built, settle=lambda: start)
    folder = tmp_path_factory.mktemp("home") / "scene"
    score_command = "python -m benchmarks.score mine.npz"
    write_scene(folder, declared, scene, preset="smoke", score=score_command, simulation=None)
    return folder, scene


def arrays(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as stored:
        return dict(stored)


def rodrigues(poses: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) of axis-angles (..., 3), by the matrix exponential."""
    return expm(np.cross(np.eye(3), poses[..., None, :]))


def skinned_elsewhere(folder: Path, motion: str, turn: np.ndarray) -> np.ndarray:
    """Linear blend skinning from the exported files alone. turn: from the motion's axes to y up."""
    given, moved = arrays(folder / "skinning.npz"), arrays(folder / motion)
    joints, parents = given["joints"], given["parents"]
    frames = len(moved["poses"])
    local = rodrigues(moved["poses"].reshape(frames, -1, 3))
    world, at = np.empty((frames, 24, 3, 3)), np.empty((frames, 24, 3))
    for j, parent in enumerate(parents):
        own = (
            local[:, j]
            if j < 22 or motion == "motion_smpl.npz"
            else np.broadcast_to(np.eye(3), (frames, 3, 3))
        )
        if parent < 0:
            world[:, j], at[:, j] = own, joints[j] + moved["trans"]
        else:
            world[:, j] = world[:, parent] @ own
            at[:, j] = at[:, parent] + world[:, parent] @ (joints[j] - joints[parent])
    local = given["rest_positions"][:, None] - joints  # (V,24,3)
    placed = np.einsum("tjab,vjb->tvja", world, local) + at[:, None]
    return np.einsum("vj,tvja->tva", given["smoothed_weights"], placed) @ turn.T


def measured_of(scene, path: Path) -> dict:
    """Its rows beside the simulation's, a second opinion left out."""
    entry = entry_of(RollOutOption("mine", str(path), FileConventions()), scene.name)
    method = entry.make(models=Path(), seed=0)
    method.prepare(scene)
    return rows_beside(scene, entry, method.run(), method.quasi_static())


def rows_beside(scene, entry, trajectory, static) -> dict:
    group = SceneRollOuts(scene)
    group.quasi_static = expected_positions(scene)
    fall = Trajectory(group.quasi_static + 0.01, trajectory.faces, trajectory.times)
    held = None if static is None else static.positions
    for one, made, own in ((find_method("simulation"), fall, None), (entry, trajectory, held)):
        group.roll_outs.append(RollOut(group, one, made, suites=("garments",), quasi_static=own))
    return measured(group.roll_outs[1])[0]


def test_skinning_made_elsewhere_and_scored_gives_the_numbers_of_the_method(home, tmp_path):
    folder, scene = home
    inside = find_method("skinning").make(models=Path(), seed=0)
    inside.prepare(scene)
    own = inside.run()
    expected = rows_beside(scene, find_method("skinning"), own, inside.quasi_static())
    elsewhere = skinned_elsewhere(folder, "motion_smpl.npz", np.eye(3))
    assert np.abs(elsewhere - own.positions).max() < 1e-6  # the method computes in float32
    np.savez(tmp_path / "mine.npz", positions=elsewhere, fps=30.0, quasi_static=elsewhere)
    found = measured_of(scene, tmp_path / "mine.npz")
    assert found.keys() == expected.keys() and len(found) > 25
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=2e-3, atol=2e-5, err_msg=name)
    # The very positions of the method, by way of a file: to the last digit.
    np.savez(tmp_path / "own.npz", positions=own.positions, fps=30.0, quasi_static=own.positions)
    assert measured_of(scene, tmp_path / "own.npz") == expected
    # Without its answer to poses held still, what needs that is left out and nothing else.
    np.savez(tmp_path / "less.npz", positions=own.positions)
    less = measured_of(scene, tmp_path / "less.npz")
    assert {name.partition("/")[0] for name in expected.keys() - less.keys()} <= {"dynamics"}
    assert "dynamics/quasi_static_difference" not in less and less.items() <= expected.items()


def test_the_motion_as_amass_has_it_is_the_same_motion(home):
    folder, _ = home
    y_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    turned = skinned_elsewhere(folder, "motion_amass.npz", y_up)
    assert np.abs(turned - skinned_elsewhere(folder, "motion_smpl.npz", np.eye(3))).max() < 1e-12
    read = read_motion(folder / "motion_amass.npz", MotionFileOptions())
    assert np.abs(read.poses[:, :20] - swaying(12).poses[:, :20]).max() < 1e-12 and read.fps == 30.0


def test_what_is_exported_is_the_scene(home):
    folder, scene = home
    cloth, obstacle = arrays(folder / "cloth.npz"), arrays(folder / "obstacle.npz")
    assert np.array_equal(cloth["start_positions"], scene.start) and np.array_equal(
        cloth["masses"], scene.cloth.masses
    )
    assert np.array_equal(obstacle["positions"], scene.obstacle.positions)
    rest = read_mesh(folder / "rest.obj")
    assert np.array_equal(rest.positions, scene.cloth.rest_positions)
    assert np.array_equal(rest.faces, scene.cloth.faces)
    facts = json.loads((folder / "scene.json").read_text())
    assert facts["material"]["young_modulus"] == 70e3 and facts["energies"]["collision"]["margin_m"] == 0.004
    assert (facts["fps"], facts["frames"], facts["warm_up_frames"]) == (30.0, 12, 2)
    text = (folder / "README.txt").read_text()
    assert all(path.name in text for path in folder.iterdir() if path.name != "README.txt")
    assert not list(folder.parent.glob(".*part"))


def exported(folder: Path):
    """The class of docs/examples, as it stands there, opened on an exported folder."""
    names: dict = {}
    exec((Path(__file__).parents[2] / "docs" / "examples" / "exported_energies.py").read_text(), names)
    return names["Exported"](folder)


@pytest.mark.parametrize("name", ["skinning", "simulation", "sunk"])
def test_energies_and_curvature_follow_from_the_exported_files_alone(home, name):
    """In numpy, by the example of the documents, which shares nothing with the project's code."""
    folder, scene = home
    if name == "sunk":  # vertices of all depths, some of them below skin that they must not meet
        positions = skinned_elsewhere(folder, "motion_smpl.npz", np.eye(3))
        positions += np.random.default_rng(0).normal(0, 0.03, positions.shape)
    else:
        method = find_method(name).make(models=Path(), seed=0)
        method.prepare(scene)
        positions = method.run().positions
    ours, files = energy_series(scene, [positions])[0], exported(folder)
    curvature = curvature_series(positions, scene.cloth.faces).means()
    for frame in (0, 2, 7):
        x, last, last_but_one = (positions[max(frame - i, 0)] for i in range(3))
        found = {
            "strain": files.strain(x), "bending": files.bending(x), "gravity": files.gravity(x, frame),
            "inertia": files.inertia(x, last, last_but_one) if frame > 1 else 0.0,
            "collision": files.collision(x, frame),
        }  # fmt: skip
        assert found.keys() | {"total"} == ours.keys() and (name != "sunk" or found["collision"] > 0)
        for term, value in found.items():
            np.testing.assert_allclose(value, ours[term][frame], rtol=1e-10, err_msg=f"{term}, {frame}")
        np.testing.assert_allclose(sum(found.values()), ours["total"][frame], rtol=1e-10)
        np.testing.assert_allclose(files.mean_curvature(x), curvature[frame], rtol=1e-10)


def test_a_uv_of_corners_is_written_into_the_mesh(tmp_path):
    positions, faces = np.eye(3), np.array([[0, 1, 2]])
    write_obj(tmp_path / "a.obj", positions, faces, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]]))
    assert (tmp_path / "a.obj").read_text().endswith("vt 0.0 0.5\nf 1/1 2/2 3/3\n")


def test_scenes_without_a_body_are_exported_too(tmp_path, capsys):
    assert export.main(["flag", "--preset", "smoke", "-o", str(tmp_path / "flag"), "--reference"]) == 0
    cloth = arrays(tmp_path / "flag" / "cloth.npz")
    assert cloth["pin_positions"].shape == (10, 7, 3) and len(cloth["pins"]) == 7
    assert not (tmp_path / "flag" / "obstacle.npz").exists()
    reference = Trajectory.load(tmp_path / "flag" / "reference.vtkhdf")
    assert np.array_equal(arrays(tmp_path / "flag" / "reference.npz")["positions"], reference.positions)
    assert export.main(["flag", "--preset", "smoke", "-o", str(tmp_path / "flag")]) == 2
    assert export.main(["flags", "--preset", "smoke", "-o", str(tmp_path / "other")]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["flag"]
    assert capsys.readouterr().err.count("\n") == 2
