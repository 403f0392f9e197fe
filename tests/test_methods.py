"""Every method on every scene, tiny: a whole trajectory or an explained skip; and what metrics make of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.cell import run_cell
from benchmarks.evaluate import measure_scene
from benchmarks.ground_truth import settle, simulate_motion
from benchmarks.methods import METHODS
from benchmarks.plan import Cell
from benchmarks.presets import find_preset
from benchmarks.results import RunFolder
from benchmarks.rows import clock_costs, model_costs, rows_of
from benchmarks.scenes import SMALL_SCENES, dressed_scene
from benchmarks.training import train_network
from benchmarks.wardrobe import embedded_motions, open_wardrobe
from reference_sim import Trajectory

TINY = dataclasses.replace(find_preset("smoke"), frames=16, settle_frames=4, sheet_cells=4, sheet_frames=5)
TRAIN, TEST = "arm_raise", "kick"
KINDS = ("untrained", "snug", "supervised", "pbns")


def silent(units: int) -> None:
    assert units >= 0


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return RunFolder(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def wardrobe():
    return open_wardrobe(TINY, embedded_motions([TRAIN, TEST]))


@pytest.fixture(scope="module")
def trained(run, wardrobe):
    simulated = simulate_motion(wardrobe, silent, dressed_scene(TRAIN), TINY, run.path)
    assert simulated.whole and simulated.frames == TINY.frames and simulated.seconds > 0
    motions = {TRAIN: run.path / simulated.files[0]}
    return {kind: train_network(wardrobe, silent, kind, 0, 2, motions, run.path, "cpu") for kind in KINDS}


@pytest.fixture(scope="module")
def outcomes(run, wardrobe, trained):
    """Of each scene: the built scene and the outcome of every method."""
    settle(wardrobe, silent, dressed_scene(TEST), TINY, run.path)
    found = {}
    for scene in (*SMALL_SCENES, dressed_scene(TEST)):
        built = scene.build(TINY, wardrobe)
        if scene.dressed:
            start = np.load(run.start_path(scene.name))
            built = dataclasses.replace(built, settle=lambda start=start: start)
        found[scene.name] = built, [
            run_cell(Cell(scene, m.name, 0, ("garments", "speed")), m, built, run, device="cpu")
            for m in METHODS
        ]
    return found


SCENES = [scene.name for scene in SMALL_SCENES] + [f"dressed/{TEST}"]


@pytest.mark.parametrize("name", SCENES)
def test_every_method_gives_a_whole_trajectory_or_a_reason(name, outcomes, run):
    built, found = outcomes[name]
    for outcome in found:
        if outcome.status == "skipped":
            assert outcome.reason and built.dressed is None
            continue
        assert outcome.status == "ok", f"{outcome.cell.label}: {outcome.reason}"
        trajectory = Trajectory.load(run.trajectory_path(name, outcome.cell.method))
        assert trajectory.positions.shape == (built.frames, *built.cloth.rest_positions.shape)
        assert np.isfinite(trajectory.positions).all() and np.array_equal(trajectory.faces, built.cloth.faces)
        seconds = trajectory.frame_seconds[1:]
        assert (seconds > 0).all() and seconds.sum() <= outcome.seconds[0]
        assert trajectory.provenance["scene"] == name
    assert sum(outcome.recorded for outcome in found) == (10 if built.dressed else 5)


def test_dressed_rows_hold_every_metric_and_small_ones_what_they_have(outcomes, run, trained):
    expected = {"cost/frame", "curvature/mean", "energy/total", "gap/relative"}
    for name, (built, found) in outcomes.items():
        recorded = [outcome for outcome in found if outcome.recorded]
        costs = [model_costs(trained.get(outcome.cell.method), 7.0) for outcome in recorded]
        metrics = measure_scene(recorded, built, run, gap_samples=2)
        for outcome, measured, cost in zip(recorded, metrics, costs):
            values = measured | clock_costs(outcome) | cost
            assert {f"energy/{term}" for term in built.terms} | expected <= set(values)
            assert ("penetration/vertices" in values) == (built.obstacle is not None)
            assert ("distance/rms" in values) == (outcome.cell.method != "simulation")
            network = outcome.cell.method in KINDS
            assert ("cost/train" in values) == ("dynamics/held_difference" in values) == network
            if network:
                assert values["cost/data"] == (7.0 if outcome.cell.method == "supervised" else 0.0)
            assert all(row.status == "ok" for row in rows_of(outcome, values)), (name, values)
        gaps = {o.cell.method: m["gap/relative"] for o, m in zip(recorded, metrics)}
        assert gaps["simulation"] == pytest.approx(0.0, abs=1e-6)


def test_the_settled_shirt_is_at_rest_outside_of_the_body(outcomes):
    built, _ = outcomes[f"dressed/{TEST}"]
    distance = built.obstacle.signed_distance(built.start, 0)
    assert (distance < -0.002).mean() < 0.02 and np.median(distance) < 0.1
    assert np.abs(built.origin_heights - 0.9).max() < 0.4


def test_skinning_is_the_network_that_starts_at_zero_offsets(outcomes, run):
    """PBNS after two steps has moved by little from skinning, its start: both stand on one skinning."""
    name = f"dressed/{TEST}"
    skinned = Trajectory.load(run.trajectory_path(name, "skinning")).positions
    pbns = Trajectory.load(run.trajectory_path(name, "pbns")).positions
    assert 0.0 < np.linalg.norm(pbns - skinned, axis=2).max() < 0.01
