"""Studies: laws of roll-outs with known answers, planted breaches found, and what is said without input."""

from __future__ import annotations

import dataclasses
import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import workers
from benchmarks.methods.networks import model_path
from benchmarks.metrics.laws import UNITS, law_series
from benchmarks.plan import Cell, Plan, PlanError, choose_cells, choose_studies
from benchmarks.presets import find_preset
from benchmarks.results import Row, RunFolder
from benchmarks.scene import Dressed
from benchmarks.scenes import dressed_scene, free_fall, hanging_sheet, sheet_on_sphere
from benchmarks.studies import STUDIES, dependence, hard_motion_cases, hard_motion_stage, hard_motions, laws
from benchmarks.studies.hard_motion_cases import HARD_MOTIONS
from benchmarks.studies.hard_motion_stage import HardStage, RollOut, Trained
from benchmarks.wardrobe import open_wardrobe
from reference_sim import simulate
from reports import study_tables, words
from snug.dresser import DressedBody
from snug.motion import make_motion
from snug.rollout import roll_out
from snug.skeleton import JOINT, joint_positions, rotation_matrices
from snug.train import untrained_model
from snug.trained_model import TrainedModel

SMOKE = find_preset("smoke")


def plan_of(folder, **changes) -> Plan:
    nothing = {"suites": ("validation",), "cells": (), "checks": (), "cases": (), "train": (), "test": ()}
    return Plan(preset=SMOKE, seeds=(0,), device="cpu", folder=folder, command="", **(nothing | changes))


# --- laws -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def dropped():
    """A sheet dropped onto a sphere until it has touched: scene and converged positions."""
    preset = dataclasses.replace(SMOKE, sheet_frames=9)
    scene = sheet_on_sphere.build("sheet_on_sphere", preset)
    trajectory = simulate(
        scene.cloth, scene.energies, dt=scene.dt, frames=9, obstacle=scene.obstacle, start=scene.start
    )
    assert trajectory.status == "converged" and trajectory.frame_fields["energy/collision"][-1] > 0
    return scene, trajectory.positions


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


def test_the_simulator_keeps_every_law(dropped):
    scene, x = dropped
    (series,) = law_series(scene, [x])
    assert series.residual.shape == (7,) and series.residual.max() <= 1e-6
    assert series.force.max() / series.weight <= 2e-6 and series.torque.max() <= 1e-6
    assert (series.rise < 0).all() and (series.climb < 0).all()
    found = series.metrics()
    assert set(found) == set(UNITS)
    assert found["law/energy"] == found["law/energy_frames"] == found["law/descent_frames"] == 0.0


def test_a_sheet_that_hovers_breaks_momentum_by_its_weight():
    """A still sheet in the air: no force holds its weight, so 100 %; a vertex lacks one vertex weight."""
    scene = free_fall.build("free_fall", SMOKE)
    still = np.repeat(scene.start[None], 5, axis=0)
    assert scene.exact is not None
    hovering, falling = (series.metrics() for series in law_series(scene, [still, scene.exact[:5]]))
    assert hovering["law/momentum"] == pytest.approx(100.0, rel=1e-12)
    centre = np.average(scene.start, axis=0, weights=scene.cloth.masses)
    torque = 9.81 * scene.cloth.masses.sum() * np.hypot(centre[0], centre[2])
    assert hovering["law/angular"] == pytest.approx(torque, rel=1e-9)
    weights = scene.cloth.masses / scene.cloth.masses.mean()
    assert hovering["law/residual"] == pytest.approx(weights.max(), rel=1e-12)
    assert hovering["law/residual_rms"] == pytest.approx(np.sqrt((weights**2).mean() / 3), rel=1e-12)
    # To stay is allowed by energy, but it is above the guess, which is to stay too: neither is broken.
    assert hovering["law/energy_frames"] == hovering["law/descent_frames"] == 0.0
    assert max(falling[name] for name in ("law/momentum", "law/angular", "law/residual")) < 1e-9


def test_a_sheet_that_lifts_itself_breaks_energy_by_a_known_amount():
    scene = free_fall.build("free_fall", SMOKE)
    frames = np.repeat(scene.start[None], 4, axis=0)
    frames[3, :, 1] += 0.01  # from rest: m g h, and the kinetic energy of h/dt as well
    (series,) = law_series(scene, [frames])
    mass = scene.cloth.masses.sum()
    gained = mass * 9.81 * 0.01 + 0.5 * mass * (0.01 / scene.dt) ** 2
    assert series.rise[-1] == pytest.approx(gained, rel=1e-9)
    found = series.metrics()
    for law in ("energy", "descent"):
        assert found[f"law/{law}"] == pytest.approx(gained / 2) and found[f"law/{law}_frames"] == 50.0
    assert series.force[-1] == pytest.approx(mass * (9.81 + 0.01 / scene.dt**2), rel=1e-9)


def test_a_fall_gives_up_what_backward_euler_takes():
    """Psi at the end of each step less that at its start and at its guess, in closed form."""
    scene = free_fall.build("free_fall", SMOKE)
    x, dt, g, mass = scene.exact, scene.dt, 9.81, scene.cloth.masses.sum()
    (series,) = law_series(scene, [x])
    v = np.diff(x[:, 0], axis=0) / dt
    height = np.average(x[:, :, 1], axis=1, weights=scene.cloth.masses)
    end = mass * g * height[2:] + 0.5 * mass * (g * dt) ** 2
    start = mass * g * height[1:-1] + 0.5 * mass * (v[:-1] ** 2).sum(axis=1)
    assert series.rise == pytest.approx(end - start, abs=1e-12)
    assert series.climb == pytest.approx(np.full(len(end), -0.5 * mass * (g * dt) ** 2), abs=1e-12)


def test_angular_momentum_is_about_the_pelvis():
    scene = free_fall.build("free_fall", SMOKE)
    pelvis = np.array([0.3, 1.0, -0.4])
    body = SimpleNamespace(joints=lambda: pelvis[None] - [[0.0, 1.0, 0.0]])
    motion = SimpleNamespace(translations=np.tile([0.0, 1.0, 0.0], (scene.frames, 1)))
    about = dataclasses.replace(scene, dressed=Dressed(body, None, motion))
    still = np.repeat(scene.start[None], 4, axis=0)
    arm = np.average(scene.start, axis=0, weights=scene.cloth.masses) - pelvis
    (series,) = law_series(about, [still])
    weight = 9.81 * scene.cloth.masses.sum()
    assert series.torque == pytest.approx(np.full(2, weight * np.hypot(arm[0], arm[2])), rel=1e-9)
    # What falls freely has its momentum balanced about any point, whatever it does meanwhile.
    (falling,) = law_series(about, [scene.exact])
    assert falling.torque.max() < 1e-9


def test_one_moved_vertex_is_seen_by_every_law(dropped):
    scene, x = dropped
    moved = x.copy()
    moved[-1, 7] += [0.0, 0.003, 0.002]
    honest, (series,) = law_series(scene, [x])[0], law_series(scene, [moved])
    assert series.residual[-1] > 1.0 and series.force[-1] > 1e-3 and series.torque[-1] > 1e-5
    assert series.climb[-1] > honest.climb[-1]
    assert np.array_equal(series.residual[:-1], honest.residual[:-1])


def test_the_laws_are_put_in_words():
    def row(method, metric, value):
        return Row("validation", "dressed/kick", method, 0, metric, "%", value)

    rows = [row("simulation", "law/momentum", 1e-6), row("snug", "law/momentum", 203.0)]
    rows += [row("snug", "law/descent_frames", 17.0), row("simulation", "law/descent_frames", 0.0)]
    text = words.laws(rows)
    assert "203 %" in text and text.endswith("costs nothing: SNUG in 17 %.")
    assert words.laws(rows[:1]) == words.laws([]) == ""


def test_laws_are_refused_where_they_mean_nothing(dropped):
    scene, x = dropped
    with pytest.raises(ValueError, match="3 frames, not 2"):
        law_series(scene, [x, x[:2]])
    with pytest.raises(ValueError, match="pins"):
        law_series(hanging_sheet.build("hanging_sheet", SMOKE), [x])


def test_the_simulation_alone_is_judged_and_a_stall_is_told_from_a_lie(dropped):
    scene, x = dropped
    (series,) = law_series(scene, [x])
    ones = np.ones(7, dtype=bool)
    rows = [laws.judged(*check, [laws.Kept(series, ones)] * 2) for check in laws.JUDGED]
    assert [row.status for row in rows] == ["ok"] * 3
    assert rows[0].value == series.force.max() / series.weight and rows[2].value == series.residual.max()
    assert all(row.metric == "check" and row.tolerance and row.expected == 0.0 for row in rows)
    wrong = dataclasses.replace(series, residual=series.residual + 1e-3 * (np.arange(7) == 3))
    lie = laws.judged(*laws.JUDGED[2], [laws.Kept(series, ones), laws.Kept(wrong, ones)])
    assert lie.status == "failed" and "1 frames beyond" in lie.reason and lie.value > 1e-4
    stall = laws.judged(*laws.JUDGED[2], [laws.Kept(wrong, np.arange(7) != 3)])
    assert stall.status == "stalled" and "1 of 7" in stall.reason


def test_without_roll_outs_there_is_one_skipped_row(tmp_path):
    (row,) = laws.rows(plan_of(tmp_path), RunFolder(tmp_path), None)
    assert row.status == "skipped" and "garments" in row.reason and row.suite == "validation"
    assert laws.has_laws("simulation") and laws.has_laws("snug") and laws.has_laws("skinning")
    assert not laws.has_laws("untrained") and not laws.has_laws("newton-1")


# --- the frame around studies ---------------------------------------------------------------------------


def test_studies_are_chosen_as_checks_are():
    everything = choose_studies(("garments", "validation", "extremes"), [], [])
    assert everything == STUDIES and len({study.name for study in STUDIES}) == len(STUDIES)
    assert [study.name for study in choose_studies(("validation",), ["law*"], [])] == ["laws"]
    assert choose_studies(("validation",), ["free_fall"], []) == ()
    assert choose_studies(("validation",), [], ["snug"]) == ()
    assert choose_studies(("speed",), [], []) == ()
    assert pickle.loads(pickle.dumps(STUDIES)) == STUDIES


def test_what_a_study_raises_is_a_failed_row(tmp_path):
    broken = dataclasses.replace(STUDIES[0], module="benchmarks.studies.nowhere")
    (row,) = broken.run(plan_of(tmp_path), RunFolder(tmp_path), None)
    assert row.status == "failed" and "nowhere" in row.reason and row.suite == STUDIES[0].suite


def test_a_study_may_be_all_that_is_asked():
    options = {"full": True, "preset": SMOKE, "methods": (), "seeds": (0,)}
    from benchmarks.plan import Motions

    nothing = Motions((), (), {})
    chosen = choose_cells(("validation",), motions=nothing, scenes=["laws"], **options)
    assert chosen == ((), (), ())
    with pytest.raises(PlanError):
        choose_cells(("garments",), motions=nothing, scenes=["laws"], **options)


# --- dependence -----------------------------------------------------------------------------------------


def test_dependence_measures_each_mesh_and_time_step_the_same_way():
    preset = dataclasses.replace(SMOKE, frames=4, settle_frames=4, garment_vertices=200)
    told = []
    rows = dependence.of_one_mesh(None, told.append, preset, (1, 2))
    scenes = {row.scene for row in rows}
    assert scenes == {"dependence/mesh/200", "dependence/dt/60"} and sum(told) == 200 * 3
    assert {row.method for row in rows} == {"simulation", "skinning", "newton-1"}
    assert all(row.suite == "validation" and row.tolerance is None and row.status == "ok" for row in rows)
    value = {(row.scene, row.method, row.metric): row.value for row in rows}
    for scene in scenes:
        assert abs(value[scene, "simulation", "mesh/vertices"] - 200) < 40
        assert value[scene, "newton-1", "curvature/error"] > 0
        assert (scene, "simulation", "curvature/error") not in value
    # Skinning knows no time step; the simulation does.
    for metric in ("energy/strain", "energy/inertia", "curvature/mean"):
        here, there = (value["dependence/" + v, "skinning", metric] for v in ("mesh/200", "dt/60"))
        assert here == there
    own = [value["dependence/" + v, "simulation", "energy/strain"] for v in ("mesh/200", "dt/60")]
    assert own[0] != own[1]
    table = study_tables.dependence(rows)
    assert len(table.rows) == 6 and {line[0][-6:] for line in table.rows} == {"1/30 s", "1/60 s"}


def test_a_mesh_that_fails_is_a_row(tmp_path, monkeypatch):
    monkeypatch.setattr(
        workers, "run_jobs", lambda jobs, *_, **__: [workers.Failure(j.label, "x") for j in jobs]
    )
    rows = dependence.rows(plan_of(tmp_path), RunFolder(tmp_path), None)
    assert [row.status for row in rows] == ["failed"] * 2
    assert {row.scene for row in rows} == {"dependence/mesh/200", "dependence/mesh/300"}


# --- hard motions ---------------------------------------------------------------------------------------


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
    sampled, away, drift = stage.long_roll_out(network, 300, 7)
    motion, _ = hard_motion_cases.looped(walk, 300)
    trajectory = roll_out(TrainedModel.load(network.path), stage.dressed, motion)
    pelvis = stage.dressed.pelvis(motion)
    assert sampled == pytest.approx(trajectory.positions[::7] - pelvis[::7, None], abs=2e-5)
    bare = stage.skinned(motion, None)
    assert away == pytest.approx(np.linalg.norm(trajectory.positions - bare, axis=2)[::7], abs=2e-5)
    assert 0.0 <= drift < 1e-3  # the state of an untrained network is soon forgotten
    monkeypatch.setitem(hard_motions.LONG, "smoke", 300)
    rows = hard_motions.do_long(None, lambda _: None, SMOKE, stage.networks)
    assert {row.metric for row in rows} >= {"motion/drift", "motion/strain_ratio"}


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
