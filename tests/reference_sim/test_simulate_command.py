"""The command python -m reference_sim.simulate, from files to files."""

from __future__ import annotations

import runpy
import subprocess
import sys

import numpy as np
import pytest

from reference_sim import Trajectory
from reference_sim.files import mesh_files
from reference_sim.trajectory import write_obj
from tests.reference_sim.meshes import grid, sphere

SHEET, FACES = grid(6, 6, width=0.4, depth=0.4)
SHEET -= SHEET.mean(axis=0)
BALL, BALL_FACES = sphere(2, 0.15)


@pytest.fixture
def simulate(tmp_path, monkeypatch):
    """Return a function of the command's words; a sheet and a ball of 3 frames below it lie in the folder."""
    monkeypatch.chdir(tmp_path)
    write_obj(tmp_path / "sheet.obj", SHEET, FACES)
    write_obj(tmp_path / "sheet_cm.obj", 100 * SHEET[:, [0, 2, 1]] * [1, -1, 1], FACES)
    for frame in range(3):
        write_obj(
            tmp_path / f"ball/{frame}.obj", BALL + np.array([0.01 * frame, -0.156, 0.0]), BALL_FACES
        )

    def run(words: str) -> int:
        monkeypatch.setattr(sys, "argv", ["simulate", *words.split()])
        with pytest.raises(SystemExit) as ended:
            runpy.run_module("reference_sim.simulate", run_name="__main__")
        return ended.value.code

    return run


def test_a_sheet_falls_onto_a_moving_ball(simulate, capsys):
    assert simulate("sheet.obj --obstacle ball --obstacle-rest ball/0.obj -o out.vtkhdf") == 0
    result = Trajectory.load("out.vtkhdf")
    assert (result.status, result.frames) == ("converged", 3)
    assert result.frame_fields["energy/collision"][-1] > 0 and "collision" in capsys.readouterr().out


def test_a_pinned_sheet_in_other_units_and_axes_is_the_same(simulate):
    for mesh, out in (("sheet.obj", "m"), ("sheet_cm.obj --units cm --up z", "cm")):
        assert simulate(f"{mesh} --pins 0,6 --frames 3 -o {out}.vtkhdf") == 0
    metres, centimetres = (Trajectory.load(f"{name}.vtkhdf").positions for name in ("m", "cm"))
    np.testing.assert_allclose(centimetres, metres, atol=1e-6)
    assert (metres[-1, [0, 6]] == metres[0, [0, 6]]).all() and metres[-1, :, 1].min() < -0.01


def test_triangles_apart_are_refused_and_hang_as_one_sheet_once_they_are_welded(
    simulate, tmp_path, capsys
):
    write_obj(tmp_path / "soup.obj", SHEET[FACES].reshape(-1, 3), np.arange(FACES.size).reshape(-1, 3))
    assert simulate("soup.obj -o soup.vtkhdf") == 2 and "merge" in capsys.readouterr().err
    for mesh in ("sheet.obj", "soup.obj --weld 0.0002"):
        assert simulate(f"{mesh} --up z --pins top --frames 3 -o {mesh[:4]}.vtkhdf") == 0
    positions = (Trajectory.load(f"{name}.vtkhdf").positions for name in ("shee", "soup"))
    sheet, welded = (x[:, np.lexsort(x[0].T.round(6))] for x in positions)
    np.testing.assert_allclose(welded, sheet, atol=1e-9)


def test_pins_ride_on_an_obstacle_that_moves_below_them_and_stay_elsewhere(simulate, capsys):
    for pins, moved, message in (("24", 0.02, "1 ride on the obstacle"), ("0,6", 0.0, "2 stay in place")):
        assert simulate(f"sheet.obj --pins {pins} --obstacle ball -o at{pins}.vtkhdf") == 0
        x = Trajectory.load(f"at{pins}.vtkhdf").positions[:, [int(pin) for pin in pins.split(",")]]
        np.testing.assert_allclose(x[-1] - x[0], np.tile([moved, 0, 0], (x.shape[1], 1)), atol=1e-12)
        assert f"pins       {message}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("sheet.obj --pins 49 -o a.vtkhdf", "--pins '49': give 'top', or vertices from 0 to 48 as '0,9'"),
        ("sheet.obj -o a.obj", "a.obj: name a new file that ends in .vtkhdf, in a folder that exists"),
        ("sheet.obj --obstacle ball --obstacle-rest sheet.obj -o a.vtkhdf", "export both from one mesh"),
        ("sheet.obj --obstacle sheet.obj -o a.vtkhdf", "sheet.obj: obstacle is not closed"),
        ("sheet.obj --obstacle-rest sheet.obj -o a.vtkhdf", "is a pose of an obstacle: add --obstacle"),
        ("sheet.obj --pins top -o a.vtkhdf", "--pins top: the mesh is level, all of it is its top"),
        ("sheet.obj --weld 0.5 -o a.vtkhdf", "makes a line of triangle 0: weld by less"),
        ("sheet.obj --frames 1 -o a.vtkhdf", "frame 0 is the start: give 2 or more"),
        ("sheet.obj --weld 0 -o a.vtkhdf", "weld=0.0: give a distance above 0"),
        ("sheet.obj --weld nan -o a.vtkhdf", "weld=nan: give a distance above 0"),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_line_and_writes_nothing(simulate, capsys, tmp_path, words, message):
    assert simulate(words) == 2
    error = capsys.readouterr().err
    assert message in error and error.splitlines()[-1].startswith("simulate: ")
    assert not list(tmp_path.glob("a.*"))


def test_a_mesh_that_takes_more_memory_than_there_is_is_refused_at_once(simulate, capsys, monkeypatch):
    monkeypatch.setattr(mesh_files, "BYTES_A_VERTEX", 1e15)
    assert simulate("sheet.obj -o a.vtkhdf") == 2
    assert "has 49 vertices, which take 49000000 GB of memory" in capsys.readouterr().err


def test_an_import_of_the_command_leaves_the_function_where_it_is():
    code = "import reference_sim.simulate as a; from reference_sim import simulate as b; print(a is b, b)"
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert process.stdout.startswith("True <function simulate at")
