"""Scenes: each declares what it has and no more, and what it does not declare is not loaded."""

from __future__ import annotations

import dataclasses
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.assets import Assets, joint_speeds, liveliest_part, make_motions, open_assets, read_inputs
from benchmarks.presets import find_preset
from benchmarks.runner.cache import dependencies
from benchmarks.runner.schedule import tasks_of
from benchmarks.scenes import all_scenes, shapes
from snug.body.parametric_body import Body
from snug.motion.library import CLIPS, SEGMENTS, make_motion
from tests.benchmarks.plan.planned import planned
from tests.benchmarks.runner.tasks_by_hand import dressed_scene, prepared, simulated
from tests.snug.training.dressing import tailored

SMOKE = find_preset("smoke")
TINY = dataclasses.replace(SMOKE, garment_vertices=300, frames=8)


def test_a_body_of_another_shape_wears_the_garment_of_the_mean_one(monkeypatch):
    assets = open_assets(TINY, make_motions(["punch"]), ["tshirt"])
    garment, body = assets.garments["tshirt"], assets.body
    built = {place: shapes("punch")[place].at(TINY).build(assets) for place in (0, 1)}
    mean, other = built.values()
    betas = np.array(shapes("punch")[1].options["betas"])
    for of_rest in ("rest_positions", "Dm_inverse"):
        assert np.array_equal(getattr(mean.cloth, of_rest), getattr(other.cloth, of_rest))
    assert mean.dressed.betas is None and np.array_equal(other.dressed.betas, betas)
    motion = other.dressed.motion
    skin = body.vertices(motion.poses, motion.translations, betas)
    assert np.array_equal(other.obstacle.at(3), skin[3])
    assert other.origin_heights[2] == body.joints(betas)[0, 1] + motion.translations[2, 1]

    starts = []

    def starting(cloth, energies, *, start, frames, obstacle, **rest):
        starts.append((start, obstacle.at(0)))
        return SimpleNamespace(frames=frames, positions=np.stack([start] * frames))

    monkeypatch.setattr("benchmarks.scenes.dressed_body.simulate", starting)
    assert other.start.shape == (len(garment.rest_positions), 3)
    unposed = body.vertices(np.zeros((1, 24, 3)), np.zeros((1, 3)), betas)[0]
    vertices, posed = starts[0]  # the way to the first pose begins in the T-pose, but for the root
    apart = np.linalg.norm(vertices[:, None] - posed[None, ::9], axis=2).min(1)
    wanted = garment.rest_for(body, betas)[:, None] - unposed[None, ::9]
    assert apart == pytest.approx(np.linalg.norm(wanted, axis=2).min(1), abs=1e-9)


def write_body(path: Path, scale: float) -> str:
    body = Body.load()
    arrays = {"v_template": body.template, "J_template": body.joint_template}
    table = np.stack([np.maximum(body.parents, 0), np.arange(24)])
    scaled = {name: scale * array for name, array in arrays.items()}
    np.savez(path, f=body.faces, weights=body.skinning_weights, kintree_table=table, **scaled)
    return str(path)


def test_an_own_body_wears_the_garment_and_makes_stale_what_was_on_another(tmp_path):
    path, again = (write_body(tmp_path / f"{name}.npz", 1.1) for name in ("tall", "again"))
    same, other = (read_inputs(body=Path(file)).body.digest for file in (path, again))
    assert same == other  # what was read is known again, not its file
    plans = [planned("full:garments", "--methods", "snug", *words) for words in ((), ("--body", path))]
    for one, other in zip(*map(tasks_of, plans), strict=True):
        same = dependencies(one, {}) == dependencies(other, {})
        assert one.id == other.id and (one.kind not in ("network", "cell") or not same), one.id
    heights = []
    for plan in plans:
        assets = open_assets(TINY, [make_motion("walk")], ["tshirt"], inputs=plan.inputs)
        heights.append(np.ptp(assets.garments["tshirt"].rest_positions[:, 1]))
        assert dressed_scene("walk").build(assets).dressed.body is assets.body
    assert 1.05 < heights[1] / heights[0] < 1.15


def test_a_clip_is_the_liveliest_part_and_what_is_not_judged_before_it():
    body, motion = Body.load(), make_motion("sudden_stop")
    speed = joint_speeds(body, motion)
    judged = liveliest_part(body, motion, 20)
    sums = [speed[k : k + 19].sum() for k in range(len(speed) - 18)]
    assert judged == range(np.argmax(sums), np.argmax(sums) + 20)
    assert liveliest_part(body, motion, 20, 6) == range(judged.start - 6, judged.stop)
    late = motion.cut(judged.start + 2, motion.frames)  # liveliest at once
    assert len(liveliest_part(body, late, 20, 6)) == 26
    assert liveliest_part(body, motion, motion.frames - 2, 6) == range(motion.frames)


def test_a_clip_goes_on_where_the_whole_motion_is():
    """No jolt: its simulation and that of the whole motion are one until round-off has grown."""
    preset = dataclasses.replace(SMOKE, frames=24, clip_frames=8, warm_up_frames=4, settle_frames=6)
    assets = open_assets(preset, make_motions(["sudden_stop"]), ["tshirt"])
    scenes = all_scenes(["sudden_stop"], [])
    built = [scenes[f"tshirt/sudden_stop{part}"].at(preset).build(assets) for part in ("", "@clip")]
    whole, part = (simulated(scene).positions for scene in built)
    frames = assets.clips["sudden_stop"]
    assert frames.start > 0 and len(frames) == 12 and built[1].warm_up == 3  # at most a quarter
    assert np.abs(whole[frames.start : frames.stop] - part).max() < 1e-8
    assert np.abs(built[1].start_velocity).max() > 0.05
    before, motion = built[1].dressed.before, built[1].dressed.motion
    joined = before.followed_by(motion)
    assert np.array_equal(joined.poses, assets.motions["sudden_stop"].poses[: frames.stop])
    assert built[0].dressed.before is None


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CLIPS, *SEGMENTS])
def test_the_reference_converges_on_every_frame_of_a_recorded_clip(name):
    motion = make_motion(name)
    assets = Assets(Body.load(), {"tshirt": tailored("tshirt", 1000)}, {name: motion}, {})
    scene = dressed_scene(name, preset=find_preset("quick")).build(assets)
    trajectory = prepared("simulation", scene).run()
    assert trajectory.frames == motion.frames
    assert np.flatnonzero(trajectory.frame_fields["converged"] < 1).tolist() == []


ROOT = Path(__file__).resolve().parents[3]
DRESSED = """
import dataclasses, pickle, sys
from pathlib import Path
from benchmarks.methods import find_method
from benchmarks.presets import find_preset
from benchmarks.scenes import find_garment
assets, start, motion = pickle.loads(Path(sys.argv[1]).read_bytes())
assets = dataclasses.replace(assets, motions={"kick": motion})
scene = find_garment("tshirt").scene("kick").at(find_preset("smoke")).build(assets)
method = find_method("lbfgs-5").make(models=Path("."), seed=0)
method.prepare(dataclasses.replace(scene, settle=lambda: start))
assert method.run().frames == 4
print(*sys.modules)
"""
NETWORKS = {"torch", "snug.body.skinning", "snug.networks.dressed_body", "snug.networks.regressor"}


def test_solvers_of_a_dressed_body_load_no_network_library(tmp_path):
    """Networks need torch, whoever poses the body does not."""
    assets = open_assets(SMOKE, make_motions(["kick"]), ["tshirt"])
    scene = dressed_scene("kick").build(assets)
    motion, path = assets.motions["kick"], tmp_path / "given"
    inputs = (assets, scene.start, motion.cut(0, 4))
    path.write_bytes(pickle.dumps(inputs))
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    modules = subprocess.check_output(
        [sys.executable, "-c", DRESSED, str(path)], text=True, env=environment
    )
    assert "reference_sim.obstacle" in modules.split() and not NETWORKS & {*modules.split()}
