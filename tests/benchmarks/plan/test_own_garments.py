"""A garment of the user's own takes the place of the T-shirt in a run."""

from __future__ import annotations

from dataclasses import asdict

import pytest

from benchmarks import run as run_command
from benchmarks.plan.study import StudyError
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.schedule import Schedule
from reference_sim.material import Material
from snug.body.parametric_body import Body
from snug.garments.templates import find_template
from tests.benchmarks.plan.planned import planned
from tests.snug.garments.garment_files import own_chart, saved
from tests.snug.training.dressing import tube_dress


@pytest.fixture(scope="session")
def tube():
    """150 vertices, made in milliseconds."""
    return tube_dress().garment


def test_an_own_garment_takes_the_place_of_the_tshirt_in_every_scene(tmp_path, tube):
    path, out = saved(tmp_path, tube), str(tmp_path / "run")
    plan = planned("smoke", "--garment", str(path), "-o", out)
    worn = {scene.garment for scene in plan.scenes if scene.dressed}
    assert worn == {"mine"} and {network.garment for network in plan.networks} == {"mine"}
    names = {scene.name for scene in plan.scenes}
    assert {"mine/01_01_a", "mine/there_and_back", "out_of_distribution/ordinary"} <= names
    with pytest.raises(StudyError, match="unknown scene 'dependence/mesh/500'"):  # it tailors one itself
        planned("--garment", str(path), "--scenes", "dependence/mesh/500", "-o", out)
    usual = planned("smoke", "-o", out)
    assert {scene.garment for scene in usual.scenes if scene.dressed} == {"tshirt"}


def test_what_a_garment_is_read_from_is_an_input_of_all_that_wears_it(tmp_path, tube):
    path = saved(tmp_path, tube)
    options = ["smoke:garments", "--methods", "skinning", "--garment", str(path)]

    def inputs(*more):
        plan = planned(*options, *more, "-o", str(tmp_path / "run"))
        return Schedule(plan).cell(plan.cells[0]).inputs

    first = inputs()
    assert inputs() == first != inputs("--set", "garment.shift=0,0.001,0")
    (tmp_path / "elsewhere").mkdir()
    moved = path.rename(tmp_path / "elsewhere" / path.name)
    options[-1] = str(moved)
    assert inputs() == first
    material = tmp_path / "silk.json"
    material.write_text('{"density": 300.0}')
    assert inputs("--set", f"garment.material={material}") != first
    moved.write_text(moved.read_text() + "# a remark\n")
    assert inputs() == first  # the garment as read is what counts
    saved(moved.parent, tube, positions=1.001 * tube.rest_positions)
    assert inputs() != first


@pytest.mark.parametrize(
    ("name", "error", "remedy"),
    [
        ("tshirt.obj", ValueError, "give the file another name"),
        ("out_of_distribution.obj", StudyError, "give the file another name"),
        ("my shirt.obj", ValueError, "give the file a name of letters and digits"),
        ("a*.obj", ValueError, "give the file a name of letters and digits"),
    ],
)
def test_a_name_that_means_something_else_is_refused(tmp_path, tube, name, error, remedy):
    path = saved(tmp_path, tube, name=name)
    with pytest.raises(error, match=remedy):
        planned("smoke", "--garment", str(path), "-o", str(tmp_path / "run"))


@pytest.mark.slow
def test_a_garment_of_ones_own_goes_through_a_run(tmp_path):
    shirt = find_template("tshirt").tailor(Body.load(), vertices=300)
    path = saved(tmp_path, shirt, uv=own_chart(shirt.rest_positions, shirt.faces))
    out = tmp_path / "run"
    options = ["smoke:garments", "--methods", "simulation,skinning,snug"]
    options += ["--garment", str(path), "--set", "garment.rest=uv", "-o", str(out), "--workers", "1"]
    assert run_command.main(options) == 0
    folder = RunFolder(out)
    rows = [row for row in folder.read_rows() if row.metric == "energy/strain"]
    assert {row.scene for row in rows} == {"mine/push_recovery"} and all(row.status == "ok" for row in rows)
    assert folder.read_config()["garments"]["mine"]["material"] == asdict(Material())
    assert (folder.models_of("mine") / "snug-seed0.safetensors").is_file()
