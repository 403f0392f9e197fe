"""The command python -m reference_sim.simulate, from files to files."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import pytest

from reference_sim import Trajectory, simulate
from reference_sim.simulate_command import EXAMPLES, REPLACED, choose_pins, main, make_parser
from tests.reference_sim.meshes import grid, sphere

ROOT = Path(__file__).resolve().parents[2]
SHEET, FACES = grid(6, 6, width=0.4, depth=0.4)
SHEET = SHEET + np.array([-0.2, 0.0, -0.2])
BALL, BALL_FACES = sphere(2, 0.15)


def write(path: Path | str, positions, faces) -> str:
    Path(path).parent.mkdir(exist_ok=True)
    meshio.write(path, meshio.Mesh(positions, [("triangle", np.asarray(faces, dtype=np.int32))]))
    return str(path)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a sheet, and a ball that moves for 4 frames below it."""
    monkeypatch.chdir(tmp_path)
    write("sheet.obj", SHEET, FACES)
    for k in range(4):
        write(f"ball/ball_{k}.obj", BALL + np.array([0.01 * k, -0.156, 0]), BALL_FACES)
    return tmp_path


def test_every_example_of_the_help_is_understood():
    commands = [line.split() for line in EXAMPLES.replace("\\\n", " ").splitlines() if "python" in line]
    assert len(commands) >= 4 and all(
        words[:3] == ["python", "-m", "reference_sim.simulate"] for words in commands
    )
    for words in commands:
        make_parser().parse_args([word.strip("'") for word in words[3:]])


def test_pins_by_index_place_and_height():
    tall = np.column_stack([np.arange(5.0), np.linspace(0, 2, 5), np.zeros(5)])
    for which, chosen in ((None, []), ("3, 1", [3, 1]), ("top", [4]), ("x > 1.5, y<=1.5", [2, 3])):
        assert choose_pins(which, tall).tolist() == chosen


def run_module(*arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=environment)


def test_an_import_of_the_command_leaves_the_function_where_it_is():
    code = "import reference_sim.simulate as a; from reference_sim import simulate as b; print(a is b, b)"
    assert run_module("-c", code).stdout.startswith("True <function simulate at")


def test_as_a_module_of_its_own(folder):
    arguments = ["sheet.obj", "--pins", "0,6", "--frames", "3", "-o", "out.vtkhdf"]
    done = run_module("-m", "reference_sim.simulate", *arguments)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("frames     3 of 3; 2 of 2 steps converged, worst relative residual ")
    assert "frame/s" in done.stderr  # the bar
    assert Trajectory.load("out.vtkhdf").frames == 3


def test_garment_on_a_moving_obstacle(folder, capsys):
    arguments = ["sheet.obj", "--obstacle", "ball", "--obstacle-rest", "ball/ball_0.obj"]
    assert main([*arguments, "--friction", "0.3", "-o", "out.vtkhdf"]) == 0
    trajectory = Trajectory.load("out.vtkhdf")
    assert (trajectory.status, trajectory.frames) == ("converged", 4)  # as many as the ball has
    assert trajectory.frame_fields["energy/collision"][-1] > 0
    assert "energy/friction" in trajectory.frame_fields
    out = capsys.readouterr().out
    for expected in (
        "frames     4 of 4; 3 of 3 steps converged",
        f"strain {trajectory.frame_fields['energy/strain'][-1]:.3g}",
        "wrote      out.vtkhdf",
    ):
        assert expected in out
    assert sorted(os.listdir()) == ["ball", "out.vtkhdf", "sheet.obj"]


def test_units_and_up_axis_do_not_change_the_physics(folder):
    turned = 100 * SHEET[:, [0, 2, 1]] * [1, -1, 1]  # z up, centimetres
    write("cm.ply", turned, FACES)
    for k in range(4):
        x = BALL + np.array([0.01 * k, -0.156, 0])
        write(f"cm/ball_{k}.ply", 100 * x[:, [0, 2, 1]] * [1, -1, 1], BALL_FACES)
    assert main(["sheet.obj", "--obstacle", "ball", "-o", "m.vtkhdf"]) == 0
    axes = ["--units", "cm", "--up", "z"]
    assert main(["cm.ply", "--obstacle", "cm/*.ply", *axes, "-o", "cm.vtkhdf"]) == 0
    np.testing.assert_allclose(
        Trajectory.load("cm.vtkhdf").positions, Trajectory.load("m.vtkhdf").positions, atol=1e-5
    )


def test_options_reach_the_simulation(folder, capsys, monkeypatch):
    pytest.importorskip("ipctk")
    Path("silk.toml").write_text("young_modulus = 5e4\nthickness = 0.001\n")
    arguments = ["sheet.obj", "--pins", "x<-0.19", "--dt", "1/60", "--frames", "3", "--material", "silk.toml"]
    contact = ["--self-contact", "--friction", "0.3", "--obstacle", "ball"]
    assert main([*arguments, *contact, "-o", "a.vtkhdf"]) == 0
    made = Trajectory.load("a.vtkhdf").provenance
    assert made["dt_s"] == 1 / 60
    assert list(made["material"].values())[:4] == [5e4, 0.485, 0.001, 426.0]
    terms = made["terms"]
    assert terms["barrier"] and terms["collision"] and terms["friction"]["coefficient"] == 0.3
    monkeypatch.setitem(sys.modules, "ipctk", None)
    assert main(["sheet.obj", "--self-contact", "-o", "b.vtkhdf"]) == 2
    assert "needs the package ipctk: pip install ipctk" in capsys.readouterr().err


def test_not_converged_is_status_1(folder, capsys, monkeypatch):
    monkeypatch.setattr("reference_sim.time_loop.simulate", partial(simulate, max_iterations=1))
    assert main(["sheet.obj", "--pins", "0", "--frames", "4", "-o", "a.vtkhdf"]) == 1
    out = capsys.readouterr().out
    assert re.search(r"frames     4 of 4; 0 of 3 steps.*\nstatus     max_iterations: frame 1: ", out)


def test_suspicious_but_possible_input_is_noted(folder, capsys):
    write("inside.obj", SHEET + np.array([0, -0.05, 0]), FACES)
    write("mm.obj", 1000 * SHEET + np.array([0, 900, 0]), FACES)
    for name in ("inside", "mm"):
        arguments = [f"{name}.obj", "--obstacle", "ball/ball_0.obj", "--frames", "1", "-o", f"{name}.vtkhdf"]
        assert main(arguments) == 0
    out = capsys.readouterr().out
    assert re.search(r"note: the garment starts with \d+ vertices in the obstacle", out)
    assert "note: mm.obj measures 400 m: is --units m right?" in out
    assert "m from the obstacle: same units and up axis?" in out


BAD = {
    "no garment": (["nix.obj"], "nix.obj: no such file"),
    "open obstacle": (
        ["sheet.obj", "--obstacle", "sheet.obj"],
        "sheet.obj: obstacle is not closed: edge (0, 1)",
    ),
    "rest of another": (
        ["sheet.obj", "--obstacle", "ball", "--obstacle-rest", "sheet.obj"],
        "sheet.obj: other faces than ball: export both from one mesh",
    ),
    "rest alone": (["sheet.obj", "--obstacle-rest", "sheet.obj"], "need an --obstacle"),
    "friction alone": (["sheet.obj", "--friction", "0.3"], "need an --obstacle"),
    "number": (["sheet.obj", "--dt", "1e999999/0"], "argument --dt: '1e999999/0' is no number from 0 on"),
    "dt": (["sheet.obj", "--dt", "0"], "Inertia dt = 0.0: must be a finite number of seconds"),
    "count of many digits": (["sheet.obj", "--frames", "1" * 5000], "is no whole number from 1 to"),
    "pin out of range": (["sheet.obj", "--pins", "3,49"], "--pins 49: the garment has vertices 0..48"),
    "pins in nothing": (
        ["sheet.obj", "--pins", "y>3"],
        "--pins 'y>3': no vertex in this box; the garment spans",
    ),
    "pins unclear": (["sheet.obj", "--pins", "left"], "--pins 'left': give indices, 'top', or a box"),
    "all pinned": (["sheet.obj", "--pins", "top"], "holds every vertex of sheet.obj: choose fewer"),
    **{
        f"former {option}": (["sheet.obj", option], f"{option} is no option any more: ")
        for option in REPLACED
    },
}
PLACES = {
    "out.obj": "out.obj: the trajectory ends in .vtkhdf",
    "o" * 300 + ".vtkhdf": "File name too long",
    "there/a.vtkhdf": "there: no such folder to write a.vtkhdf in",
    "ball.vtkhdf": "ball.vtkhdf exists: remove it, or choose another name",
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_nothing_is_written(folder, refused, case):
    arguments, message = BAD[case]
    assert refused(message, main, [*arguments, "-o", "out.vtkhdf"]).startswith("simulate: ")


@pytest.mark.parametrize("place", PLACES)
def test_a_place_that_serves_no_output_is_refused(folder, refused, place):
    Path("ball.vtkhdf").touch()
    refused(PLACES[place], main, ["sheet.obj", "-o", place])


def test_an_obstacles_trajectory_brings_its_time_between_frames(folder):
    Trajectory(BALL + np.zeros((3, 1, 1)), BALL_FACES, np.arange(3) / 60).save("ball.vtkhdf")
    arguments = ["sheet.obj", "--obstacle", "ball.vtkhdf", "--obstacle-rest", "ball/ball_0.obj"]
    for dt, options in ((1 / 60, []), (1 / 30, ["--dt", "1/30"])):
        Path("a.vtkhdf").unlink(missing_ok=True)
        assert main([*arguments, *options, "-o", "a.vtkhdf"]) in (0, 1)
        assert Trajectory.load("a.vtkhdf").times[1] == pytest.approx(dt)


def test_interrupted_by_hand(folder, capsys, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("reference_sim.time_loop.simulate", interrupt)
    assert main(["sheet.obj", "-o", "out.vtkhdf"]) == 130
    assert "the frames until then" in capsys.readouterr().err
