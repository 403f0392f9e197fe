"""Roll-outs of others: read from what the field writes, judged only where they belong to the scene."""

from __future__ import annotations

import pickle
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.external import roll_out_files
from benchmarks.external.roll_out_files import (
    RollOutFileError,
    RollOutOption,
    StoredRollOut,
    parse_roll_out,
    read_roll_out,
)
from benchmarks.methods.outside import entry_of
from benchmarks.metric import Estimate, RollOut
from benchmarks.plan.study import option, read_study
from benchmarks.runner.cells import judge
from benchmarks.runner.measurements import measure_roll_out
from benchmarks.scenes.from_roll_out import declare_scene
from benchmarks.timing import Reading
from reference_sim import Trajectory
from reference_sim.trajectory import (
    SIGNATURE,
    TrajectoryError,
    read_point_cache,
    write_obj,
    write_point_cache,
)
from tests.benchmarks.runner.tasks_by_hand import grouped, prepared, small_scene, thirds

SCENE = small_scene("hanging_sheet", cells=6, frames=8)
FACES = SCENE.cloth.faces
RANDOM = np.random.default_rng(7)
# Falls, sways and crumples a little: some numbers in every row.
TIME = np.arange(SCENE.frames)[:, None, None] * SCENE.dt
X = SCENE.start + [0.0, -1.0, 0.3] * TIME**2 + 2e-4 * TIME * RANDOM.normal(size=(SCENE.frames, 49, 3))


def point_cache_header(frames: int, vertices: int) -> bytes:
    return SIGNATURE + struct.pack("<iiffi", 1, vertices, 0.0, 1.0, frames)


def write(kind: str, folder: Path, positions: np.ndarray = X, faces: np.ndarray = FACES) -> str:
    """A roll-out in a format of the field; the path to name."""
    path = folder / f"mine.{kind}"
    trajectory = Trajectory(positions, faces, np.arange(len(positions)) * SCENE.dt)
    if kind == "vtkhdf":
        trajectory.save(path)
    elif kind == "npz":
        np.savez(path, positions=positions, faces=faces, fps=30.0)
    elif kind == "pkl":
        obstacle = np.zeros((len(positions), 4, 3))
        path.write_bytes(
            pickle.dumps({"pred": positions, "cloth_faces": faces, "obstacle": obstacle, "meta": 1})
        )
    elif kind == "pc2":
        write_point_cache(path, trajectory)
    elif kind == "pc16":
        path.write_bytes(point_cache_header(*positions.shape[:2]) + positions.astype("<f2").tobytes())
    else:
        path = folder / kind
        path.mkdir()
        for frame, x in enumerate(positions):
            write_obj(path / f"cloth_{frame}.obj", x, faces)
    return str(path)


def stored(path: str, **stated):
    """The method of the file, and its entry."""
    entry = entry_of(RollOutOption("mine", path, **stated), SCENE.name)
    return prepared(entry, SCENE), entry


def rows(path: str, **stated) -> dict:
    """Every number that is measured of the file, in suite speed."""
    method, entry = stored(path, **stated)
    group = grouped(SCENE, {})
    group.roll_outs.append(RollOut(group, entry, method.run(), suites=("speed",)))
    return measure_roll_out(group.roll_outs[0])[0]


def direct(positions: np.ndarray) -> dict:
    """The numbers of positions that were in no file."""
    return measure_roll_out(grouped(SCENE, {"skinning": positions}, suites=("speed",)).roll_outs[0])[0]


@pytest.mark.parametrize("kind", ["vtkhdf", "npz", "pkl", "obj"])
def test_formats_of_float64_give_the_rows_of_the_positions_to_the_last_digit(kind, tmp_path):
    expected = direct(X)
    assert rows(write(kind, tmp_path)) == expected
    assert {"energy/strain", "energy/bending_printed", "gap/energy", "curvature/mean"} <= set(expected)


def test_formats_of_less_precision_give_the_rows_of_the_rounded_positions(tmp_path):
    narrow = X.astype(np.float32)
    expected = direct(narrow.astype(np.float64))
    assert rows(write("pc2", tmp_path)) == rows(write("npz", tmp_path, narrow)) == expected
    assert rows(write("pkl", tmp_path, narrow)) == expected != direct(X)
    assert read_roll_out(tmp_path / "mine.pc2").dtype == "float32"
    half = read_point_cache(write("pc16", tmp_path))
    assert half.dtype == np.float16 and np.array_equal(half, X.astype(np.float16))
    (tmp_path / "cloth.mdd").write_bytes(b"")
    with pytest.raises(TrajectoryError, match=r"cloth\.mdd: a point cache is named \.pc2 or \.pc16"):
        read_point_cache(tmp_path / "cloth.mdd")


# --- what does not belong to the scene -------------------------------------------------------------------

ORDER = RANDOM.permutation(49)
PLACE = np.argsort(ORDER)
CENTRES, THIRDS = thirds(X, FACES)
Z_UP = 100.0 * X[..., [0, 2, 1]] * [1.0, -1.0, 1.0]  # (x, -z, y) in centimetres
PLACED = "write metres, y up .* world coordinates, and the vertices in the order"
OTHER = {"other_mesh": True}
WRONG = {
    "centimetres": (100.0 * X, FACES, {}, PLACED),
    "z up": (Z_UP, FACES, {"units": "cm"}, PLACED),
    "reordered": (X[:, ORDER], PLACE[FACES], {}, "triangles join other vertices"),
    "reordered, without faces": (X[:, ORDER], None, {}, PLACED),
    "a vertex less": (X[:, 1:], None, {}, "has 48 vertices, the cloth of hanging_sheet 49"),
    "a frame less": (X[1:], None, {}, "has 7 frames, the scene has 8"),
    "another rate": (X, None, {"fps": 60.0}, "has 60 frames a second, the scene 30"),
    "half a turn": (X * [-1.0, 1.0, -1.0], FACES, {}, PLACED),
    "another mesh, no faces": (CENTRES, None, OTHER, "has no triangles: add those of its own mesh"),
    "vertex 49": (X, FACES + 1, {}, "faces names vertex 49 of 49"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_does_not_belong_to_the_scene_is_refused_with_the_remedy(name, tmp_path):
    positions, faces, stated, remedy = WRONG[name]
    fields = {} if faces is None else {"faces": faces}
    np.savez(tmp_path / "mine.npz", positions=positions, **fields)
    with pytest.raises(RollOutFileError, match=remedy) as refused:
        rows(str(tmp_path / "mine.npz"), **stated)
    assert str(refused.value).count("mine.npz") == 1 and "\n" not in str(refused.value)


def test_unit_and_axis_are_mended_when_they_are_given(tmp_path):
    expected = direct(X)
    metrics = rows(write("npz", tmp_path, Z_UP), units="cm", up="z")
    assert metrics.keys() == expected.keys()
    for name in expected:
        ours, theirs = ([*of[name][:2], *dict(of[name].moved).values()] if isinstance(of[name], Estimate)
                        else of[name] for of in (metrics, expected))  # fmt: skip
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-12)


def test_a_roll_out_that_explodes_is_a_result_and_one_of_another_motion_is_not(monkeypatch):
    way = np.linspace(0.0, 2.0, SCENE.frames)[:, None, None] * [0.0, 0.0, 1.0]
    carried = SCENE.start + way
    monkeypatch.setattr(roll_out_files, "expected_positions", lambda scene: carried)
    late = carried.copy()
    for frame, value in ((5, np.inf), (2, np.nan)):
        late[frame:] = value
        roll_out_files.fit_to_scene(StoredRollOut(late), SCENE)
    with pytest.raises(RollOutFileError, match=r"from frame 1 on its centre lies .* the body carries"):
        roll_out_files.fit_to_scene(StoredRollOut(SCENE.start - way), SCENE)


def test_another_mesh_of_the_same_surface_is_compared_as_a_surface_alone(tmp_path):
    np.savez(tmp_path / "mine.npz", positions=100.0 * CENTRES, faces=THIRDS, quasi_static=CENTRES)
    method, entry = stored(str(tmp_path / "mine.npz"), units="cm", other_mesh=True)
    trajectory = method.run()
    assert method.quasi_static() is None
    for other_mesh, status in ((True, "ok"), (False, "failed")):
        declared = replace(entry, other_mesh=other_mesh)
        assert judge(trajectory, Reading(0.0), SCENE, declared)[0] == status
    group = grouped(SCENE, {"simulation": X})
    metrics = measure_roll_out(RollOut(group, entry, trajectory, suites=("speed",)))[0]
    assert set(metrics) == {"surface/chamfer", "surface/normals"} and metrics["surface/chamfer"] < 1e-9


def test_an_option_says_everything_of_a_roll_out():
    name, table = parse_roll_out("mine=out/{scene}.pc2,units=cm,up=z,fps=60,other-mesh,ms=2.2")
    option = RollOutOption(name, **table)
    assert option == RollOutOption("mine", "out/{scene}.pc2", "cm", "z", 60.0, True, 2.2)
    assert option.path_for("tshirt/kick") == "out/tshirt-kick.pc2"
    assert entry_of(option, "tshirt/kick") is None  # there is no file for that scene
    assert parse_roll_out("out/my run_{scene}.npz,up=z", named=False)[0] == "my-run"  # the file's


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("mine", "NAME=FILE"),
        ("m=a.npz,units=inch", "choose from m, cm, mm"),
        ("m=a.npz,ms=0", "positive"),
        ("body=a.npz", "is 'body' or ends in 'quasi-static': give another, as mine=FILE"),
        ("x-quasi-static=a.npz", "ends in 'quasi-static'"),
    ],
)
def test_a_wrong_option_is_one_line(text, hint):
    with pytest.raises(ValueError, match=hint) as refused:
        name, table = parse_roll_out(text)
        read_study(options=[option("rollouts", {name: table})])
    assert "\n" not in str(refused.value)


# --- scenes that a roll-out brings itself --------------------------------------------------------------

STANDING = np.array(
    [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.2, 0.0, 0.3], [0.2, 1.7, 0.1]]
)  # [m], head last
TETRAHEDRON = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])


def declare(folder: Path, rest_scale: float):
    """The scene of a sheet that stays where it starts, beside a body that stands there."""
    positions = np.repeat(SCENE.start[None], SCENE.frames, axis=0)
    obstacle = np.repeat(STANDING[None], SCENE.frames, axis=0)
    np.savez(
        folder / "pred.npz", positions=positions, faces=FACES, obstacle=obstacle,
        obstacle_faces=TETRAHEDRON,
    )  # fmt: skip
    write_obj(folder / "rest.obj", rest_scale * SCENE.cloth.rest_positions, FACES)
    option = RollOutOption("pred", str(folder / "pred.npz"))
    return declare_scene(option, str(folder / "rest.obj"))


@pytest.mark.parametrize("rest_scale", [100.0, 0.01])
def test_a_rest_mesh_in_another_unit_is_refused(rest_scale, tmp_path):
    message = r"rest\.obj: .*pred\.npz .*one unit and order of vertices"
    with pytest.raises(RollOutFileError, match=message) as refused:
        declare(tmp_path, rest_scale).build()
    assert "\n" not in str(refused.value)
    for scale in (1.0, 0.5, 2.0):  # cloth may start stretched, or on a mesh that was scaled a little
        assert declare(tmp_path, scale).build().frames == SCENE.frames
