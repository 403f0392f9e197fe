"""A scene is exported, made elsewhere and read back: the numbers are those of a run."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from benchmarks import export
from benchmarks.external.roll_out_files import RollOutOption, expected_positions
from benchmarks.external.scene_files import write_motion, write_scene, write_scene_files
from benchmarks.methods import find_method
from benchmarks.methods.outside import entry_of
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics.curvature import curvature_series
from benchmarks.metrics.energy import energy_series
from benchmarks.runner.measurements import measure_roll_out
from benchmarks.scene import Dressed
from benchmarks.scenes import find_scene
from reference_sim import Trajectory
from reference_sim.files.mesh_files import read_mesh
from snug.networks.dressed_body import DressedBody
from tests.benchmarks.runner.tasks_by_hand import assets_of, dressed_scene, prepared, small_scene
from tests.snug.training.dressing import swaying, tube_dress

SLOW = partial(pytest.param, marks=pytest.mark.slow)


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
    write_scene(folder, declared, scene, preset="smoke", simulation=None)
    return folder, scene


def arrays(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as stored:
        return dict(stored)


def skinned_elsewhere(folder: Path) -> np.ndarray:
    """Linear blend skinning from the exported files alone."""
    inputs, moved = arrays(folder / "skinning.npz"), arrays(folder / "motion_smpl.npz")
    joints, parents = inputs["joints"], inputs["parents"]
    frames = len(moved["poses"])
    vectors = moved["poses"].reshape(frames, -1, 1, 3)
    local = expm(np.cross(np.eye(3), vectors))  # the matrix exponential turns them into rotations
    world, at = np.empty((frames, 24, 3, 3)), np.empty((frames, 24, 3))
    for j, parent in enumerate(parents):
        if parent < 0:
            world[:, j], at[:, j] = local[:, j], joints[j] + moved["trans"]
        else:
            world[:, j] = world[:, parent] @ local[:, j]
            at[:, j] = at[:, parent] + world[:, parent] @ (joints[j] - joints[parent])
    offsets = inputs["rest_positions"][:, None] - joints  # (V,24,3)
    placed = np.einsum("tjab,vjb->tvja", world, offsets) + at[:, None]
    return np.einsum("vj,tvja->tva", inputs["smoothed_weights"], placed)


def rows_beside(scene, entry) -> dict:
    """The rows of a method beside one that falls, above whose energy nothing has an excess (NaN)."""
    method = prepared(entry, scene)
    trajectory, still = method.run(), method.quasi_static()
    group = SceneRollOuts(scene)
    group.quasi_static = expected_positions(scene)
    fall = Trajectory(group.quasi_static + 0.01, trajectory.faces, trajectory.times)
    static = None if still is None else still.positions
    for one, roll, answer in ((find_method("simulation"), fall, None), (entry, trajectory, static)):
        group.roll_outs.append(RollOut(group, one, roll, suites=("garments",), quasi_static=answer))
    return {
        name: value
        for name, value in measure_roll_out(group.roll_outs[1])[0].items()
        if not np.isnan(value)
    }


def test_skinning_made_elsewhere_and_scored_gives_the_numbers_of_the_method(home, tmp_path):
    folder, scene = home
    expected = rows_beside(scene, find_method("skinning"))
    inside = prepared("skinning", scene).run().positions

    def rows_of_file(**arrays) -> dict:
        np.savez(tmp_path / "mine.npz", **arrays)
        return rows_beside(scene, entry_of(RollOutOption("mine", str(tmp_path / "mine.npz")), scene.name))

    elsewhere = skinned_elsewhere(folder)
    assert np.abs(elsewhere - inside).max() < 1e-6  # the method computes in float32
    metrics = rows_of_file(positions=elsewhere, fps=30.0, quasi_static=elsewhere)
    assert metrics.keys() == expected.keys() and len(metrics) > 20
    for name, value in expected.items():
        np.testing.assert_allclose(metrics[name], value, rtol=2e-3, atol=2e-5, err_msg=name)
    # The very positions of the method, by way of a file: to the last digit.
    assert rows_of_file(positions=inside, fps=30.0, quasi_static=inside) == expected
    # Without its answer to poses held still, what needs that is left out and nothing else.
    rows = rows_of_file(positions=inside)
    assert {name.partition("/")[0] for name in expected.keys() - rows.keys()} <= {"dynamics"}
    assert "dynamics/quasi_static_difference" not in rows and rows.items() <= expected.items()


TENSORFLOW = """
from types import SimpleNamespace

import numpy as np

float32 = np.float32
cast = np.asarray
zeros = np.zeros
SHAPES = [(1, 1, 72), (1, 1, 3), (1, 1, 10), *[(1, 256)] * 4, (1, 1, 3), BODY, (1, 24, 4, 4), BODY, BODY]


def load(path):
    cloth = np.load(path + "/cloth.npz")

    def network(inputs):
        assert [array.shape for array in inputs] == SHAPES
        assert {str(array.dtype) for array in inputs} == {"float32"}
        assert np.allclose(np.linalg.norm(inputs[11], axis=2), 1.0, atol=1e-5)
        matrices = np.einsum("vj,jab->vab", cloth["weights"], inputs[9][0])
        skinned = np.einsum("vab,vb->va", matrices[:, :3, :3], cloth["rest"]) + matrices[:, :3, 3]
        moving = 0.001 * inputs[3][0, 0] * inputs[1][0]
        return (skinned + inputs[7][0] + moving)[None], [state + 1 for state in inputs[3:7]]

    return network


saved_model = SimpleNamespace(load=load)
"""


def test_the_authors_network_is_given_what_it_reads_in_its_order(home, tmp_path):
    folder, _ = home
    inputs, motion = arrays(folder / "skinning.npz"), arrays(folder / "motion_smpl.npz")
    body = (1, *arrays(folder / "obstacle.npz")["positions"].shape[1:])
    (tmp_path / "tensorflow.py").write_text(TENSORFLOW.replace("BODY", str(body)))
    np.savez(tmp_path / "cloth.npz", weights=inputs["smoothed_weights"], rest=inputs["rest_positions"])
    script = Path(__file__).parents[3] / "docs" / "examples" / "authors_snug.py"
    command = [sys.executable, str(script), str(tmp_path), str(folder), str(tmp_path / "out.npz")]
    subprocess.run(command, check=True, env=os.environ | {"PYTHONPATH": str(tmp_path)})
    written = arrays(tmp_path / "out.npz")
    velocities = np.diff(motion["trans"], axis=0, prepend=motion["trans"][:1]) * written["fps"]
    moving = 0.001 * np.arange(len(velocities))[:, None, None] * velocities[:, None]
    expected = skinned_elsewhere(folder) + moving
    assert np.abs(written["positions"] - expected).max() < 1e-5


def test_what_is_exported_is_the_scene(home, tmp_path):
    folder, scene = home
    cloth, rest = arrays(folder / "cloth.npz"), read_mesh(folder / "rest.obj")
    for written, value in (
        (cloth["start_positions"], scene.start), (cloth["masses"], scene.cloth.masses),
        (arrays(folder / "obstacle.npz")["positions"], scene.obstacle.positions),
        (rest.positions, scene.cloth.rest_positions), (rest.faces, scene.cloth.faces),
    ):  # fmt: skip
        assert np.array_equal(written, value)
    facts = json.loads((folder / "scene.json").read_text())
    assert facts["material"]["young_modulus"] == 70e3
    assert facts["energies"]["collision"]["margin_m"] == 0.004
    assert (facts["fps"], facts["frames"], facts["warm_up_frames"]) == (30.0, 12, 2)
    text = (folder / "README.txt").read_text()
    assert all(path.name in text for path in folder.iterdir() if path.suffix in (".npz", ".json"))
    assert not list(folder.parent.glob(".*part"))
    body, dressed = scene.dressed.body, dataclasses.replace(scene.dressed, betas=np.ones(10))
    write_scene_files(tmp_path, dataclasses.replace(scene, dressed=dressed), facts)
    assert np.array_equal(arrays(tmp_path / "obstacle.npz")["rest_positions"], body.rest_vertices())


def exported(folder: Path):
    """The class of docs/examples, as it stands there, opened on an exported folder."""
    names: dict = {}
    exec((Path(__file__).parents[3] / "docs" / "examples" / "exported_energies.py").read_text(), names)
    return names["Exported"](folder)


@pytest.mark.parametrize("name", ["simulation", *map(SLOW, ("skinning", "sunk", "behind"))])
def test_energies_and_curvature_follow_from_the_exported_files_alone(home, name):
    """In numpy, by the example of the documents, which shares nothing with the project's code."""
    folder, scene = home
    if name == "sunk":  # vertices of all depths, some of them below skin that they must not meet
        positions = np.random.default_rng(0).normal(skinned_elsewhere(folder), 0.03)
    elif name == "behind":  # free, more than 10 cm beyond the skin that it may touch
        positions = skinned_elsewhere(folder) - [0.26, 0.1, 0.23]
    else:
        positions = prepared(name, scene).run().positions
    ours, files = energy_series(scene, [positions])[0], exported(folder)
    curvature = curvature_series(positions, scene.cloth.faces).means()
    for frame in (0, 7):
        x, last, last_but_one = (positions[max(frame - i, 0)] for i in range(3))
        energies = {
            "strain": files.strain(x), "bending": files.bending(x), "gravity": files.gravity(x, frame),
            "inertia": files.inertia(x, last, last_but_one) if frame > 1 else 0.0,
            "collision": files.collision(x, frame),
        }  # fmt: skip
        assert energies.keys() | {"total"} == ours.keys()
        assert name != "sunk" or energies["collision"] > 0
        for term, value in energies.items():
            np.testing.assert_allclose(value, ours[term][frame], rtol=1e-10, err_msg=f"{term}, {frame}")
        np.testing.assert_allclose(sum(energies.values()), ours["total"][frame], rtol=1e-10)
        np.testing.assert_allclose(files.mean_curvature(x), curvature[frame], rtol=1e-10)


def test_scenes_without_a_body_are_exported_too(tmp_path, capsys):
    assert export.main(["flag", "--set", "sizes=smoke", "-o", str(tmp_path / "flag"), "--reference"]) == 0
    cloth = arrays(tmp_path / "flag" / "cloth.npz")
    assert cloth["pin_positions"].shape == (10, 7, 3) and len(cloth["pins"]) == 7
    assert not (tmp_path / "flag" / "obstacle.npz").exists()
    flag, torn = small_scene("flag"), SimpleNamespace(frames=3, status="diverged", reason="torn")
    method = SimpleNamespace(prepare=lambda scene: None, run=lambda: torn)
    with pytest.raises(RuntimeError, match="flag: diverged: torn"):
        write_scene(tmp_path / "torn", find_scene("flag"), flag, preset="smoke", simulation=method)
    reference = Trajectory.load(tmp_path / "flag" / "reference.vtkhdf")
    assert np.array_equal(arrays(tmp_path / "flag" / "reference.npz")["positions"], reference.positions)
    assert export.main(["flag", "--set", "sizes=smoke", "-o", str(tmp_path / "flag")]) == 2
    assert export.main(["flags", "--set", "sizes=smoke", "-o", str(tmp_path / "other")]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["flag"]
    assert capsys.readouterr().err.count("\n") == 2


def test_of_a_part_of_a_motion_the_frames_before_it_are_exported(tmp_path):
    tube, motion = tube_dress(), swaying(20)
    part, before = motion.cut(8, 20), motion.cut(0, 8)
    write_motion(tmp_path, Dressed(tube.body, tube.garment, part, before=before))
    clip = arrays(tmp_path / "motion_smpl.npz")
    whole = np.concatenate([clip["poses_before"], clip["poses"]])
    assert np.array_equal(whole, motion.poses.reshape(20, -1))
    assert np.array_equal(np.concatenate([clip["trans_before"], clip["trans"]]), motion.translations)
    write_motion(tmp_path, Dressed(tube.body, tube.garment, motion))
    assert "poses_before" not in arrays(tmp_path / "motion_smpl.npz")
