"""A body, a garment and motions of the user's own in a plan: what takes part, and what is refused."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from benchmarks import run
from benchmarks.plan.study import StudyError
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.schedule import Schedule
from reference_sim.material import Material
from snug.body.parametric_body import Body
from snug.garments.templates import find_template
from tests.benchmarks.plan.planned import planned
from tests.snug.garments.garment_files import own_chart, saved
from tests.snug.training.dressing import tube_dress

WORDS = ("smoke:garments", "--methods", "skinning")


def write_motions(folder: Path, *names: str, frames: int = 12) -> str:
    folder.mkdir(exist_ok=True)
    for name in names:
        poses = np.zeros((frames, 52 * 3))
        np.savez(folder / f"{name}.npz", poses=poses, trans=np.zeros((frames, 3)), mocap_framerate=30.0)
    return str(folder)


@pytest.fixture(scope="module")
def tube():
    return tube_dress().garment


def test_an_own_garment_takes_the_place_of_the_tshirt_in_every_scene(tmp_path, tube):
    path = str(saved(tmp_path, tube))
    plan = planned("smoke", "--garment", path)
    worn = {scene.garment for scene in plan.scenes if scene.dressed}
    assert worn == {"mine"} and {network.garment for network in plan.networks} == {"mine"}
    names = {scene.name for scene in plan.scenes}
    assert {"mine/01_01_a", "mine/there_and_back", "out_of_distribution/ordinary"} <= names
    with pytest.raises(StudyError, match="unknown scene 'dependence/mesh/500'"):  # it tailors one itself
        planned("--garment", path, "--scenes", "dependence/mesh/500")


def test_what_a_garment_is_read_from_is_an_input_of_all_that_wears_it(tmp_path, tube):
    path = saved(tmp_path, tube)

    def inputs(words=""):
        plan = planned(*WORDS, "--garment", f"{path}{words}", "-o", str(tmp_path / "run"))
        return Schedule(plan).cell(plan.cells[0]).inputs

    first = inputs()
    (tmp_path / "silk.toml").write_text("density = 300.0\n")
    assert first not in (inputs(",shift=0 0.001 0"), inputs(f",material={tmp_path}/silk.toml"))
    path.write_text(path.read_text() + "# a remark\n")
    assert inputs() == first  # the garment as read is what counts
    saved(tmp_path, tube, positions=1.001 * tube.rest_positions)
    assert inputs() != first


@pytest.mark.slow
def test_a_garment_of_ones_own_goes_through_a_run(tmp_path):
    shirt = find_template("tshirt").tailor(Body.load(), vertices=300)
    path = saved(tmp_path, shirt, uv=own_chart(shirt.rest_positions, shirt.faces))
    out = tmp_path / "run"
    options = ["smoke:garments", "--methods", "simulation,skinning,snug", "--garment", f"{path},rest=uv"]
    assert run.main([*options, "-o", str(out), "--workers", "1"]) == 0
    folder = RunFolder(out)
    rows = [row for row in folder.read_rows() if row.metric == "energy/strain"]
    assert {(row.scene, row.status) for row in rows} == {("mine/push_recovery", "ok")}
    assert folder.read_config()["garments"]["mine"]["material"] == asdict(Material())
    assert (folder.models_of("mine") / "snug-seed0.safetensors").is_file()


def test_a_file_of_a_body_shape_beside_clips_is_left_out(tmp_path, refused):
    folder = Path(write_motions(tmp_path / "01", "01_01", "a b"))  # a subject of AMASS
    np.savez(folder / "shape.npz", gender=np.array("male"), betas=np.zeros(16))
    (folder / "._01_01.npz").write_bytes(b"\0\5\x16\7of macOS")
    assert set(planned(*WORDS, "--motions", str(folder)).inputs.motions) == {"01_01", "a b"}
    (folder / "b.npz").write_bytes(b"PK")
    # A shape that is named by itself was meant to be a motion.
    for path, hint in ((folder / "shape.npz", "no array 'poses'"), (folder, "b.npz")):
        refused(hint, run.main, [*WORDS, "--motions", str(path), "-o", str(tmp_path / "run")])


def test_own_clips_that_are_cut_are_named_and_more_frames_are_measured_where_they_are_set(tmp_path):
    words = ("--motions", write_motions(tmp_path / "a", "long", frames=200), "--methods", "skinning")
    assert planned("full", *words).cut_motions == {"long": "the first 150 of 200 frames"}
    assert planned("full", *words, "--set", "sizes.frames=200").cut_motions == {}
