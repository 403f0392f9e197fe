"""The command python -m reference_sim.simulate, from files to files."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

import reference_sim
from reference_sim import Cloth, Material, Trajectory
from reference_sim.command.simulate_command import main
from reference_sim.energies import StretchStVK
from reference_sim.files.mesh_files import read_mesh
from tests.reference_sim.meshes import grid, sphere
from tests.snug.garments.garment_files import doubled_along, write_obj

ROOT = Path(__file__).resolve().parents[3]
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


def test_the_module_is_a_command_and_the_function_stays_what_it_is():
    with pytest.raises(ImportError, match="is a command"):
        __import__("reference_sim.simulate")
    assert callable(reference_sim.simulate)


def test_as_a_module_of_its_own(folder):
    arguments = ["sheet.obj", "--pins", "0,6", "--frames", "3", "-o", "out.vtkhdf"]
    command = [sys.executable, "-m", "reference_sim.simulate", *arguments]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("frames     3 of 3; 2 of 2 steps converged, worst relative residual ")
    assert "frame/s" in done.stderr  # the bar
    assert Trajectory.load("out.vtkhdf").frames == 3


def test_garment_on_a_moving_obstacle_with_point_cache(folder, capsys):
    arguments = ["sheet.obj", "--obstacle", "ball", "--obstacle-rest", "ball/ball_0.obj", "--region", "0.5"]
    assert main([*arguments, "--friction", "0.3", "--pc2", "out.pc2", "-o", "out.vtkhdf"]) == 0
    trajectory = Trajectory.load("out.vtkhdf")
    assert (trajectory.status, trajectory.frames) == ("converged", 4)  # as many as the ball has
    assert trajectory.frame_fields["energy/collision"][-1] > 0
    assert "energy/friction" in trajectory.frame_fields
    out = capsys.readouterr().out
    for expected in (
        "frames     4 of 4; 3 of 3 steps converged",
        f"strain {trajectory.frame_fields['energy/strain'][-1]:.3g}",
        "stretch    2.39% predicted at the top of 0.4 m",
        "of vertices inside",
        "wrote      out.vtkhdf, out.pc2, out.obj",
    ):
        assert expected in out
    assert read_mesh("out.obj").faces.tolist() == FACES.tolist()
    assert Path("out.pc2").stat().st_size == 32 + 12 * 4 * len(SHEET)
    assert sorted(os.listdir()) == ["ball", "out.obj", "out.pc2", "out.vtkhdf", "sheet.obj"]


def test_units_and_up_axis_do_not_change_the_physics(folder, capsys):
    turned = 100 * SHEET[:, [0, 2, 1]] * [1, -1, 1]  # z up, centimetres
    write("cm.ply", turned, FACES)
    for k in range(4):
        x = BALL + np.array([0.01 * k, -0.156, 0])
        write(f"cm/ball_{k}.ply", 100 * x[:, [0, 2, 1]] * [1, -1, 1], BALL_FACES)
    assert main(["sheet.obj", "--obstacle", "ball", "-o", "m.vtkhdf", "--quiet"]) == 0
    assert (
        main(["cm.ply", "--obstacle", "cm/*.ply", "--units", "cm", "--up", "z", "-o", "cm.vtkhdf", "--quiet"])
        == 0
    )
    np.testing.assert_allclose(
        Trajectory.load("cm.vtkhdf").positions, Trajectory.load("m.vtkhdf").positions, atol=1e-5
    )
    assert capsys.readouterr().out == "note: meshes turned from z up to y up, (x, y, z) -> (x, z, -y)\n"


def test_options_reach_the_simulation(folder):
    arguments = ["sheet.obj", "--pins", "x<-0.19", "--dt", "1/60", "--frames", "3", "--substeps", "2"]
    material = ["--young-modulus", "50e3", "--thickness", "0.001", "--density", "300"]
    material += ["--poisson-ratio", "0.3"]
    bending = ["--bending-stiffness", "1e-5", "--bending-scaling", "none", "--rest-angles", "rest"]
    assert main([*arguments, *material, *bending, "--tolerance", "1e-8", "--quiet", "-o", "a.vtkhdf"]) == 0
    made = Trajectory.load("a.vtkhdf").provenance
    assert (made["dt_s"], made["substeps"], made["options"]["tolerance"]) == (1 / 60, 2, 1e-8)
    assert made["terms"]["bending"]["scaling"] == "none"
    assert list(made["material"].values()) == [50e3, 0.3, 0.001, 300.0, 1e-5]


def test_a_chart_and_a_material_from_files_are_the_rest_shape_and_the_cloth(folder, capsys):
    left = SHEET[FACES].mean(axis=1)[:, 0] < 0
    chart = 0.9 * SHEET[FACES][:, :, [0, 2]] + np.where(left, 7.0, 0.0)[:, None, None]  # two pieces, a seam
    cut = np.flatnonzero(np.abs(SHEET[:, 0]) < 1e-9)
    write_obj(Path("sewn.obj"), *doubled_along(SHEET, FACES, cut), 100 * chart)
    Path("silk.toml").write_text("young_modulus = 5e4\nthickness = 0.001\n")
    arguments = ["sewn.obj", "--pins", "0,6", "--frames", "2", "--quiet", "--rest", "uv"]
    from_files = ["--material", "silk.toml", "--thickness", "0.002"]
    assert main([*arguments, "-o", "a.vtkhdf"]) == 2
    assert "--uv-scale 0.01111 makes them equal" in capsys.readouterr().err
    assert main([*arguments, *from_files, "--uv-scale", "0.01", "-o", "a.vtkhdf"]) == 0
    made = Trajectory.load("a.vtkhdf")
    assert made.faces.tolist() == FACES.tolist()
    material = Material(young_modulus=5e4, thickness=0.002)
    assert list(made.provenance["material"].values())[:4] == [5e4, 0.485, 0.002, 426.0]
    strain = StretchStVK(Cloth(SHEET, FACES, material, rest_uv=0.9 * SHEET[:, [0, 2]]))
    value = strain.value_and_gradient(made.positions[1].copy())[0]
    assert made.frame_fields["energy/strain"][1] == pytest.approx(value, rel=1e-9)
    assert main(["sewn.obj", "--uv-scale", "0.01", "-o", "b.vtkhdf"]) == 2
    assert "add --rest uv" in capsys.readouterr().err


def test_the_chosen_minimiser_and_barriers_are_the_ones_that_ran(folder):
    arguments = ["sheet.obj", "--pins", "0,6", "--frames", "3", "--quiet", "-o"]
    assert main([*arguments, "a.vtkhdf", "--method", "newton", "--area-barrier", "50"]) == 0
    assert main([*arguments, "b.vtkhdf", "--method", "lbfgs", "--max-iterations", "400"]) == 0
    newton, lbfgs = Trajectory.load("a.vtkhdf"), Trajectory.load("b.vtkhdf")
    assert newton.provenance["options"] == {"method": "newton", "tolerance": 1e-6}
    assert newton.provenance["terms"]["area_barrier"]["stiffness_J_per_m2"] == 50
    assert lbfgs.provenance["options"] == {"method": "lbfgs", "tolerance": 1e-6, "max_iterations": 400}
    assert "area_barrier" not in lbfgs.provenance["terms"]
    np.testing.assert_allclose(newton.positions, lbfgs.positions, atol=1e-4)
    assert lbfgs.frame_fields["factorisations"][2] < lbfgs.frame_fields["iterations"][2]


def test_a_barrier_takes_the_place_of_the_penalty_and_nothing_passes(folder):
    pytest.importorskip("ipctk")
    arguments = ["sheet.obj", "--barrier", "--barrier-distance", "0.003", "--barrier-stiffness", "200"]
    assert main([*arguments, "--obstacle", "ball", "--quiet", "-o", "a.vtkhdf"]) == 0
    made = Trajectory.load("a.vtkhdf")
    barrier = made.provenance["terms"]["barrier"]
    assert (barrier["distance_m"], barrier["stiffness_Pa"], barrier["self_contact"]) == (3e-3, 200, False)
    assert "collision" not in made.provenance["terms"]
    assert made.provenance["options"]["method"] == "newton"
    assert made.frame_fields["energy/barrier"][-1] > 0
    # Without an obstacle there is still the cloth itself to meet.
    assert (
        main(["sheet.obj", "--pins", "0", "--self-contact", "--frames", "2", "--quiet", "-o", "b.vtkhdf"])
        == 0
    )
    assert Trajectory.load("b.vtkhdf").provenance["terms"]["barrier"]["self_contact"]


def test_self_contact_stands_beside_the_penalty_and_its_friction(folder):
    pytest.importorskip("ipctk")
    arguments = ["sheet.obj", "--self-contact", "--friction", "0.3", "--contact-margin", "0.003"]
    assert main([*arguments, "--obstacle", "ball", "--quiet", "-o", "a.vtkhdf"]) == 0
    terms = Trajectory.load("a.vtkhdf").provenance["terms"]
    assert (terms["barrier"]["self_contact"], terms["barrier"]["obstacle"]) == (True, False)
    assert terms["collision"] and terms["friction"]["coefficient"] == 0.3


def test_a_missing_package_is_said_with_its_remedy(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ipctk", None)
    assert main(["sheet.obj", "--self-contact", "-o", "a.vtkhdf"]) == 2
    assert "needs the package ipctk: pip install ipctk" in capsys.readouterr().err


def test_not_converged_is_status_1(folder, capsys):
    assert main(["sheet.obj", "--pins", "0", "--frames", "4", "--max-iterations", "1", "-o", "a.vtkhdf"]) == 1
    out = capsys.readouterr().out
    assert re.search(
        r"frames     4 of 4; 0 of 3 steps converged.*\nworst      max_iterations: frame 1: ", out
    )


def test_resume_goes_on_and_refuses_another_run(folder, capsys):
    arguments = ["sheet.obj", "--pins", "z>0.19", "--quiet", "-o"]
    a, b = [*arguments, "a.vtkhdf", "--frames"], [*arguments, "b.vtkhdf", "--frames"]
    assert [main([*a, "3"]), main([*a, "6", "--resume"]), main([*b, "6", "--resume"])] == [0, 0, 0]
    assert "b.vtkhdf does not exist yet: starting at the beginning" in capsys.readouterr().out
    np.testing.assert_array_equal(
        Trajectory.load("a.vtkhdf").positions, Trajectory.load("b.vtkhdf").positions
    )
    assert main([*a, "9", "--resume", "--density", "500"]) == 2
    assert "differing in" in capsys.readouterr().err
    assert main([*a, "6"]) == 2
    assert "a.vtkhdf exists: add --resume to go on with it, --overwrite" in capsys.readouterr().err
    assert Trajectory.load("a.vtkhdf").frames == 6
    assert main([*a, "2", "--overwrite"]) == 0
    assert Trajectory.load("a.vtkhdf").frames == 2


def test_suspicious_but_possible_input_is_noted(folder, capsys):
    write("inside.obj", SHEET + np.array([0, -0.05, 0]), FACES)
    assert main(["inside.obj", "--obstacle", "ball/ball_0.obj", "--frames", "1", "-o", "a.vtkhdf"]) == 0
    assert re.search(
        r"note: the garment starts with \d+ of 49 vertices inside the obstacle", capsys.readouterr().out
    )
    write("mm.obj", 1000 * SHEET, FACES)
    assert main(["mm.obj", "--obstacle", "ball/ball_0.obj", "--frames", "1", "-o", "b.vtkhdf"]) == 0
    out = capsys.readouterr().out
    assert "note: mm.obj measures 400 m: is --units m right?" in out
    assert "note: a strip of 400 m stretches by about" in out
    bent = 1000 * SHEET
    bent[0, 1] += 0.1
    write("bent.obj", bent, FACES)
    assert main(["bent.obj", "--frames", "1", "-o", "c.vtkhdf"]) == 0
    assert "note: a strip of 400 m stretches by about" in capsys.readouterr().out


BAD = {
    "no garment": (["nix.obj"], "nix.obj: no such file"),
    "open obstacle": (
        ["sheet.obj", "--obstacle", "sheet.obj"],
        "sheet.obj: obstacle is not closed: edge (0, 1)",
    ),
    "no obstacle": (["sheet.obj", "--obstacle", "b*.ply"], "b*.ply: no file matches"),
    "rest of another": (
        ["sheet.obj", "--obstacle", "ball", "--obstacle-rest", "sheet.obj"],
        "sheet.obj: other faces than ball: export both from one mesh",
    ),
    "rest alone": (["sheet.obj", "--obstacle-rest", "sheet.obj"], "--obstacle-rest needs an --obstacle"),
    "friction alone": (["sheet.obj", "--self-contact", "--friction", "1"], "--friction needs an --obstacle"),
    "barrier of nothing": (["sheet.obj", "--barrier"], "--barrier needs an --obstacle; without one give"),
    "penalty of nothing": (["sheet.obj", "--contact-margin", "0.01"], "--contact-margin needs an --obstacle"),
    "penalty and barrier": (
        ["sheet.obj", "--obstacle", "ball", "--barrier", "--contact-stiffness", "1e6"],
        "--contact-stiffness belongs to the penalty, which a barrier replaces: leave it out",
    ),
    "friction of a barrier": (
        ["sheet.obj", "--obstacle", "ball", "--barrier", "--friction", "0.3"],
        "--friction belongs to the penalty, which a barrier replaces: leave it out",
    ),
    "barrier's distance": (
        ["sheet.obj", "--obstacle", "ball", "--barrier-distance", "0.01"],
        "--barrier-distance needs --barrier or --self-contact",
    ),
    "barrier too wide": (["sheet.obj", "--self-contact", "--barrier-distance", "0.5"], "0.5"),
    "method": (["sheet.obj", "--method", "bfgs"], "argument --method: invalid choice: 'bfgs'"),
    "mesh": (["twice.obj"], "twice.obj: vertices 0 and 9 coincide: merge them"),
    "material": (
        ["sheet.obj", "--poisson-ratio", "0.6"],
        "Material.poisson_ratio = 0.6: must lie in (-1, 0.5]",
    ),
    "number": (["sheet.obj", "--density", "heavy"], "argument --density: 'heavy' is no number"),
    "dt": (["sheet.obj", "--dt", "0"], "argument --dt: 0 is not above 0"),
    "dt too long": (["sheet.obj", "--dt", "1e300"], "dt / substeps = 1e+300 s: give 1e-07 to 10000 s"),
    "too many sub-steps": (["sheet.obj", "--substeps", "900000000"], "dt / substeps = 3.7e-11 s: give"),
    "count of many digits": (["sheet.obj", "--frames", "1" * 5000], "has more than 9 digits"),
    "frames": (["sheet.obj", "--frames", "0"], "argument --frames: '0' is no whole number above 0"),
    "friction": (["sheet.obj", "--friction", "-1"], "argument --friction: -1 is below 0"),
    "pin out of range": (["sheet.obj", "--pins", "3,49"], "--pins 49: the garment has vertices 0..48"),
    "pins in nothing": (
        ["sheet.obj", "--pins", "y>3"],
        "--pins 'y>3': no vertex in this box; the garment spans",
    ),
    "pins unclear": (["sheet.obj", "--pins", "left"], "--pins 'left': give indices, 'top', or a box"),
    "all pinned": (["sheet.obj", "--pins", "top"], "holds every vertex of sheet.obj: choose fewer"),
    "input as output": (["sheet.obj", "--pc2", "sheet.pc2"], "sheet.obj would replace an input"),
    "frame of the obstacle as output": (
        ["sheet.obj", "--obstacle", "ball/ball_*.obj", "--pc2", "ball/ball_1.pc2"],
        "ball/ball_1.obj would replace an input",
    ),
    "a file of somebody else": (
        ["sheet.obj", "--pc2", "twice.pc2"],
        "twice.obj exists: add --overwrite to replace it",
    ),
    "kind of cache": (["sheet.obj", "--pc2", "sheet.abc"], "sheet.abc: a point cache ends in .pc2"),
    "no folder": (["sheet.obj", "--pc2", "there/a.pc2"], "there: no such folder to write a.pc2 in"),
    "two wishes": (["sheet.obj", "--resume", "--overwrite"], "not allowed with argument"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_nothing_is_written(folder, refused, case):
    arguments, message = BAD[case]
    write(
        "twice.obj",
        np.concatenate([SHEET[:9], SHEET]),
        np.concatenate([FACES + 9, np.arange(9).reshape(3, 3)]),
    )
    assert refused(message, main, [*arguments, "-o", "out.vtkhdf"]).startswith("simulate: ")


def test_a_start_that_cannot_be_leaves_what_is_there(folder, capsys):
    assert main(["sheet.obj", "--frames", "2", "-o", "out.vtkhdf"]) == 0
    before = Path("out.vtkhdf").read_bytes()
    write("cut.obj", BALL, BALL_FACES)
    arguments = ["sheet.obj", "--obstacle", "cut.obj", "--barrier", "-o", "out.vtkhdf", "--overwrite"]
    assert main(arguments) == 2 and "start is not free of intersections" in capsys.readouterr().err
    assert Path("out.vtkhdf").read_bytes() == before


def test_pins_are_numbers_of_the_file_where_a_chart_joins_its_vertices(folder):
    cut = np.flatnonzero(np.abs(SHEET[:, 0]) < 1e-9)
    twice, split = doubled_along(SHEET, FACES, cut)
    chart = SHEET[FACES][:, :, [0, 2]]
    order = np.random.default_rng(0).permutation(len(twice))  # so that joining renumbers what is pinned
    new = np.argsort(order)
    write_obj(folder / "split.obj", twice[order], new[split], uv=chart)
    pin = len(twice) - 1
    assert main(["split.obj", "--rest", "uv", "--pins", f"{pin}", "--frames", "2", "-o", "out.vtkhdf"]) == 0
    first, last = Trajectory.load("out.vtkhdf").positions
    held = np.flatnonzero((first == last).all(axis=1))
    np.testing.assert_allclose(first[held], twice[order[-1:]], atol=1e-6)


def test_an_obstacles_trajectory_brings_its_time_between_frames(folder, capsys):
    Trajectory(BALL + np.zeros((3, 1, 1)), BALL_FACES, np.arange(3) / 60).save("ball.vtkhdf")
    arguments = ["sheet.obj", "--obstacle", "ball.vtkhdf", "--obstacle-rest", "ball/ball_0.obj"]
    assert main([*arguments, "-o", "a.vtkhdf"]) in (0, 1)
    assert Trajectory.load("a.vtkhdf").times[1] == pytest.approx(1 / 60)
    assert "between frames" not in capsys.readouterr().out
    assert main([*arguments, "--dt", "1/30", "-o", "b.vtkhdf"]) in (0, 1)
    assert Trajectory.load("b.vtkhdf").times[1] == pytest.approx(1 / 30)
    assert "note: ball.vtkhdf has 0.01667 s between frames, and --dt is 0.03333" in capsys.readouterr().out


def test_an_output_of_another_kind_is_refused(folder, capsys):
    assert main(["sheet.obj", "-o", "out.obj"]) == 2
    assert "out.obj: the trajectory ends in .vtkhdf" in capsys.readouterr().err
    assert main(["sheet.obj", "-o", "o" * 300 + ".vtkhdf"]) == 2
    error = capsys.readouterr().err
    assert "File name too long" in error and error.count("\n") == 1


def test_interrupted_by_hand(folder, capsys, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("reference_sim.command.simulate_run.simulate", interrupt)
    assert main(["sheet.obj", "-o", "out.vtkhdf"]) == 130
    assert "--resume goes on from out.vtkhdf" in capsys.readouterr().err
