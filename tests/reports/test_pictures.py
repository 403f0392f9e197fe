"""Pictures of garments and films: what is rendered, at which frame, by one camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from benchmarks.results.run_folder import RunFolder
from reference_sim import Trajectory
from reference_sim.files.mesh_files import read_mesh
from reference_sim.trajectory import read_point_cache
from reports import film, pictures
from reports.finished_run import read_run
from reports.pictures import Camera, camera_axes, draw_methods, worst_frame
from tests.reports.report_folder import FRAMES, row, run_folder, sheet, write_mesh

SCENE = "tshirt/walk"
STRAINS = {"simulation": 0.1, "skinning": 0.1, "snug": 2.0}
ROWS = [row(SCENE, method, "energy/total", value) for method, value in STRAINS.items()]


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> RunFolder:
    """A simulation that moves, skinning that stands still, and a network that ended early."""
    folder = run_folder(tmp_path_factory.mktemp("run"), ROWS)
    write_mesh(folder.trajectory_path(SCENE, "body"), *sheet(-0.2), {})
    still, faces = sheet(0.0)
    moved = still + np.array([0.0, 0.06, 0.0]) * np.arange(FRAMES)[:, None, None]
    inertia = np.array([0.0, 0.0, 1.0, 5.0, 2.0])
    for method, x in {"simulation": moved, "skinning": still, "snug": still[:3]}.items():
        write_mesh(folder.trajectory_path(SCENE, method), x, faces, {"energy/inertia": inertia[: len(x)]})
    return folder


def test_the_still_has_what_came_to_its_end_at_the_liveliest_frame(run):
    drawing = draw_methods(read_run(run))
    assert drawing.caption.startswith("tshirt: walk: frame 3, where ")
    assert drawing.canvas.get_figwidth() == pytest.approx(2 * pictures.WIDEST, abs=0.1)


def test_the_worst_frame_is_where_the_network_lies_farthest_above_the_reference(run):
    totals = {"simulation": [5, 1, 0], "snug": [6, 4, 1]}
    lines = [(SCENE, name, 0, t / 30, e) for name in totals for t, e in enumerate(totals[name])]
    lines.insert(0, (SCENE, "snug", 1, 2 / 30, 99))  # of a seed that the picture does not show
    frames = pd.DataFrame(lines, columns=["scene", "method", "seed", "seconds", "total"])
    caption = worst_frame(replace(read_run(run), frame_energies=frames)).caption
    assert "frame 1, where SNUG has most energy above the reference, 3 J" in caption
    apart = frames.assign(seconds=frames["seconds"] + (frames["method"] == "snug"))
    assert worst_frame(replace(read_run(run), frame_energies=apart)) is None


def test_a_view_shows_the_nearer_surface_and_what_lies_behind_around_it():
    cloth, faces = sheet(0.1)
    camera = Camera(cloth[0].mean(axis=0), 0.7, 0.0)
    body = pictures.Surface(cloth[0] * [1.0, 1.0, 0.0], faces, (0.0, 0.0, 1.0))
    front = pictures.Surface(cloth[0], faces, (1.0, 0.0, 0.0))
    image, other = pictures.views(
        body, [front, pictures.Surface(cloth[0] - [0, 0, 0.2], faces, (0, 1, 0))], camera, 60, 60
    )
    assert image.shape == (60, 60, 3) and image[0, 0].min() == 1.0  # white around
    assert image[30, 30, 0] > 0.3 > image[30, 30, 2] and other[30, 30, 2] > 0.3 > other[30, 30, 1]
    # A corner of the mesh comes to where the camera says that it is.
    x, y, _ = camera.project(cloth[0])[0]
    column, line = int(30 + 60 * x / camera.height), int(30 - 60 * y / camera.height)
    assert image[line - 2, column + 2, 2] < 0.3 and image[line + 2, column - 2].min() == 1.0


def filmed(run, path, *more) -> int:
    arguments = [str(run.path), "--scene", SCENE, "--methods", "simulation,skinning", "--width", "100"]
    return film.main([*arguments, "-o", str(path), *more])


def test_a_gif_has_every_second_frame_in_its_time_and_the_same_bytes_twice(run, tmp_path):
    paths = [tmp_path / "x.gif", tmp_path / "y.gif"]
    assert [filmed(run, path) for path in paths] == [0, 0]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with Image.open(paths[0]) as picture:
        assert picture.n_frames == 3 and picture.width == 200
        images, lasted = [], 0.0
        for frame in range(picture.n_frames):
            picture.seek(frame)
            lasted += picture.info["duration"]
            images.append(np.asarray(picture.convert("RGB")).astype(int))
    assert lasted == pytest.approx(6 / 30 * 1000, abs=10)
    rows = slice(30, -30)  # without names and time
    half = [(picture[rows, :100], picture[rows, 100:]) for picture in images]
    assert np.abs(half[0][0] - half[0][1]).max() < 40  # both at rest, one light, one camera
    assert np.abs(half[2][0] - half[2][1]).max() > 100


def test_a_picture_is_the_liveliest_frame(run, tmp_path):
    selected = film.select_roll_outs(run, SCENE, ["simulation", "skinning"])
    film.write_frames(tmp_path / "y.png", pictures.draw_frames(selected, 100, pictures.AZIMUTH, [3]), 1.0)
    assert filmed(run, tmp_path / "x.png") == 0
    assert (tmp_path / "x.png").read_bytes() == (tmp_path / "y.png").read_bytes()
    with Image.open(tmp_path / "x.png") as still:
        assert still.n_frames == 1 and not still.is_animated


@pytest.mark.parametrize("rate", [15.0, 16.0 + 1e-12, 30.0, 120.0])
def test_a_gif_takes_its_time_with_at_most_sixteen_frames_a_second(tmp_path, rate):
    frames = np.full((120, 8, 120, 3), film.INK, dtype=np.uint8)
    frames[np.arange(120), :, np.arange(120)] = 255  # a line that moves: no frame is like the one before
    film.write_frames(tmp_path / "x.gif", iter(frames), rate)
    with Image.open(tmp_path / "x.gif") as picture:
        lasted = [picture.info["duration"] for k in range(picture.n_frames) if picture.seek(k) is None]
    assert min(lasted) >= 60 and max(lasted) <= 70
    assert sum(lasted) == pytest.approx(1000 * 120 / rate, abs=10)


def test_a_roll_out_that_ended_early_says_so_and_keeps_its_last_frame(run):
    selected = film.select_roll_outs(run, SCENE, ["simulation", "snug"])
    frames = [np.asarray(frame, int) for frame in pictures.draw_frames(selected, 100, 25.0)]
    assert len(frames) == 5 and list(selected.labels.values()) == ["Simulation", "SNUG"]
    foot = slice(-4 * 12, -2 * 12)  # the last line of a view: letters are 12 pixels high
    ended = [bool((frame[foot, 100:] == film.INK[0]).any()) for frame in frames]
    assert ended == [False] * 3 + [True] * 2
    cloth = selected.series["snug"]
    assert np.array_equal(cloth.positions[-1], pictures.freeze(cloth, 4, (0.0, 0.0, 0.0)).positions)


def test_point_caches_of_garment_and_body_have_their_meshes_beside_them(run, tmp_path, capsys):
    assert filmed(run, tmp_path / "x.pc2", "--methods", "snug") == 0
    assert set(capsys.readouterr().out.split()) == {str(path) for path in tmp_path.iterdir()}
    assert {path.name for path in tmp_path.iterdir()} == {
        f"x_{name}.{ending}" for name in ("snug", "body") for ending in ("pc2", "obj")
    }
    for name in ("snug", "body"):
        mesh = Trajectory.load(run.trajectory_path(SCENE, name))
        assert read_point_cache(tmp_path / f"x_{name}.pc2") == pytest.approx(mesh.positions, abs=1e-7)
        first = read_mesh(tmp_path / f"x_{name}.obj")
        assert first.positions == pytest.approx(mesh.positions[0], abs=1e-7)
        assert np.array_equal(first.faces, mesh.faces)


def test_all_cloths_are_in_sight_of_one_camera_in_every_frame():
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(0.0, 0.2, (40, 1, 3)), axis=0)
    one, other = (walk[:n] + rng.normal(0.0, 0.4, (n, 30, 3)) for n in (40, 25))
    faces = np.array([[0, 1, 2]])
    cloths = {str(n): Trajectory(x, faces, np.arange(len(x)) / 30.0) for n, x in enumerate((one, other))}
    for azimuth in (0.0, 25.0, 180.0, -90.0):
        axes = camera_axes(azimuth)
        assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-12) and np.linalg.det(axes) > 0.0
        centres, half = pictures.camera_path(pictures.SceneRollOuts("", cloths), axes)
        for cloth in (one, np.concatenate([other, np.repeat(other[-1:], 15, axis=0)])):
            wide, high = np.abs((cloth - centres[:, None]) @ axes).max(axis=(0, 1))[:2]
            assert high <= half and wide <= half / pictures.TALL
    front = camera_axes(0.0)
    assert front[:, 0] == pytest.approx([1.0, 0.0, 0.0]) and front[2, 2] > 0.95  # the body faces +z


@pytest.mark.parametrize(
    ("change", "hint"),
    [
        (["--methods", "snug,simulatoin"], "'simulatoin' in tshirt/walk: roll-outs there are simul"),
        (["--scene", "tshirt-walk"], "in tshirt-walk: scenes with roll-outs are tshirt/walk"),
        (["-o", "x.avi"], "x.avi: a film ends in .gif, a picture in .png"),
        (["--width", "7"], "--width is 64 to 2000"),
        (["--azimuth", "nan"], "--azimuth is a finite number"),
        (["--seed", "-3", "--methods", "snug"], "'snug' in tshirt/walk, seed -3: roll-outs there are"),
    ],
)
def test_what_cannot_be_filmed_is_one_line_and_status_2(
    run, tmp_path, monkeypatch, refused, change, hint
):
    monkeypatch.chdir(tmp_path)
    assert refused(hint, filmed, run, "x.gif", *change).startswith("reports.film: ")
