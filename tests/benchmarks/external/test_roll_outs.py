"""Roll-outs of others: read from what the field writes, judged only where they belong to the scene."""

from __future__ import annotations

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest

from benchmarks.external import roll_out_files as files
from benchmarks.external.roll_out_files import (
    FileConventions,
    RollOutFileError,
    RollOutOption,
    read_roll_out,
)
from benchmarks.external.scene_fit import MIRRORS, _check_sides
from benchmarks.methods import find_method
from benchmarks.methods.outside import Stored, entry_of
from benchmarks.metric import Estimate, RollOut, SceneRollOuts
from benchmarks.runner.cells import judge
from benchmarks.runner.measurements import measured
from benchmarks.scenes.from_roll_out import declared
from benchmarks.timing import Reading
from reference_sim import Trajectory
from reference_sim.trajectory import (
    HEADER_SIZE,
    SIGNATURE,
    TrajectoryError,
    read_point_cache,
    write_point_cache,
)
from tests.benchmarks.runner.tasks_by_hand import small_scene, thirds

SCENE = small_scene("hanging_sheet", cells=6, frames=8)
FACES = SCENE.cloth.faces
RANDOM = np.random.default_rng(7)
# Falls, sways and crumples a little: some numbers in every row.
TIME = np.arange(SCENE.frames)[:, None, None] * SCENE.dt
X = SCENE.start + [0.0, -1.0, 0.3] * TIME**2 + 2e-4 * TIME * RANDOM.normal(size=(SCENE.frames, 49, 3))


def write(kind: str, folder: Path, positions: np.ndarray = X, faces: np.ndarray = FACES) -> str:
    """A roll-out in a format of the field; the path to name."""
    path = folder / f"mine.{kind}"
    trajectory = Trajectory(positions, faces, np.arange(len(positions)) * SCENE.dt)
    if kind == "vtkhdf":
        trajectory.save(path)
    elif kind == "npz":
        np.savez(path, positions=positions, faces=faces, fps=30.0)
    elif kind == "pkl":
        held = {
            "pred": positions,
            "cloth_faces": faces,
            "obstacle": np.zeros((len(positions), 4, 3)),
            "meta": 1,
        }
        path.write_bytes(pickle.dumps(held))
    elif kind == "pc2":
        write_point_cache(path, trajectory)
    elif kind == "pc16":
        header = (
            SIGNATURE + np.array([1, positions.shape[1]], "<i4").tobytes() + np.array([0, 1], "<f4").tobytes()
        )
        path.write_bytes(
            header + np.array([len(positions)], "<i4").tobytes() + positions.astype("<f2").tobytes()
        )
    else:
        path = folder / kind
        path.mkdir()
        for frame, x in enumerate(positions):
            lines = [f"v {a!r} {b!r} {c!r}" for a, b, c in x.tolist()]
            lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
            (path / f"cloth_{frame}.obj").write_text("\n".join(lines))
    return str(path)


def rows(path: str, **stated) -> dict:
    """Every number that is measured of the file, in suite speed."""
    option = RollOutOption("mine", path, FileConventions(**stated))
    entry = entry_of(option, SCENE.name)
    method = entry.make(models=Path(), seed=0)
    method.prepare(SCENE)
    return rows_of(method.run(), entry)


def rows_of(trajectory: Trajectory, entry) -> dict:
    group = SceneRollOuts(SCENE, gap_samples=2)
    group.roll_outs.append(RollOut(group, entry, trajectory, suites=("speed",)))
    return measured(group.roll_outs[0])[0]


def direct(positions: np.ndarray) -> dict:
    """The numbers of positions that were in no file."""
    trajectory = Trajectory(positions, FACES, np.arange(len(positions)) * SCENE.dt)
    return rows_of(trajectory, find_method("skinning"))


# --- one set of positions, many formats ------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["vtkhdf", "npz", "pkl", "obj"])
def test_formats_of_float64_give_the_rows_of_the_positions_to_the_last_digit(kind, tmp_path):
    expected = direct(X)
    assert rows(write(kind, tmp_path)) == expected
    assert {
        "energy/strain",
        "energy/bending",
        "energy/bending_printed",
        "gap/energy",
        "curvature/mean",
    } <= set(expected)


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


@pytest.mark.parametrize("kept", ["obstacle", "obstacle_faces"])
def test_half_an_obstacle_is_refused(kept, tmp_path):
    held = {"obstacle": X, "obstacle_faces": FACES}
    np.savez(tmp_path / "mine.npz", positions=X, faces=FACES, **{kept: held[kept]})
    gone = next(name for name in held if name != kept)
    with pytest.raises(RollOutFileError, match=rf"mine.npz: holds half a body: {gone} is absent"):
        declared(RollOutOption("mine", str(tmp_path / "mine.npz"), FileConventions()), "rest.obj")


def test_a_file_is_read_once_until_it_changes(tmp_path, monkeypatch):
    path, read = write("npz", tmp_path), []
    reader = files._READERS[".npz"]
    monkeypatch.setitem(files._READERS, ".npz", lambda path: read.append(path) or reader(path))
    assert read_roll_out(path) is read_roll_out(path) and len(read) == 1
    np.savez(path, positions=2.0 * X, faces=FACES)
    assert np.array_equal(read_roll_out(path).positions, 2.0 * X) and len(read) == 2


def test_hinges_as_printed_are_those_of_the_unscaled_energy():
    from reference_sim.energies import BendHinge

    unscaled = BendHinge(SCENE.cloth, scaling="none")
    mean = np.mean([unscaled.value_and_gradient(x)[0] for x in X[SCENE.warm_up :]])
    metrics = direct(X)
    assert metrics["energy/bending_printed"] == pytest.approx(mean, rel=1e-14)
    assert metrics["energy/bending_printed"] > 2.0 * metrics["energy/bending"]


# --- what does not belong to the scene -------------------------------------------------------------------

ORDER = RANDOM.permutation(49)
PLACE = np.argsort(ORDER)
Z_UP = 100.0 * X[..., [0, 2, 1]] * [1.0, -1.0, 1.0]  # (x, -z, y) in centimetres
WRONG = {
    "centimetres, z up": (Z_UP, FACES, {}, "give units=cm up=z"),
    "z up": (Z_UP, FACES, {"units": "cm"}, "give up=z"),
    "metres called cm": (X, FACES, {"units": "cm"}, "give units=m"),
    "reordered": (X[:, ORDER], PLACE[FACES], {}, "give match-vertices"),
    "reordered, without faces": (X[:, ORDER], None, {}, "give match-vertices"),
    "another mesh": (X, np.roll(FACES, 1) % 49, {"match_vertices": True}, "no vertex can be matched"),
    "a vertex less": (X[:, 1:], None, {}, "has 48 vertices, the cloth of hanging_sheet 49"),
    "a frame less": (X[1:], None, {}, "has 7 frames, .* the scene has 8"),
    "twice the frames": (np.repeat(X, 2, axis=0)[1:], None, {}, "give fps=60"),
    "feet": (X / 0.3048, FACES, {}, "write metres"),
    "elsewhere": (X + np.array([0.0, 1.0, 0.0]), FACES, {}, "world coordinates"),
    "mirrored": (X * [-1.0, 1.0, 1.0], FACES, {}, "m if it is mirrored in x: write the world's x, y, z"),
    "half a turn": (X * [-1.0, 1.0, -1.0], FACES, {}, "turned by 180 degrees about y"),
    "no start": (np.where(TIME == 0.0, np.nan, X), FACES, {}, "is not finite"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_does_not_belong_to_the_scene_is_refused_with_the_remedy(name, tmp_path):
    positions, faces, stated, remedy = WRONG[name]
    given = {} if faces is None else {"faces": faces}
    np.savez(tmp_path / "mine.npz", positions=positions, **given)
    with pytest.raises(RollOutFileError, match=remedy) as refused:
        rows(str(tmp_path / "mine.npz"), **stated)
    assert str(refused.value).count("mine.npz") == 1 and "\n" not in str(refused.value)


def test_a_position_that_is_not_finite_is_named_by_frame_and_vertex(tmp_path):
    exploded = X.copy()
    exploded[5, 11:, 1] = np.inf
    path = write("npz", tmp_path, exploded)
    method = entry_of(RollOutOption("mine", path, FileConventions()), SCENE.name).make(models=Path(), seed=0)
    method.prepare(SCENE)
    assert method.run().status == "diverged"
    assert method.run().reason == f"{path}: frame 5, vertex 11: a position is not finite"


def test_units_axes_and_order_are_mended_when_they_are_given(tmp_path):
    expected = direct(X)
    path = write("npz", tmp_path, Z_UP[:, ORDER], PLACE[FACES])
    metrics = rows(path, units="cm", up="z", match_vertices=True)
    assert metrics.keys() == expected.keys()
    for name in expected:
        ours, theirs = ([*of[name][:2], *dict(of[name].moved).values()] if isinstance(of[name], Estimate)
                        else of[name] for of in (metrics, expected))  # fmt: skip
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("name", MIRRORS)
def test_a_way_that_is_mirrored_or_turned_is_refused_and_one_that_lags_or_explodes_is_not(name):
    time = np.linspace(0.0, 1.0, 40)[:, None]
    expected = np.hstack([time, 0.9 + 0.0 * time, 0.3 + time**2])
    turned = expected.copy()
    turned[:, [0, 2]] = expected[:, [0, 2]] @ np.array(MIRRORS[name], dtype=float)
    with pytest.raises(RollOutFileError, match=f"its way lies .* {name}"):
        _check_sides(turned, expected, "its way")
    late = np.roll(expected, 5, axis=0)
    late[30:] *= [1e9, -1e9, np.inf]
    _check_sides(late, expected, "its way")


CENTRES, THIRDS = thirds(X, FACES)


def test_another_mesh_of_the_same_surface_is_compared_as_a_surface_alone(tmp_path):
    np.savez(tmp_path / "mine.npz", positions=100.0 * CENTRES, faces=THIRDS, quasi_static=CENTRES)
    option = RollOutOption("mine", str(tmp_path / "mine.npz"), FileConventions("cm", other_mesh=True))
    entry = entry_of(option, SCENE.name)
    method = entry.make(models=Path(), seed=0)
    method.prepare(SCENE)
    trajectory = method.run()
    assert "another mesh of 121 vertices" in trajectory.reason and method.quasi_static() is None
    state = judge(trajectory, Reading(0.0), SCENE, truncated=False, other_mesh=True)
    assert state[0] == "ok" and judge(trajectory, Reading(0.0), SCENE, truncated=False)[0] == "failed"
    group = SceneRollOuts(SCENE, gap_samples=2)
    times = np.arange(SCENE.frames) * SCENE.dt
    simulated = RollOut(group, find_method("simulation"), Trajectory(X, FACES, times), suites=("speed",))
    group.roll_outs.append(simulated)
    metrics = measured(RollOut(group, entry, trajectory, suites=("speed",)))[0]
    assert set(metrics) == {"surface/chamfer", "surface/normals"} and metrics["surface/chamfer"] < 1e-9


@pytest.mark.parametrize(
    ("given", "remedy"),
    [({"positions": CENTRES}, "has no triangles: add those of its own mesh"),
     ({"positions": X[:, ORDER], "faces": PLACE[FACES]}, "give match-vertices"),
     ({"positions": 100.0 * CENTRES, "faces": THIRDS}, "give units=cm"),
     ({"positions": CENTRES + 1.0, "faces": THIRDS}, "world coordinates"),
     ({"positions": CENTRES[1:], "faces": THIRDS}, "has 7 frames")],
)  # fmt: skip
def test_another_mesh_has_to_be_in_the_scenes_place_and_time(given, remedy, tmp_path):
    np.savez(tmp_path / "mine.npz", **given)
    with pytest.raises(RollOutFileError, match=remedy):
        rows(str(tmp_path / "mine.npz"), other_mesh=True)
    with pytest.raises(RollOutFileError, match="give one"):
        FileConventions(match_vertices=True, other_mesh=True)


def test_a_rate_that_is_the_scenes_own_up_to_rounding_changes_nothing(tmp_path):
    scene = dataclasses.replace(SCENE, dt=1 / 29.97)
    assert 1 / scene.dt != 29.97
    method = Stored(write("npz", tmp_path), FileConventions(fps=29.97))
    method.prepare(scene)
    assert method.run().reason == ""
    method = Stored(write("npz", tmp_path), FileConventions(fps=30.0 + 1e-9))
    method.prepare(SCENE)
    assert method.run().reason == ""


@pytest.mark.parametrize(("wrong", "says"), [(-1, "faces names vertex -1 of 49"), (60, "vertex 60 of 49")])
def test_the_vertex_that_triangles_name_wrongly_is_said(wrong, says, tmp_path):
    faces = np.where(np.arange(len(FACES))[:, None] == 3, wrong, FACES)
    np.savez(tmp_path / "mine.npz", positions=X, faces=faces)
    with pytest.raises(RollOutFileError, match=says):
        read_roll_out(tmp_path / "mine.npz")


def test_a_file_that_states_another_rate_has_to_be_re_timed(tmp_path):
    halves = np.stack([X[:-1], (X[:-1] + X[1:]) / 2], axis=1).reshape(-1, 49, 3)
    fine = np.concatenate([halves, X[-1:]])
    path = str(tmp_path / "mine.npz")
    np.savez(path, positions=fine, fps=60.0)
    with pytest.raises(RollOutFileError, match=r"states 60 .* give fps=60"):
        rows(path)
    assert rows(path, fps=60.0) == direct(X)  # every second frame, as it is
    np.savez(path, positions=X[::2])
    with pytest.raises(RollOutFileError, match="has 4 frames"):
        rows(path)
    method = Stored(path, FileConventions(fps=15.0))
    with pytest.raises(RollOutFileError, match="scene has 8"):
        method.prepare(SCENE)  # its last frame comes before the scene's
    np.savez(path, positions=np.concatenate([X[::2], 2 * X[-1:] - X[-2:-1]]))
    method.prepare(SCENE)
    assert np.allclose(method.stored.positions[1], (X[0] + X[2]) / 2) and "linear" in method.run().reason
    assert np.array_equal(method.stored.positions[::2], X[::2])


def test_vertices_without_triangles_are_matched_by_the_start_alone(tmp_path):
    at_rest = np.concatenate([SCENE.start[None], X[1:]])
    path = str(tmp_path / "mine.npz")
    np.savez(path, positions=at_rest[:, ORDER])
    assert rows(path, match_vertices=True) == direct(at_rest)
    np.savez(path, positions=at_rest[:, ORDER] + 0.1)
    with pytest.raises(RollOutFileError, match="add its triangles"):
        rows(path, match_vertices=True)


# --- damaged files ---------------------------------------------------------------------------------------


def test_a_size_that_the_file_cannot_hold_is_refused_before_it_is_allocated(tmp_path):
    path = tmp_path / "mine.pc2"
    head = np.array([1, 2**30], "<i4").tobytes() + np.array([0, 1], "<f4").tobytes()
    path.write_bytes(SIGNATURE + head + np.array([2**30], "<i4").tobytes() + bytes(36))
    assert HEADER_SIZE == 32
    with pytest.raises(RollOutFileError, match="the file has 68"):
        read_roll_out(path)
    import h5py

    faces = np.array([[0, 1, 2]])
    Trajectory(np.zeros((2, 3, 3)), faces, np.arange(2) / 30).save(tmp_path / "a.vtkhdf")
    with h5py.File(tmp_path / "a.vtkhdf", "r+") as file:
        del file["VTKHDF/Points"]
        file.create_dataset("VTKHDF/Points", (10**12, 3), chunks=(10**4, 3), dtype="f8")
    with pytest.raises(RollOutFileError, match="more than its file can hold"):
        read_roll_out(tmp_path / "a.vtkhdf")
