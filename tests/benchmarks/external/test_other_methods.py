"""Files for others' public code are read by stubs written from the lines that each README cites."""

from __future__ import annotations

import json
import pickle
import struct
from pickletools import genops

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.external.other_methods import write_for
from benchmarks.external.roll_out_files import RollOutOption
from benchmarks.methods import METHODS, find_method
from benchmarks.methods.outside import entry_of
from reference_sim.files.array_file import read_pickled_arrays
from tests.benchmarks.external.test_exported_scene import arrays, exported, home, rows_beside  # noqa: F401
from tests.benchmarks.runner.tasks_by_hand import prepared, small_scene

NAMES_OF_NUMPY_1 = {"numpy.core.multiarray _reconstruct", "numpy ndarray", "numpy dtype"}


@pytest.fixture(scope="module")
def skinned(home):  # noqa: F811
    """Return the roll-out of skinning, and its rows."""
    method = find_method("skinning")
    return prepared("skinning", home[1]).run().positions, rows_beside(home[1], method)


def check_rows(answer, home, skinned) -> None:  # noqa: F811
    """A roll-out in a format of theirs, in float32, of what skinning answers has skinning's numbers."""
    rows = rows_beside(home[1], entry_of(RollOutOption("theirs", str(answer)), home[1].name))
    assert len(rows) > 20
    for name, value in rows.items():
        np.testing.assert_allclose(value, skinned[1][name], rtol=2e-3, atol=2e-5, err_msg=name)


def test_graph_networks_read_body_and_garment_and_their_answer_is_scored(home, skinned, tmp_path):  # noqa: F811
    scene, folder, other = home[1], tmp_path / "hood", tmp_path / "contourcraft"
    write_for("hood", folder, scene)
    write_for("contourcraft", other, scene)
    for name in ("mesh_sequence.pkl", "garment.pkl"):
        named = {text for op, text, _ in genops((folder / name).read_bytes()) if op.name == "GLOBAL"}
        assert named == NAMES_OF_NUMPY_1
        assert (folder / name).read_bytes() == (other / name).read_bytes()
    # datasets/from_any_pose.py of HOOD a65f75b: lines 651, 660; 175-186, 208; NodeType.HANDLE is 3.
    sequence = read_pickled_arrays(folder / "mesh_sequence.pkl", ("verts", "faces"))
    position, faces = sequence["verts"].transpose(1, 0, 2), sequence["faces"].astype(np.int64)
    cloth = read_pickled_arrays(folder / "garment.pkl", ("vertices", "rest_pos", "faces", "node_type"))
    assert np.array_equal(position[:, 5], scene.obstacle.positions[5].astype(np.float32))
    assert np.array_equal(faces, scene.obstacle.faces) and position.shape[1] == scene.frames
    for key in ("vertices", "rest_pos"):
        assert np.array_equal(cloth[key], scene.start.astype(np.float32))
    assert cloth["node_type"].shape == (150, 1) and not cloth["node_type"].any()
    assert cloth["faces"].dtype == np.int64  # a LongTensor is made of it
    text = (folder / "README.txt").read_text()
    assert "regular_ts: 0.0333333333" in text and "lame_mu_override 23569" in text
    assert "lame_lambda_override 44392.1" in text and "density_override 0.20022," in text
    # What valid_rollout returns (runners/from_any_pose.py:96), written by pickle_dump.
    answer = skinned[0].astype(np.float32)
    fields = {
        "pred": answer,
        "obstacle": position.transpose(1, 0, 2),
        "metrics": {"time": 1.5, "loss": [0.0]},
    }
    fields |= {"cloth_faces": cloth["faces"], "obstacle_faces": faces}
    (tmp_path / "output_m.pkl").write_bytes(pickle.dumps(fields))
    check_rows(tmp_path / "output_m.pkl", home, skinned)


def ncs_matrices(body: dict, rotations: np.ndarray, trans: np.ndarray) -> np.ndarray:
    """Body.forward_kinematics of ncs/model/body.py (T,24,4,4), for rest rotations of zero."""
    local = np.tile(np.eye(4), (24, 1, 1))
    local[:, :3, 3] = body["joints"]
    basis = np.tile(np.eye(4), (len(trans), 24, 1, 1))
    basis[..., :3, :3], basis[:, 0, :3, 3] = rotations, trans
    world = np.empty_like(basis)
    for j, parent in enumerate(body["parents"]):
        above = local[j] if parent < 0 else world[:, parent] @ np.linalg.inv(local[parent]) @ local[j]
        world[:, j] = above @ basis[:, j]
    return world @ np.linalg.inv(local)


def test_neural_cloth_simulation_poses_our_body_and_its_answer_is_scored(home, skinned, tmp_path):  # noqa: F811
    scene, folder = home[1], tmp_path / "ncs"
    write_for("ncs", folder, scene)
    name = scene.name.replace("/", "-")
    settings = json.loads((folder / "ncs" / "configs" / f"{name}.json").read_text())
    assert {0, 3, 16, 17} < set(settings["body"]["input_joints"]) and settings["garment"] == {
        "name": "garment"
    }
    models, data = folder / "body_models" / settings["body"]["model"], settings["data"]
    lists = folder / "ncs" / "dataset" / "txt" / data["dataset"]  # ncs/dataset/data.py:22-24, 36-39
    motions = [line.strip() for line in (lists / data["test"]).read_text().split("\n")]
    assert [(lists / data[mode]).is_file() for mode in ("train", "validation")] == [True, True]
    body, motion = arrays(models / "body.npz"), arrays(folder / "data" / data["dataset"] / motions[0])
    assert {str(body[key].dtype) for key in ("vertices", "rest_pose", "joints")} == {"float32"}
    assert not body["rest_pose"].any() and np.count_nonzero(body["parents"] < 0) == 1 and motion["source"]
    duration, step = (
        (len(motion["poses"]) - 1) / motion["fps"],
        1 / data["fps"],
    )  # ncs/dataset/sequence.py
    times = np.arange(-2 * step, duration + 1e-7, step)[2:]  # ncs/dataset/data.py:91-96
    frames = np.rint(times * motion["fps"]).astype(int)
    assert motion["poses"].shape[-1] == 3 and np.array_equal(frames, np.arange(scene.frames))
    rotations = Rotation.from_rotvec(motion["poses"].reshape(-1, 3)).as_matrix().reshape(-1, 24, 3, 3)
    blended = np.einsum(
        "vj,tjab->tvab", body["blend_weights"], ncs_matrices(body, rotations, motion["trans"])
    )
    posed = np.einsum("tvab,vb->tva", blended[..., :3, :3], body["vertices"]) + blended[..., :3, 3]
    assert np.abs(posed - scene.obstacle.positions).max() < 1e-5
    lines = (models / "garment.obj").read_text().split("\n")  # ncs/utils/IO.py:26-36
    split = {sign: [line.replace(sign, "").split(" ") for line in lines if line.startswith(sign)]
             for sign in ("v ", "f ")}  # fmt: skip
    rest, faces = np.float32(split["v "]), np.array([[int(i) - 1 for i in face] for face in split["f "]])
    assert np.array_equal(faces, scene.cloth.faces)
    # StVKLoss of ncs/loss/losses.py, its face areas twice the areas, is our strain.
    answer, loss = skinned[0], settings["loss"]
    sides = rest[faces[:, 1:]] - rest[faces[:, :1]]
    first, normal = (
        sides[:, 0] / np.linalg.norm(sides[:, 0], axis=1)[:, None],
        np.cross(*sides.swapaxes(0, 1)),
    )
    doubled = np.linalg.norm(normal, axis=1)
    flat = np.stack([first, np.cross(normal / doubled[:, None], first)], axis=1) @ sides.swapaxes(1, 2)
    gradient = (answer[3][faces[:, 1:]] - answer[3][faces[:, :1]]).swapaxes(1, 2) @ np.linalg.inv(flat)
    green = (gradient.swapaxes(1, 2) @ gradient - np.eye(2)) / 2
    density = loss["cloth"]["mu"] * (green**2).sum((1, 2))
    density += loss["cloth"]["lambda_"] / 2 * np.trace(green, axis1=1, axis2=2) ** 2
    assert (doubled * density).sum() == pytest.approx(exported(home[0]).strain(answer[3]), rel=1e-4)
    assert (data["fps"], loss["density"]) == (pytest.approx(30), pytest.approx(0.20022))
    # writePC2 of ncs/utils/IO.py: start 0, rate 1.
    header = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, answer.shape[1], 0, 1, len(answer))
    (tmp_path / "garment.pc2").write_bytes(header + answer.astype(np.float32).tobytes())
    check_rows(tmp_path / "garment.pc2", home, skinned)
    named = (folder / "README.txt").read_text().partition("benchmarks.score ")[2].partition("=")[0]
    assert named not in {method.name for method in METHODS}  # a name that a run takes for another method


def test_a_scene_without_a_body_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"--for hood: it reads a body .* hanging_sheet has not"):
        write_for("hood", tmp_path / "hood", small_scene("hanging_sheet"))
