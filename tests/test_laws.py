"""Laws of motion that roll-outs are held to: known answers, planted breaches, what is said without input."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.metrics.laws import UNITS, law_series
from plans import SMOKE, plan_of

from benchmarks.results import Row, RunFolder
from benchmarks.scene import Dressed
from benchmarks.scenes import free_fall, hanging_sheet, sheet_on_sphere
from benchmarks.studies import laws
from reference_sim import simulate
from reports import words


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


def test_a_motion_without_a_step_has_no_laws_and_stops_no_other(tmp_path):
    folder = RunFolder(tmp_path)
    path = folder.trajectory_path("dressed/blink", "simulation")
    path.parent.mkdir(parents=True)
    path.touch()  # not even opened
    built = SimpleNamespace(cloth=SimpleNamespace(pins=[]), frames=2)
    scene = SimpleNamespace(dressed=True, name="dressed/blink", build=lambda preset, wardrobe: built)
    cell = SimpleNamespace(scene=scene, method="simulation", seed=0)
    plan = SimpleNamespace(scenes=[scene], cells=[cell], preset=SMOKE)
    (row,) = laws.rows(plan, folder, object())
    assert row.status == "skipped"


def test_without_roll_outs_there_is_one_skipped_row(tmp_path):
    (row,) = laws.rows(plan_of(tmp_path), RunFolder(tmp_path), None)
    assert row.status == "skipped" and "garments" in row.reason and row.suite == "validation"
    assert "three frames or more" in row.reason
    assert laws.has_laws("simulation") and laws.has_laws("snug") and laws.has_laws("skinning")
    assert not laws.has_laws("untrained") and not laws.has_laws("newton-1")
