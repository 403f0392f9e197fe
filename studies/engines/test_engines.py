"""Engines: laws by fake engines and the reference, newton's cloth and energies, tables of the run."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import audit_tables
import engine_audit as audit
import engine_runs
import newton_cloth
from benchmarks import BuiltScene
from benchmarks.meshes import lying, rectangle
from benchmarks.plan.plan import make_plan
from benchmarks.plan.study import read_study
from engine_runs import EngineCloth, EngineDiverged, roll_out, specimen
from engines import ENGINES, REFERENCE
from newton_cloth import NewtonCloth, StableNeoHookean, UnequalSprings, build_model, spring_stiffness
from reference_sim import GRAVITY, Cloth, Material, Potential, minimise, simulate
from reference_sim.energies import BendHinge, Gravity, Inertia, Step, StretchStVK

HERE = Path(__file__).parent
PUBLISHED = HERE.parents[1] / "reports" / "published" / "engines"
DT = 1 / 30  # [s]
ROW = ("suite", "scene", "method", "metric", "unit")


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    return make_plan(read_study(str(HERE)), folder=tmp_path_factory.mktemp("engines"))


# --- laws --------------------------------------------------------------------------------------------------


class Falling(EngineCloth):
    """Free particles whose gravity and velocity are multiplied by what a fault would."""

    def __init__(self, gravity=1.0, kept=1.0):
        self.gravity, self.kept = gravity, kept

    def advance(self, x, v, dt):
        v = self.kept * (v - [0.0, self.gravity * GRAVITY * dt, 0.0])
        return x + dt * v, v


def fake(**fault):
    return dataclasses.replace(REFERENCE, substeps=4, make=lambda cloth, iterations: Falling(**fault))


def test_backward_eulers_free_fall_is_exact_and_a_halved_one_a_violation():
    exact = roll_out(fake(), specimen("falling"))
    assert audit.fall_over_discrete_law(exact) == pytest.approx(1.0, abs=1e-12)
    assert audit.fall_over_continuous_law(exact) == pytest.approx(121 / 120, abs=1e-12)
    halved = roll_out(fake(gravity=0.5), specimen("falling"))
    assert audit.fall_over_discrete_law(halved) == pytest.approx(0.5, abs=1e-12)


def test_damped_velocity_violates_momentum():
    assert audit.momentum_error(roll_out(fake(), specimen("thrown"))) < 1e-10
    n = np.arange(1, 121)
    expected = 100 * (1 - (0.998**n).mean())
    damped = audit.momentum_error(roll_out(fake(kept=0.998), specimen("thrown")))
    assert damped == pytest.approx(expected, rel=1e-9)


def test_asymmetry_is_that_of_one_moved_vertex():
    run = roll_out(fake(), specimen("hanging"))
    assert audit.asymmetry(run) < 1e-10
    moved = run.positions.copy()
    moved[5, 3, 2] += 0.1
    crooked = dataclasses.replace(run, positions=moved)
    assert audit.asymmetry(crooked) == pytest.approx(10.0 / audit.motion(crooked), rel=1e-6)


class Bouncing(EngineCloth):
    """Strip whose free part bounces as one mass on a spring; it tells `scale` times the force of its pins."""

    RATE = 20.0  # [1/s] of the spring

    def __init__(self, cloth, explicit, scale=1.0):
        self.start, self.cloth = cloth.rest_positions, cloth
        self.free = np.setdiff1d(np.arange(len(self.start)), self.cloth.pins)
        self.energies, self.explicit, self.scale = (self,), explicit, scale

    def value_and_gradient(self, x):
        force = self.cloth.masses[self.free].sum() * self.RATE**2 * self.sag(x)
        gradient = np.zeros_like(x)
        gradient[self.cloth.pins, 1] = self.scale * force / len(self.cloth.pins)
        return 0.5 * force * self.sag(x), gradient

    def sag(self, x):
        return (self.start - x)[self.free, 1].mean()

    def advance(self, x, v, dt):
        v = v.copy()
        v[self.free, 1] += dt * (self.RATE**2 * self.sag(x) - GRAVITY)
        if not self.explicit:
            v[self.free, 1] /= 1 + (dt * self.RATE) ** 2
        return x + dt * v, v


@pytest.mark.parametrize("explicit", [False, True])
def test_pins_carry_weight_and_inertia_of_a_strip_that_bounces(explicit):
    def reaction(scale):
        engine = dataclasses.replace(
            REFERENCE, substeps=20, make=lambda cloth, iterations: Bouncing(cloth, explicit, scale)
        )
        return audit.reaction_over_weight(roll_out(engine, specimen("strip")))

    assert reaction(1.0) == pytest.approx(1.0, abs=1e-9)
    cloth = specimen("strip").cloth
    free = 1.0 - cloth.masses[cloth.pins].sum() / cloth.masses.sum()
    assert reaction(1.01) == pytest.approx(1.0 + 0.01 * free, abs=1e-4)


def test_without_energies_the_reaction_is_that_of_the_centre():
    run = roll_out(fake(), specimen("strip"))
    assert audit.reaction_over_weight(run) == pytest.approx(0.0, abs=1e-9)


def test_an_engine_that_explodes_says_when():
    with pytest.raises(EngineDiverged, match="frame 1: a vertex"):
        roll_out(fake(gravity=1e9), specimen("falling"))


def test_what_compiles_in_a_late_frame_is_not_timed(monkeypatch):
    clock = [0.0]

    class Compiling(Falling):
        steps = 0

        def advance(self, x, v, dt):
            self.steps += 1
            clock[0] += 100.0 if self.steps == 40 else 1.0
            return super().advance(x, v, dt)

    monkeypatch.setattr(engine_runs.time, "process_time", lambda: clock[0])
    engine = dataclasses.replace(REFERENCE, substeps=4, make=lambda cloth, iterations: Compiling())
    assert roll_out(engine, specimen("falling")).seconds == pytest.approx(4.0)


def test_a_gap_to_a_minimum_that_was_not_found_is_no_number(monkeypatch):
    run = roll_out(fake(), specimen("hanging"))
    run.cloth.energies = (StretchStVK(run.specimen.cloth),)
    monkeypatch.setattr(audit, "minimise", lambda *given, **_: minimise(*given, max_iterations=1))
    with pytest.raises(RuntimeError, match="the minimum of a step is not known: max_iterations"):
        audit.energy_gap(run)


@pytest.mark.parametrize("sample", ["falling", "thrown", pytest.param("hanging", marks=pytest.mark.slow)])
def test_the_reference_keeps_all_laws(sample, plan):
    laws = [c for c in plan.cases if c.method == "reference" and c.options.get("sample") == sample]
    for case in laws:
        row = case.run()
        assert row.status == "ok", row.reason
        assert row.tolerance is None or abs(row.value - row.expected) < 1e-3 * row.tolerance
        assert "MIT" in row.reason and row.method == "reference"
    assert laws


def test_the_least_budget_is_one_from_which_all_are_near():
    run = roll_out(fake(), specimen("falling"))
    far = dataclasses.replace(run, positions=run.positions + 0.5 * (run.positions - run.positions[:1]))
    assert audit._within({1: far, 4: run, 16: run}) == 4
    assert audit._within({1: run, 4: far, 16: run}) is None


def test_a_budget_that_is_not_near_says_how_far_the_last_two_are_apart_and_what_was_counted(monkeypatch):
    run = roll_out(fake(), specimen("falling"))
    far = dataclasses.replace(run, positions=run.positions + 0.5 * (run.positions - run.positions[:1]))
    monkeypatch.setattr(audit, "reference_ladder", lambda substeps: {1: run, 4: far, 16: run})
    engine, differ = ENGINES["mujoco.euler"], "its last two budgets differ"
    none = "no budget is within 1 %"
    for budgets, remark, expected in (
        ({1: far, 4: run}, "", (None, none)),
        ({1: far, 4: run, 16: run}, "", (4, "")),
        ({1: far, 4: run, 16: run}, differ, (None, differ)),  # near the largest, which is not its limit
    ):
        monkeypatch.setattr(audit, "ladder", lambda name, answer=(budgets, remark): answer)
        assert audit.converged_budget.__wrapped__(engine) == expected
    assert audit.budgeted.__wrapped__(engine, 4, "distance") == (None, differ)
    for iterates, unit in ((True, "iterations a step"), (False, "steps a frame")):
        engine = dataclasses.replace(engine, iterates=iterates)
        reason = f"the reference is not within 1 % at 4 {unit}"
        assert audit.reference_milliseconds.__wrapped__(engine) == (None, reason)


def test_an_absent_engine_is_skipped_with_its_command(monkeypatch, plan):
    absent = dataclasses.replace(ENGINES["mujoco.euler"], module="no_such_package")
    monkeypatch.setitem(audit.ENGINES, "mujoco.euler", absent)
    row = next(case for case in plan.cases if case.name == "mujoco.euler.budget").run()
    assert row.status == "skipped"
    assert row.reason == "MuJoCo, Euler is not installed: pip install 'neural-garment-benchmark[engines]'"


def test_the_study_asks_for_what_was_published_each_engine_in_a_process_of_its_own(plan):
    assert {case.process for case in plan.cases} == {f"engine-{name}" for name in ENGINES}
    rows = pd.read_csv(PUBLISHED / "results.csv.gz", keep_default_na=False, low_memory=False)
    published = set(rows[rows["suite"] != "speed"][list(ROW)].itertuples(index=False, name=None))
    asked = {tuple(getattr(case, name) for name in ROW) for case in plan.cases}
    assert published <= asked and len(asked) == len(plan.cases)
    timed = {cell.method for cell in plan.cells if cell.suites == ("speed",)}
    assert {"newton-vbd", "newton-xpbd"} < timed


def test_tables_of_the_published_run_are_the_frozen_ones_and_stand_in_the_readme():
    readme = (HERE / "README.md").read_text(encoding="utf-8")
    for name, table in audit_tables.tables(pd.read_csv(PUBLISHED / "results.csv.gz")).items():
        text = table.to_csv(index=False, float_format="%.9g", na_rep="-")
        assert text == (HERE / "frozen" / f"{name}.csv").read_text(encoding="utf-8")
        assert audit_tables.markdown(table) in readme


@pytest.mark.slow
def test_mujoco_falls_as_it_should_and_its_pins_hold_the_weight():
    pytest.importorskip("mujoco", reason="needs the extra `engines`")
    engine = ENGINES["mujoco.euler"]
    fallen = audit.fall_over_discrete_law(roll_out(engine, specimen("falling")))
    assert fallen == pytest.approx(1, abs=1e-6)
    assert audit.reaction_over_weight(roll_out(engine, specimen("strip"))) == pytest.approx(1, abs=1e-6)


@pytest.mark.slow
def test_xpbds_pins_hold_the_weight_of_a_strip_that_bounces():
    pytest.importorskip("newton", reason="needs the extra `engines`")
    run = roll_out(ENGINES["newton.xpbd"], specimen("strip"))
    assert audit.reaction_over_weight(run) == pytest.approx(1, abs=1e-3)


@pytest.mark.slow
def test_style3d_damps_a_free_fall():
    """It multiplies every velocity by 0.998, so that more steps fall less far."""
    pytest.importorskip("newton", reason="needs the extra `engines`")
    run = roll_out(ENGINES["newton.style3d"], specimen("falling"))
    v, fallen = 0.0, 0.0
    for _ in range(120):
        v += GRAVITY * run.step
        fallen += v * run.step
        v *= 0.998
    assert -audit.centre(run)[-1, 1] == pytest.approx(fallen, rel=1e-3)


# --- newton ------------------------------------------------------------------------------------------------


def regular_sheet(n):
    """Return a horizontal square of 1 m of n x n vertices, pinned at two corners."""
    points, faces = rectangle("right", n - 1, n - 1, 1.0, 1.0)
    return Cloth(lying(points), faces, Material(), pins=[0, n * (n - 1)])


def test_stable_neo_hookean_meets_its_closed_form_and_stvk_at_rest():
    cloth = regular_sheet(4)
    theirs, ours = StableNeoHookean(cloth), StretchStVK(cloth)
    x = cloth.rest_positions
    value, gradient = theirs.value_and_gradient(x)
    assert abs(value) < 1e-14 and np.abs(gradient).max() < 1e-13
    # Second derivatives at rest make the mapping tri_ke = mu, tri_ka = lambda what it is.
    assert theirs.hessian_blocks(x) == pytest.approx(ours.hessian_blocks(x), rel=1e-12, abs=1e-12)
    s, t, mu, L = 1.3, 0.8, theirs.mu, theirs.lam + theirs.mu
    a = 1 + mu / L
    by_hand = mu / 2 * (s**2 + t**2 - 2) + L / 2 * ((s * t - a) ** 2 - (1 - a) ** 2)
    assert theirs.value_and_gradient(x * [s, 1, t])[0] == pytest.approx(by_hand, rel=1e-13)


def test_springs_have_the_stiffness_of_the_area_around_them():
    cloth = regular_sheet(4)
    k = spring_stiffness(cloth) / cloth.material.membrane_modulus
    ends = cloth.rest_positions[cloth.edges]
    middle = ends.mean(axis=1)
    diagonal = (np.abs(ends[:, 1] - ends[:, 0]) > 1e-9).sum(axis=1) == 2
    border = ~diagonal & ((np.abs(middle[:, [0, 2]] - 0.5) > 0.49).any(axis=1))
    assert k[diagonal] == pytest.approx(0.5) and k[border] == pytest.approx(0.5)
    assert k[~diagonal & ~border] == pytest.approx(1.0)
    springs = UnequalSprings(cloth)
    value = springs.value_and_gradient(1.1 * cloth.rest_positions)[0]
    assert value == pytest.approx(0.005 * (springs.stiffness * cloth.edge_lengths**2).sum(), rel=1e-12)


@pytest.mark.parametrize("solver", ["VBD", "XPBD"])
def test_newton_is_given_our_cloth(solver):
    pytest.importorskip("newton", reason="needs the extra `engines`")
    cloth = regular_sheet(5)
    model = build_model(cloth, solver)
    free = np.setdiff1d(np.arange(cloth.vertex_count), cloth.pins)
    mass = model.particle_mass.numpy()
    assert mass[free] == pytest.approx(cloth.masses[free], rel=1e-6) and (mass[cloth.pins] == 0).all()
    assert model.gravity.numpy().ravel()[:3] == pytest.approx([0, -9.81, 0])
    assert model.tri_areas.numpy() == pytest.approx(cloth.areas, rel=1e-5)
    lame = [cloth.material.lame_mu, cloth.material.lame_lambda, 0, 0, 0]
    assert model.tri_materials.numpy() == pytest.approx(np.tile(lame, (len(cloth.faces), 1)), rel=1e-6)
    edges, ke = model.edge_indices.numpy(), model.edge_bending_properties.numpy()[:, 0]
    inner = (edges >= 0).all(axis=1)
    assert inner.sum() == len(cloth.hinges) and (ke[~inner] == 0).all()
    length = np.linalg.norm(np.diff(cloth.rest_positions[edges[inner, 2:]], axis=1)[:, 0], axis=1)
    two_areas = 2 * cloth.areas.mean()
    over = length if solver == "VBD" else two_areas
    stiffness = cloth.material.bending_stiffness * length**2 / (4 * two_areas)
    assert ke[inner] * over == pytest.approx(stiffness, rel=1e-5)
    if solver == "XPBD":
        assert model.spring_count == len(cloth.edges)
        assert model.spring_stiffness.numpy() == pytest.approx(spring_stiffness(cloth), rel=1e-6)


@pytest.mark.slow  # newton compiles its kernels at first use
@pytest.mark.parametrize(
    "solver, energy, iterations, dt",
    [("VBD", StableNeoHookean, 1000, DT), ("XPBD", UnequalSprings, 300, DT / 16)],
    ids=["VBD", "XPBD"],
)
def test_newton_descends_the_energy_that_we_say_it_does(solver, energy, iterations, dt):
    """Many iterations of one step end within float32 of the minimum that our Newton finds in float64."""
    pytest.importorskip("newton", reason="needs the extra `engines`")
    cloth = regular_sheet(6)
    start = cloth.rest_positions + np.random.default_rng(0).normal(0, 1e-4, cloth.rest_positions.shape)
    start[cloth.pins] = cloth.rest_positions[cloth.pins]
    terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
    fallen = simulate(cloth, terms, dt=DT, frames=9, start=start).positions
    x, v = (a.astype(np.float32).astype(np.float64) for a in (fallen[-1], (fallen[-1] - fallen[-2]) / DT))
    potential = Potential([energy(cloth), BendHinge(cloth), Gravity(cloth), Inertia(cloth, dt)])
    guess = x + dt * v
    potential.prepare(Step(x, v, guess, dt))
    lowest = minimise(potential, guess, max_iterations=100).energy
    positions, _ = NewtonCloth(cloth, iterations, solver).advance(x, v, dt)
    assert (positions[cloth.pins] == x[cloth.pins]).all()
    assert 0 <= potential.value(positions) - lowest + 1e-12 < 1e-5 * (potential.value(guess) - lowest)


def test_pins_move_evenly_over_the_sub_steps_of_a_frame(monkeypatch):
    """The solver is a fake that moves nothing, so it is tested without newton too."""
    pin_positions = []

    class Still:
        def __init__(self, cloth, iterations, solver):
            pass

        def advance(self, x, v, dt):
            pin_positions.append(x[scene.cloth.pins].copy())
            return x.copy(), v

    cloth, up = regular_sheet(4), np.array([0.0, 0.1, 0.0])
    handles = cloth.rest_positions[cloth.pins]
    scene = BuiltScene(
        name="lifted", cloth=cloth, energies=(Gravity(cloth),), dt=DT, frames=3,
        settle=lambda: cloth.rest_positions, pin_positions=lambda frame: handles + frame * up,
    )  # fmt: skip
    monkeypatch.setattr(newton_cloth, "NewtonCloth", Still)
    monkeypatch.setitem(sys.modules, "newton", SimpleNamespace(__version__="fake"))
    method = newton_cloth.make(models=None, seed=0, solver="VBD", iterations=1, substeps=4)
    method.prepare(scene)
    pin_positions.clear()
    trajectory = method.run()
    risen = np.array(pin_positions)[:, 0, 1] - handles[0, 1]
    assert risen == pytest.approx(0.025 * np.arange(1, 9))
    for frame in (1, 2):
        assert np.array_equal(trajectory.positions[frame][scene.cloth.pins], scene.pin_positions(frame))
