"""Laws of motion that roll-outs are held to: known answers, planted breaches, what is said without input."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.methods import METHODS, find_method
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.metrics import conservation
from benchmarks.metrics.conservation import law_series
from benchmarks.plan.cell import Cell
from benchmarks.plan.plan import Plan
from benchmarks.presets import find_preset
from benchmarks.runner.rows import rows_of_cell
from benchmarks.runner.task import Outcome
from benchmarks.scene import Dressed
from benchmarks.scenes import find_scene
from reference_sim import Trajectory, simulate

SMOKE = find_preset("smoke")


def built(name):
    return find_scene(name).at(SMOKE).build()


@pytest.fixture(scope="module")
def dropped():
    """A sheet dropped onto a sphere until it has touched: scene and converged positions."""
    scene = find_scene("sheet_on_sphere").at(dataclasses.replace(SMOKE, sheet_frames=9)).build()
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
    metrics = series.metrics()
    assert set(metrics) == {
        m.name for m in conservation.CONSERVATION.metrics if m.reference_tolerance is None
    }
    assert (
        metrics["conservation/energy"]
        == metrics["conservation/energy_frames"]
        == metrics["conservation/descent_frames"]
        == 0.0
    )


def test_a_sheet_that_hovers_breaks_momentum_by_its_weight():
    """A still sheet in the air: no force holds its weight, so 100 %; a vertex lacks one vertex weight."""
    scene = built("free_fall")
    still = np.repeat(scene.start[None], 5, axis=0)
    assert scene.exact is not None
    hovering, falling = (series.metrics() for series in law_series(scene, [still, scene.exact[:5]]))
    assert hovering["conservation/momentum"] == pytest.approx(100.0, rel=1e-12)
    centre = np.average(scene.start, axis=0, weights=scene.cloth.masses)
    torque = 9.81 * scene.cloth.masses.sum() * np.hypot(centre[0], centre[2])
    assert hovering["conservation/angular"] == pytest.approx(torque, rel=1e-9)
    weights = scene.cloth.masses / scene.cloth.masses.mean()
    assert hovering["conservation/residual"] == pytest.approx(weights.max(), rel=1e-12)
    assert hovering["conservation/residual_rms"] == pytest.approx(np.sqrt((weights**2).mean() / 3), rel=1e-12)
    # To stay is allowed by energy, but it is above the guess, which is to stay too: neither is broken.
    assert hovering["conservation/energy_frames"] == hovering["conservation/descent_frames"] == 0.0
    assert (
        max(
            falling[name]
            for name in ("conservation/momentum", "conservation/angular", "conservation/residual")
        )
        < 1e-9
    )


def test_a_sheet_that_lifts_itself_breaks_energy_by_a_known_amount():
    scene = built("free_fall")
    frames = np.repeat(scene.start[None], 4, axis=0)
    frames[3, :, 1] += 0.01  # from rest: m g h, and the kinetic energy of h/dt as well
    (series,) = law_series(scene, [frames])
    mass = scene.cloth.masses.sum()
    gained = mass * 9.81 * 0.01 + 0.5 * mass * (0.01 / scene.dt) ** 2
    assert series.rise[-1] == pytest.approx(gained, rel=1e-9)
    metrics = series.metrics()
    for law in ("energy", "descent"):
        assert (
            metrics[f"conservation/{law}"] == pytest.approx(gained / 2)
            and metrics[f"conservation/{law}_frames"] == 50.0
        )
    assert series.force[-1] == pytest.approx(mass * (9.81 + 0.01 / scene.dt**2), rel=1e-9)


def test_a_fall_gives_up_what_backward_euler_takes():
    """Psi at the end of each step less that at its start and at its guess, in closed form."""
    scene = built("free_fall")
    x, dt, g, mass = scene.exact, scene.dt, 9.81, scene.cloth.masses.sum()
    (series,) = law_series(scene, [x])
    v = np.diff(x[:, 0], axis=0) / dt
    height = np.average(x[:, :, 1], axis=1, weights=scene.cloth.masses)
    end = mass * g * height[2:] + 0.5 * mass * (g * dt) ** 2
    start = mass * g * height[1:-1] + 0.5 * mass * (v[:-1] ** 2).sum(axis=1)
    assert series.rise == pytest.approx(end - start, abs=1e-12)
    assert series.climb == pytest.approx(np.full(len(end), -0.5 * mass * (g * dt) ** 2), abs=1e-12)


def test_angular_momentum_is_about_the_pelvis():
    scene = built("free_fall")
    pelvis = np.array([0.3, 1.0, -0.4])
    body = SimpleNamespace(joints=lambda betas: pelvis[None] - [[0.0, 1.0, 0.0]])
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


WORST = {m.name: m for m in conservation.CONSERVATION.metrics if m.reference_tolerance is not None}


def as_if_dressed(scene):
    """The same with a body that stands still at the origin: laws are asked of garments alone."""
    body = SimpleNamespace(joints=lambda betas: np.zeros((1, 3)))
    motion = SimpleNamespace(translations=np.zeros((scene.frames, 3)))
    return dataclasses.replace(scene, dressed=Dressed(body, None, motion))


def measured(scene, x, *, method="simulation", converged=None):
    converged = np.ones(len(x)) if converged is None else converged
    fields = {"converged": np.asarray(converged)}
    trajectory = Trajectory(x, scene.cloth.faces, np.arange(len(x)) * scene.dt, frame_fields=fields)
    group = SceneRollOuts(scene)
    group.roll_outs.append(RollOut(group, find_method(method), trajectory))
    return conservation.measure(group.roll_outs[0])


def rows(values, tmp_path):
    cell = Cell(find_scene("sheet_on_sphere").at(SMOKE), find_method("simulation"), 0, ("garments",))
    outcomes = {
        ("cell", cell.name): Outcome(result={"seconds": 1.0, "frames": 8, "peak": 1.0}, files=("x",)),
        ("metrics", cell.name): Outcome(result=values),
    }
    plan = Plan(
        preset=SMOKE, suites=("garments",), cells=(cell,), cases=(), seeds=(0,), device="cpu",
        folder=tmp_path, command="",
    )  # fmt: skip
    cell_rows = rows_of_cell(cell, plan, {}, outcomes)
    return {row.metric: row for row in cell_rows if row.metric in WORST}


def test_the_simulation_alone_is_judged_and_a_stall_is_told_from_a_lie(dropped, tmp_path):
    bare, x = dropped
    scene = as_if_dressed(bare)
    (series,) = law_series(scene, [x])
    metrics = measured(scene, x)
    judged = rows(metrics, tmp_path)
    assert set(judged) == set(WORST) and {row.status for row in judged.values()} == {"ok"}
    assert metrics["conservation/momentum_worst"] == series.force.max() / series.weight
    assert metrics["conservation/residual_worst"] == series.residual.max()
    assert metrics["conservation/energy_worst"] == 0.0  # it never rises
    for name, row in judged.items():
        assert (row.expected, row.tolerance) == (0.0, WORST[name].reference_tolerance) and row.tolerance > 0
    lie = x.copy()
    lie[-1, 7] += [0.0, 0.003, 0.002]
    row = rows(measured(scene, lie), tmp_path)["conservation/residual_worst"]
    assert row.status == "failed" and "claims to have converged" in row.reason and row.value > 1e-4
    honest = np.append(np.ones(len(x) - 1), 0.0)
    stall = rows(measured(scene, lie, converged=honest), tmp_path)
    assert {row.status for row in stall.values()} == {"ok"}
    assert measured(scene, lie, converged=honest)["conservation/residual"] > 1e-2  # it is in the mean
    assert not set(WORST) & set(measured(scene, x, converged=np.zeros(len(x))))
    assert not set(WORST) & set(measured(scene, x, method="snug")) and measured(scene, x, method="snug")


def test_a_motion_without_a_step_has_no_laws_and_no_pins_are_asked_for(dropped):
    bare, x = dropped
    scene = as_if_dressed(bare)
    assert measured(dataclasses.replace(scene, frames=2), x[:2]) == {}
    assert measured(scene, x[:5]) == {}  # it did not come to its end
    assert measured(bare, x) == {}  # no body
    finer = dataclasses.replace(scene, substeps=2)
    assert measured(finer, x) == {}  # where frames between are not kept
    pinned = as_if_dressed(built("hanging_sheet"))
    still = np.repeat(pinned.start[None], pinned.frames, axis=0)
    assert measured(pinned, still) == {}


def test_who_is_asked():
    asked = {entry.name for entry in METHODS if entry.conserving}
    assert {"simulation", "skinning", "snug", "supervised", "pbns", "snug+cleanup"} <= asked
    assert {"fast-lbfgs-10", "snug+fast-lbfgs-1"} <= asked
    assert not asked & {"untrained", "newton-1", "snug+lbfgs-1", "simulation-dt/2"}
