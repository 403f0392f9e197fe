"""Hard motions: what is hard about each, how a roll-out is judged, and the long roll-out."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from benchmarks.methods.networks import model_path
from benchmarks.wardrobe import open_wardrobe
from plans import SMOKE, plan_of

from benchmarks import workers
from benchmarks.plan import Cell
from benchmarks.results import RunFolder
from benchmarks.scenes import dressed_scene
from benchmarks.studies import hard_motion_cases, hard_motion_stage, hard_motions
from benchmarks.studies.hard_motion_cases import HARD_MOTIONS
from benchmarks.studies.hard_motion_stage import HardStage, RollOut, Trained
from reports import study_tables
from snug.dressed_body import DressedBody
from snug.motion_library import make_motion
from snug.rollout import roll_out
from snug.skeleton import JOINT, joint_positions, rotation_matrices
from snug.train import untrained_model
from snug.trained_model import TrainedModel


@pytest.fixture(scope="module")
def walk():
    return make_motion("walk")


@pytest.mark.parametrize("case", HARD_MOTIONS, ids=lambda case: case.name)
def test_a_hard_motion_starts_where_the_shirt_has_settled(case, walk):
    motion = case.make(walk)
    assert 20 <= motion.frames <= 50 and motion.fps == walk.fps
    assert np.array_equal(motion.translations[0], walk.translations[0])
    if case.betas:
        assert not motion.poses[0, 1:].any()  # in T-pose, in the shirt's rest shape
    else:
        assert motion.poses[0] == pytest.approx(walk.poses[0], abs=1e-12)
    assert case.glitch == (motion.frames == hard_motion_cases.ORDINARY and not case.material)


def test_what_is_hard_about_each(walk):
    made = {case.name: case.make(walk) for case in HARD_MOTIONS}
    assert np.array_equal(made["walk_x4"].poses, walk.poses[::4])
    plain, wrong = hard_motion_cases.ordinary(walk), hard_motion_cases.GLITCH
    jump = made["root_glitch"].translations - plain.translations
    assert np.flatnonzero(jump.any(axis=1)).tolist() == [wrong] and np.linalg.norm(jump) == pytest.approx(1.0)
    flip = np.argwhere((made["limb_glitch"].poses != plain.poses).any(axis=2))
    assert flip.tolist() == [[wrong, JOINT["left_shoulder"]]]
    turned = [rotation_matrices(m.poses[wrong, JOINT["left_shoulder"]]) for m in (plain, made["limb_glitch"])]
    assert np.trace(turned[0].T @ turned[1]) == pytest.approx(-1.0)  # half a turn
    joints = joint_positions(made["splits"].poses, made["splits"].translations)[-1]
    ankles = joints[JOINT["left_ankle"]] - joints[JOINT["right_ankle"]]
    assert abs(ankles[0]) > 1.4  # [m] apart sideways: splits
    joints = joint_positions(made["arms_crossed"].poses, made["arms_crossed"].translations)[-1]
    wrists = joints[JOINT["left_wrist"]] - joints[JOINT["right_wrist"]]
    assert wrists[0] < -0.1  # the left one is on the right


def test_a_loop_comes_back_to_its_pose_and_goes_on_over_the_ground(walk):
    motion, loop = hard_motion_cases.looped(walk, 1000)
    assert motion.frames == 1000 and loop == walk.frames + hard_motion_cases.LOOP_BLEND
    assert np.array_equal(motion.poses[loop : 2 * loop], motion.poses[:loop])
    assert motion.translations[loop, 1] == pytest.approx(motion.translations[0, 1], abs=1e-12)
    step = np.linalg.norm(np.diff(motion.translations, axis=0), axis=1)
    assert step.max() == pytest.approx(
        np.linalg.norm(np.diff(walk.translations, axis=0), axis=1).max(), rel=0.2
    )


def test_how_a_roll_out_is_judged():
    fine, near = np.zeros((5, 3, 3)), {"motion/offset": 80.0}
    lost = fine.copy()
    lost[3, 1, 1] = lost[4, 2, 0] = np.nan
    away = {"motion/offset": 700.0}
    assert hard_motions.outcome("snug", RollOut(fine), near) == ("ok", "")
    assert hard_motions.outcome("snug", RollOut(lost), near) == ("diverged", "not finite from frame 3 on")
    assert hard_motions.outcome("snug", RollOut(fine), away)[0] == "diverged"
    assert hard_motions.outcome("simulation", RollOut(fine), away) == ("ok", "")
    assert hard_motions.outcome("simulation", RollOut(fine, "stalled", "why"), near) == ("stalled", "why")
    assert len(hard_motions.whole_frames(lost)) == 3


@pytest.fixture(scope="module")
def stage(walk, tmp_path_factory):
    """A small shirt, a network with a random last layer, and a simulator that is skinning moved by 1 mm."""
    preset = dataclasses.replace(SMOKE, garment_vertices=200)
    wardrobe = open_wardrobe(preset, [])
    wardrobe = dataclasses.replace(wardrobe, motions={"walk": walk})
    path = tmp_path_factory.mktemp("models") / "snug-seed0.safetensors"
    model = untrained_model("snug", DressedBody(wardrobe.body, wardrobe.garment), [walk], seed=0)
    model.save(path)
    stage = HardStage(wardrobe, preset, walk, (Trained("snug", 0, path),))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            hard_motion_stage,
            "simulated",
            lambda scene: RollOut(stage.skinned(scene.dressed.motion, None) + np.array([0.001, 0, 0])),
        )
        patch.setattr(hard_motions, "_stage", lambda *_: stage)
        yield stage


def by_metric(rows, method):
    return {row.metric: row for row in rows if row.method == method}


def test_a_glitch_is_forgotten_or_not(stage):
    rows = hard_motions.do_case(None, lambda _: None, SMOKE, stage.networks, "root_glitch")
    assert {row.scene for row in rows} == {"hard_motions/root_glitch"}
    free, net, sim = (by_metric(rows, method) for method in ("skinning", "snug", "simulation"))
    assert set(free) == set(net) == set(sim) <= set(hard_motions.UNITS)
    for after in hard_motion_cases.AFTER:
        assert free[f"motion/recovery_{after}"].value == 0.0  # it has no memory
        assert sim[f"motion/recovery_{after}"].value == 0.0
    assert net["motion/recovery_1"].value > net["motion/recovery_30"].value > 0.0
    assert free["motion/offset"].value == 0.0 and sim["motion/offset"].value == pytest.approx(1.0)
    assert free["motion/strain_ratio"].value == pytest.approx(1.0)


def test_another_material_judges_the_same_roll_out(stage):
    rows = hard_motions.do_case(None, lambda _: None, SMOKE, stage.networks, "membrane_x10")
    free = by_metric(rows, "skinning")
    assert free["motion/strain_ratio"].value == pytest.approx(10.0)
    assert free["motion/total"].value > free["motion/strain"].value / 10
    assert by_metric(rows, "snug")["motion/total"].value > 0


def test_the_long_roll_out_is_the_short_one_carried_on(stage, walk, monkeypatch):
    monkeypatch.setattr(hard_motion_stage, "CHUNK", 37)
    (network,) = stage.networks
    sampled, away, drift = stage.long_roll_out(network, 390, 7)
    motion, _ = hard_motion_cases.looped(walk, 390)
    trajectory = roll_out(TrainedModel.load(network.path), stage.dressed, motion)
    pelvis = stage.dressed.pelvis(motion)
    assert sampled == pytest.approx(trajectory.positions[::7] - pelvis[::7, None], abs=2e-5)
    bare = stage.skinned(motion, None)
    assert away == pytest.approx(np.linalg.norm(trajectory.positions - bare, axis=2)[::7], abs=2e-5)
    assert 0.0 < drift < 1e-3  # the state of an untrained network is soon forgotten
    monkeypatch.setitem(hard_motions.LONG, "smoke", 390)
    rows = hard_motions.do_long(None, lambda _: None, SMOKE, stage.networks)
    with pytest.raises(ValueError, match="a drift needs three loops, 390 frames, not 389"):
        stage.long_roll_out(network, 389, 7)
    assert {row.metric for row in rows} >= {"motion/drift", "motion/strain_ratio"}


def test_a_network_does_hard_motions_once_and_under_its_own_name_whatever_is_made_of_it(tmp_path):
    methods = ("snug", "snug+cleanup", "pbns+cleanup", "snug+lbfgs-1", "untrained", "skinning", "supervised")
    cells = tuple(Cell(dressed_scene("kick"), name, 0, ("garments",)) for name in methods)
    folder = RunFolder(tmp_path)
    folder.models.mkdir()
    for kind in ("snug", "pbns", "untrained"):
        model_path(folder.models, kind, 0).touch()
    found = hard_motions.trained(plan_of(tmp_path, cells=cells), folder)
    assert [(network.method, network.path.name) for network in found] == [
        (kind, f"{kind}-seed0.safetensors") for kind in ("snug", "pbns")
    ]


def test_without_networks_the_reader_is_told(tmp_path, monkeypatch):
    asked = []

    def run_jobs(jobs, *_, workers, **__):
        assert workers == 5
        asked.extend(jobs)
        return [[] for _ in jobs]

    monkeypatch.setattr(workers, "run_jobs", run_jobs)
    (row,) = hard_motions.rows(plan_of(tmp_path, workers=5), RunFolder(tmp_path), None)
    assert row.status == "skipped" and "no trained network" in row.reason
    assert [job.label for job in asked] == [case.name for case in HARD_MOTIONS if case.smoke]


def test_tables_say_how_each_ended(stage):
    rows = hard_motions.do_case(None, lambda _: None, SMOKE, stage.networks, "walk_x4")
    table = study_tables.hard_motions([*rows, *rows[:1]])
    assert {line[0] for line in table.rows} == {"walk_x4"}
    ended = {line[1]: line[2] for line in table.rows}
    assert ended == {"simulation": "converged", "skinning": "bounded", "snug": "bounded"}
    assert study_tables.hard_aftermath(rows) is None
    rows = hard_motions.do_case(None, lambda _: None, SMOKE, stage.networks, "root_glitch")
    assert all(None not in line[2:5] and line[5] is None for line in study_tables.hard_aftermath(rows).rows)
    assert study_tables.hard_motions([]) is study_tables.laws([]) is study_tables.dependence([]) is None
