"""Every method on every scene, tiny: a whole trajectory or an explained skip; and what metrics make of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from benchmarks.cell import Outcome, run_cell
from benchmarks.curves import CURVES
from benchmarks.evaluate import measure_scene
from benchmarks.ground_truth import settle, simulate_motion
from benchmarks.training import train_network
from benchmarks.wardrobe import embedded_motions, open_wardrobe

from benchmarks.methods import METHODS, find_method
from benchmarks.methods.learned import LEARNED
from benchmarks.plan import Cell, Network
from benchmarks.presets import find_preset
from benchmarks.results import RunFolder
from benchmarks.rows import clock_costs, model_costs, rows_of
from benchmarks.scenes import SMALL_SCENES, dressed_scene
from reference_sim import Trajectory

TINY = dataclasses.replace(find_preset("smoke"), frames=16, settle_frames=4, sheet_cells=4, sheet_frames=5)
TRAIN, TEST = "arm_raise", "kick"
KINDS = ("untrained", "snug", "supervised", "pbns")
# Further learned methods have tests of their own. On a body the coarsest speaks for each family of solvers.
SMALL_METHODS = [e for e in METHODS if e not in LEARNED and (e.trained is None or e.trained in KINDS)]
FINER = {name for family in CURVES.values() for name in family[1:]} - {"simulation"}
FINER |= {"simulation-dt/4", "simulation-dt/8"}
DRESSED_METHODS = [entry for entry in SMALL_METHODS if entry.name not in FINER]


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
    networks = {kind: Network(kind, 0) for kind in KINDS}
    return {
        k: train_network(wardrobe, silent, n, 2, motions, run.path, "cpu", "0") for k, n in networks.items()
    }


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
        methods = DRESSED_METHODS if scene.dressed else SMALL_METHODS
        found[scene.name] = (
            built,
            [run_cell(Cell(scene, m.name, 0, ("garments", "speed")), m, built, run) for m in methods],
        )
    return found


SCENES = [scene.name for scene in SMALL_SCENES] + [f"dressed/{TEST}"]


@pytest.mark.parametrize("name", SCENES)
def test_every_method_gives_a_whole_trajectory_or_a_reason(name, outcomes, run):
    built, found = outcomes[name]
    for outcome in found:
        if outcome.status == "skipped":
            assert outcome.reason and (built.dressed is None or find_method(outcome.cell.method).package)
            continue
        assert outcome.status == "ok", f"{outcome.cell.label}: {outcome.reason}"
        trajectory = Trajectory.load(run.trajectory_path(name, outcome.cell.method))
        assert trajectory.positions.shape == (built.frames, *built.cloth.rest_positions.shape)
        assert np.isfinite(trajectory.positions).all() and np.array_equal(trajectory.faces, built.cloth.faces)
        seconds = trajectory.frame_seconds[1:]
        assert (seconds > 0).all() and seconds.sum() <= outcome.seconds[0]
        assert trajectory.provenance["scene"] == name
    skipped = {outcome.cell.method for outcome in found if not outcome.recorded}
    bound = {entry.name for entry in METHODS if entry.needs_body or entry.package}
    assert skipped <= bound and (built.dressed is None or skipped <= {"newton-vbd", "newton-xpbd"})


def test_dressed_rows_hold_every_metric_and_small_ones_what_they_have(outcomes, run, trained):
    expected = {
        "cost/frame", "curvature/mean", "energy/total", "gap/relative", "gap/local", "gradient/norm",
        "deformation/edges", "deformation/areas", "dihedral/mean", "intersections/triangles",
    }  # fmt: skip
    against = {"distance/rms", "distance/p95", "distance/floor", "curvature/error", "curvature/histogram"}
    for name, (built, found) in outcomes.items():
        recorded = [outcome for outcome in found if outcome.recorded]
        kinds = [find_method(outcome.cell.method).trained for outcome in recorded]
        costs = [
            model_costs(kind, dataclasses.asdict(trained[kind]) if kind in trained else None, 7.0)
            for kind in kinds
        ]
        metrics = measure_scene(recorded, built, run, gap_samples=2)
        for outcome, measured, cost in zip(recorded, metrics, costs):
            values = measured | clock_costs(outcome) | cost
            assert {f"energy/{term}" for term in built.terms} | expected <= set(values)
            assert ("penetration/vertices" in values) == (built.obstacle is not None)
            assert len(against & set(values)) == (0 if outcome.cell.method == "simulation" else len(against))
            ladder = outcome.cell.method == "simulation" and built.dressed is None
            assert ({"time_error/total", "time_error/curvature"} <= set(values)) == ladder
            network = outcome.cell.method in KINDS
            assert ("cost/train" in values) == (find_method(outcome.cell.method).trained is not None)
            # What has an answer to held poses: networks, skinning, and the simulator on a body.
            on_body = built.dressed is not None
            still = network or (on_body and outcome.cell.method in ("skinning", "simulation"))
            assert ("dynamics/held_difference" in values) == still
            assert ("dynamics/amplitude" in values) == (built.dressed is not None)
            if outcome.cell.method == "simulation" and built.dressed:
                assert values["dynamics/amplitude"] == pytest.approx(1.0)
            if outcome.cell.method == "skinning":
                assert values["dynamics/amplitude"] == values["dynamics/held_difference"] == 0.0
            if network:
                assert values["cost/data"] == (7.0 if outcome.cell.method == "supervised" else 0.0)
            assert all(row.status == "ok" for row in rows_of(outcome, values)), (name, values)
        by_method = {outcome.cell.method: m for outcome, m in zip(recorded, metrics)}
        assert by_method["simulation"]["gap/local"] == pytest.approx(0.0, abs=1e-12)
        # So few frames do not drive two runs apart [mm].
        assert 0.0 < by_method["simulation-moved"]["distance/floor"] < 1e-3


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


def test_all_solvers_start_where_the_scene_starts(outcomes, run):
    for name, (built, found) in outcomes.items():
        for outcome in found:
            entry = find_method(outcome.cell.method)
            if outcome.recorded and entry.dtype == "float64":
                first = Trajectory.load(run.trajectory_path(name, entry.name)).positions[0]
                assert np.abs(first - built.start).max() <= 1.01e-9, f"{name} x {entry.name}"


def test_a_hybrid_goes_on_from_skinning_and_keeps_its_networks_time(outcomes, run):
    name = f"dressed/{TEST}"
    skinned, hybrid = (
        Trajectory.load(run.trajectory_path(name, method)) for method in ("skinning", "skinning+lbfgs-1")
    )
    built, _ = outcomes[name]
    moved = np.linalg.norm(hybrid.positions - skinned.positions, axis=2).max(axis=1)
    assert np.array_equal(hybrid.positions[0], built.start) and moved[1:].min() > 1e-4
    assert np.median(hybrid.frame_seconds[1:]) > np.median(skinned.frame_seconds[1:])
    assert hybrid.frame_fields["iterations"].tolist() == [0] + [1] * (built.frames - 1)


def test_a_roll_out_that_is_lost_is_measured_up_to_there_and_ends_no_other_ones_metrics(tmp_path):
    scene, run = next(scene for scene in SMALL_SCENES if scene.name == "hanging_sheet"), RunFolder(tmp_path)
    built = scene.build(TINY)
    falling = np.asarray(built.start) + 0.001 * np.arange(built.frames)[:, None, None]
    lost = {"simulation": (9, 0.0), "newton-1": (3, np.nan), "newton-4": (0, np.inf), "newton-8": (4, 1e200)}
    lost |= {"simulation-dt/2": (9, 0.0), "simulation-dt/4": (9, 0.0), "simulation-dt/8": (3, np.nan)}
    outcomes = []
    for method, (first, value) in lost.items():
        x = falling.copy()
        x[first:] = value
        path = run.trajectory_path(scene.name, method)
        path.parent.mkdir(parents=True, exist_ok=True)
        Trajectory(
            positions=x, faces=built.cloth.faces, times=built.dt * np.arange(len(x)),
            frame_seconds=np.full(len(x), 1e-3), status="ok",
        ).save(path)  # fmt: skip
        status = "ok" if first > len(x) else "diverged"
        outcomes.append(Outcome(Cell(scene, method, 0, ("speed",)), status, seconds=(1.0,), recorded=True))
    with np.errstate(all="ignore"):
        found = dict(zip(lost, measure_scene(outcomes, built, run, gap_samples=3)))
    assert np.isfinite(list(found["simulation"].values())).all() and found["newton-4"] == {}
    assert found["newton-1"]["distance/rms"] == 0.0 and np.isfinite(found["newton-1"]["gap/energy"])
    assert np.isnan(found["newton-8"]["gap/energy"])
    fields = Trajectory.load(run.trajectory_path(scene.name, "newton-1")).frame_fields
    assert np.isfinite(fields["energy/total"]).tolist() == [True] * 3 + [False] * 2
    assert not any(name.startswith("time_error") for name in found["simulation"])  # dt/8 was not whole
