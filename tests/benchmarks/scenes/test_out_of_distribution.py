"""Motions out of distribution: what is hard about each, how a roll-out is measured and judged, who shares."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from benchmarks.assets import Assets
from benchmarks.methods import find_method
from benchmarks.methods.networks import CollisionPostProcessing
from benchmarks.metric import RollOut
from benchmarks.metrics.energy import energies
from benchmarks.metrics.roll_out import EXTRAPOLATION, measure_extrapolation
from benchmarks.plan.cell import Cell
from benchmarks.presets import find_preset
from benchmarks.results.run_folder import model_path
from benchmarks.runner.measurements import measure_roll_out
from benchmarks.runner.rows import rows_of_cell
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Outcome
from benchmarks.scenes import ORDINARY, find_scene, hard_motions
from snug.body.parametric_body import Body
from snug.body.skeleton import JOINT, joint_positions, rotation_matrices
from snug.motion.library import make_motion
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel
from tests.benchmarks.plan.planned import planned
from tests.benchmarks.runner.tasks_by_hand import grouped, plan_of, prepared, trajectory_of
from tests.snug.training.dressing import random_model, tailored

SMOKE = find_preset("smoke")


@pytest.fixture(scope="module")
def assets():
    return Assets(Body.load(), {"tshirt": tailored("tshirt", 200)}, {}, {})


@pytest.fixture(scope="module")
def models(assets, tmp_path_factory):
    """Return the folder of a saved network with a random last layer."""
    folder = tmp_path_factory.mktemp("models")
    dressed = DressedBody(assets.body, assets.garments["tshirt"])
    random_model("snug", dressed, [make_motion("walk")], seed=0).save(model_path(folder, "snug", 0))
    return folder


def rolled_out(assets, models, name, method):
    """The built scene, and the method that has rolled out in it."""
    scene = find_scene(name).at(SMOKE).build(assets)
    runner = prepared(method, scene, models)
    return scene, runner, runner.run().positions


def test_what_is_hard_about_each(assets):
    names = ("walk_x4", "root_glitch", "limb_glitch", "splits", "arms_crossed")
    scenes = {name: find_scene(f"out_of_distribution/{name}").at(SMOKE).build(assets) for name in names}
    motions = {name: scene.dressed.motion for name, scene in scenes.items()}
    walk = make_motion("walk")
    assert np.array_equal(motions["walk_x4"].poses, walk.poses[::4])
    plain, wrong = hard_motions.ordinary(walk), hard_motions.GLITCH
    jump = motions["root_glitch"].translations - plain.translations
    assert np.flatnonzero(jump.any(axis=1)).tolist() == [wrong]
    assert np.linalg.norm(jump) == pytest.approx(1.0)
    flip = np.argwhere((motions["limb_glitch"].poses != plain.poses).any(axis=2))
    assert flip.tolist() == [[wrong, JOINT["left_shoulder"]]]
    turned = [
        rotation_matrices(m.poses[wrong, JOINT["left_shoulder"]]) for m in (plain, motions["limb_glitch"])
    ]
    assert np.trace(turned[0].T @ turned[1]) == pytest.approx(-1.0)  # half a turn
    joints = joint_positions(motions["splits"].poses, motions["splits"].translations)[-1]
    ankles = joints[JOINT["left_ankle"]] - joints[JOINT["right_ankle"]]
    assert abs(ankles[0]) > 1.4  # [m] apart sideways: splits
    joints = joint_positions(motions["arms_crossed"].poses, motions["arms_crossed"].translations)[-1]
    wrists = joints[JOINT["left_wrist"]] - joints[JOINT["right_wrist"]]
    assert wrists[0] < -0.1  # the left one is on the right


@pytest.fixture(scope="module")
def roll_outs(assets, models):
    """Name of a scene -> roll-outs of skinning and of an untrained network there."""

    run = cache(partial(rolled_out, assets, models))

    def both(name):
        positions = {method: run(name, method)[2] for method in ("skinning", "snug")}
        group = grouped(run(name, "skinning")[0], positions, suites=("extremes",))
        by_name = dict(zip(positions, group.roll_outs))
        for method, rolled in by_name.items():
            rolled.counterpart = run(ORDINARY, method)[2]
        return by_name

    return both


def test_a_glitch_is_forgotten_or_not(roll_outs):
    pair = roll_outs("out_of_distribution/root_glitch")
    free, net = (measure_extrapolation(pair[name]) for name in ("skinning", "snug"))
    assert set(free) == set(net) <= {metric.name for metric in EXTRAPOLATION.metrics}
    assert [free[f"motion/recovery_{after}"] for after in (1, 10, 30)] == [0.0] * 3  # it has no memory
    assert net["motion/recovery_1"] > net["motion/recovery_30"] > 0.0
    assert free["motion/offset"] < 1e-3  # mm: its float32
    assert free["motion/strain_ratio"] == pytest.approx(1.0)


def test_another_material_judges_the_same_roll_out(roll_outs):
    pair = roll_outs("out_of_distribution/membrane_x10")
    free = measure_extrapolation(pair["skinning"])
    assert free["motion/strain_ratio"] == pytest.approx(10.0)
    plain = energies(roll_outs(ORDINARY)["skinning"])
    ten_times = (plain["total"] + 9.0 * plain["strain"])[pair["skinning"].judged]
    assert free["motion/total"] == pytest.approx(ten_times.mean())


def test_the_body_of_another_shape_is_seen_by_every_method(assets, models):
    dressed = DressedBody(assets.body, assets.garments["tshirt"])
    model = TrainedModel.load(model_path(models, "snug", 0))
    for method in ("snug", "snug+cleanup", "skinning"):
        scene, result, x = rolled_out(assets, models, "out_of_distribution/girth_+5", method)
        betas = scene.dressed.betas
        assert betas.tolist()[:2] == [0.0, 5.0] and len(betas) == assets.body.shape_count
        if method == "snug":
            by_hand = roll_out(model, dressed, scene.dressed.motion, betas).positions
            assert np.array_equal(x, by_hand)
            still = roll_out(model, dressed, scene.dressed.motion, betas, quasi_static=True)
            assert np.array_equal(result.quasi_static().positions, still.positions)
        if method == "snug+cleanup":
            clean = CollisionPostProcessing(dressed, scene.obstacle.positions)
            assert np.array_equal(x, [clean(frame, number) for number, frame in enumerate(by_hand)])
            assert not np.array_equal(x, by_hand)
        depth = scene.obstacle.signed_distance(x[0], 0)
        assert np.median(depth) > -0.01, method  # [m]: a shirt of the mean body would be inside this one
    assert scene.start == pytest.approx(dressed.skin(scene.dressed.motion, betas)[0], abs=0.05)


@pytest.mark.parametrize("method, far, expected", [
    ("snug", 0.08, "ok"), ("snug", 0.7, "diverged"), ("simulation", 0.7, "ok"), ("snug", np.nan, "diverged"),
])  # fmt: skip
def test_a_network_whose_shirt_is_on_no_body_has_diverged(roll_outs, tmp_path, method, far, expected):
    """A simulated shirt may be where it likes: of a body that jumps by a metre it has to be left behind."""
    free = roll_outs("out_of_distribution/walk_x4")["skinning"]
    x = free.positions.copy()
    x[3, 7, 0] += far
    whole = bool(np.isfinite(far))
    roll_out = RollOut(
        free.group, find_method(method), trajectory_of(free.scene, x), suites=("extremes",)
    )
    roll_out.counterpart = free.counterpart
    free.group.roll_outs.append(roll_out)
    values, _, ended = measure_roll_out(roll_out, ("extrapolation",))
    # Of what is not finite the cell says so itself, and keeps its own words.
    verdict = ("ok", "") if whole else ("diverged", "not finite")
    scene = find_scene("out_of_distribution/walk_x4").at(SMOKE)
    cell = Cell(scene, find_method(method), 0, ("extremes",))
    outcomes = {
        ("cell", cell.name): Outcome(*verdict, result={"frames": 5}, files=("x",)),
        ("metrics", cell.name): Outcome(*ended, result=values),
    }
    rows = list(rows_of_cell(cell, plan_of(tmp_path, preset=SMOKE, cells=(cell,)), {}, outcomes))
    assert {row.status for row in rows} == {expected} and len(rows) == len(values) >= 4
    lost = "a vertex came 0.7 m away from the skinned shirt"
    assert {row.reason for row in rows} == {verdict[1] or (lost if expected == "diverged" else "")}
    assert not any(row.metric.startswith("cost/") for row in rows)  # nobody took its time


def test_the_task_of_the_settled_shirt_that_serves_all_comes_unasked():
    plan = planned("full:extremes", "--scenes", "*splits,*girth_+5", "--methods", "simulation")
    starts = {task.name: task for task in tasks_of(plan) if task.kind == "start"}
    ordinary, splits = "out_of_distribution-ordinary", "out_of_distribution-splits"
    assert list(starts) == [ordinary, splits, "out_of_distribution-girth_+5"]
    assert starts[splits].needs == (("start", ordinary),)
    assert not starts["out_of_distribution-girth_+5"].needs
