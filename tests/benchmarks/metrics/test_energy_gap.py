"""The gap to the minimum of the own step, and the one-step errors: known answers and an oracle of its own.

The oracle is dense: the step's objective in torch from the formulas, minimised by scipy. It shares no
code with the metric nor with the simulator.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
import torch
from scipy.optimize import minimize

from benchmarks.metrics import energy
from benchmarks.metrics import energy_gap as module
from benchmarks.metrics.curvature import curvature_error, curvature_series
from benchmarks.metrics.energy import first_guess
from benchmarks.metrics.energy_gap import gap_scale, optimality, spread_evenly
from reference_sim import Potential, minimise
from reference_sim.energies import Inertia, Step
from tests.benchmarks.runner.tasks_by_hand import grouped, prepared, simulated, small_scene

YOUNG, POISSON, THICKNESS, DENSITY, BENDING, G = 70e3, 0.485, 0.47e-3, 426.0, 3.96e-5, 9.81


class DenseStep:
    """The objective of one backward-Euler step of a sheet under gravity, all of it from the formulas."""

    def __init__(self, rest: np.ndarray, faces: np.ndarray, pins: list[int], dt: float) -> None:
        self.rest, self.faces, self.dt = torch.tensor(rest), torch.tensor(faces), dt
        a, b, c = (self.rest[self.faces[:, k]] for k in range(3))
        self.areas = 0.5 * torch.linalg.norm(torch.linalg.cross(b - a, c - a), dim=1)
        self.masses = torch.zeros(len(rest), dtype=torch.float64)
        for k in range(3):
            self.masses.index_add_(0, self.faces[:, k], self.areas * DENSITY * THICKNESS / 3)
        e = (b - a) / torch.linalg.norm(b - a, dim=1, keepdim=True)
        across = (c - a) - ((c - a) * e).sum(1, keepdim=True) * e
        f = across / torch.linalg.norm(across, dim=1, keepdim=True)
        flat = torch.stack(
            [torch.stack([(v * e).sum(1), (v * f).sum(1)], dim=1) for v in (b - a, c - a)], dim=2
        )
        self.inverse = torch.linalg.inv(flat)
        self.lame = (
            THICKNESS * YOUNG * POISSON / (1 - POISSON**2),
            THICKNESS * YOUNG / (2 * (1 + POISSON)),
        )
        self.hinges, self.scale = self._hinges()
        self.free = np.setdiff1d(np.arange(len(rest)), pins)

    def _hinges(self) -> tuple[torch.Tensor, torch.Tensor]:
        pairs: dict[tuple[int, int], list[int]] = {}
        for number, face in enumerate(self.faces.tolist()):
            for i, j in itertools.combinations(sorted(face), 2):
                pairs.setdefault((i, j), []).append(number)
        rows, scale = [], []
        for (i, j), pair in pairs.items():
            if len(pair) == 2:
                tips = [next(v for v in self.faces[n].tolist() if v not in (i, j)) for n in pair]
                rows.append([i, j, *tips])
                squared = float(((self.rest[i] - self.rest[j]) ** 2).sum())
                scale.append(squared / (4 * float(self.areas[pair].sum())))
        return torch.tensor(rows), torch.tensor(scale, dtype=torch.float64)

    def energy(self, x: torch.Tensor, x_hat: torch.Tensor) -> torch.Tensor:
        """[J] of positions (V,3) [m]."""
        a, b, c = (x[self.faces[:, k]] for k in range(3))
        gradient = torch.stack([b - a, c - a], dim=2) @ self.inverse
        strain = 0.5 * (gradient.mT @ gradient - torch.eye(2, dtype=x.dtype))
        lam, mu = self.lame
        trace = strain.diagonal(dim1=1, dim2=2).sum(1)
        membrane = (self.areas * (0.5 * lam * trace**2 + mu * (strain**2).sum((1, 2)))).sum()
        p, q, left, right = (x[self.hinges[:, k]] for k in range(4))
        normals = torch.linalg.cross(q - p, left - p), torch.linalg.cross(right - p, q - p)
        along = (q - p) / torch.linalg.norm(q - p, dim=1, keepdim=True)
        sine = (torch.linalg.cross(*normals) * along).sum(1)
        angle = torch.atan2(sine, (normals[0] * normals[1]).sum(1))
        bending = 0.5 * BENDING * (self.scale * angle**2).sum()
        gravity = G * (self.masses * x[:, 1]).sum()
        inertia = (self.masses * ((x - x_hat) ** 2).sum(1)).sum() / (2 * self.dt**2)
        return membrane + bending + gravity + inertia

    def minimum(self, start: np.ndarray, x_hat: np.ndarray) -> tuple[float, np.ndarray]:
        """Energy [J] and place (V,3) [m] of the minimum that a trust-region method finds from `start`."""
        hat = torch.tensor(x_hat)

        def spread_out(y: torch.Tensor) -> torch.Tensor:
            x = torch.tensor(start)
            return x.index_put((torch.tensor(self.free),), y.reshape(-1, 3))

        def of(y: torch.Tensor) -> torch.Tensor:
            return self.energy(spread_out(y), hat)

        def value(y: np.ndarray) -> tuple[float, np.ndarray]:
            z = torch.tensor(y, requires_grad=True)
            energy = of(z)
            (slope,) = torch.autograd.grad(energy, z)
            return energy.item(), slope.numpy()

        optimum = minimize(
            value, start[self.free].ravel(), jac=True, method="trust-exact", options={"gtol": 1e-11},
            hess=lambda y: torch.autograd.functional.hessian(of, torch.tensor(y), vectorize=True).numpy(),
        )  # fmt: skip
        return float(optimum.fun), spread_out(torch.tensor(optimum.x)).numpy()


@pytest.mark.parametrize("name", ["newton-1", "lbfgs-5", "xpbd-40"])
def test_gap_and_one_step_errors_are_those_of_an_independent_dense_minimisation(name):
    scene = small_scene("hanging_sheet", cells=3)
    x = prepared(name, scene).run().positions[:6]
    step = DenseStep(scene.cloth.rest_positions, scene.cloth.faces, list(scene.cloth.pins), scene.dt)
    gaps, distances, curvatures = [], [], []
    for frame in range(2, len(x)):
        x_hat = 2 * x[frame - 1] - x[frame - 2]
        guess = x_hat.copy()
        guess[scene.cloth.pins] = x[frame][scene.cloth.pins]
        below, y = step.minimum(x[frame], x_hat)
        lowest = min(below, step.minimum(guess, x_hat)[0])
        gaps.append(float(step.energy(torch.tensor(x[frame]), torch.tensor(x_hat))) - lowest)
        distances.append(1e3 * np.sqrt(((x[frame] - y) ** 2).sum(1).mean()))
        pair = (curvature_series(z[None], scene.cloth.faces) for z in (x[frame], y))
        curvatures.append(curvature_error(*pair)[0])
    metrics = optimality(scene, x, samples=99).metrics()
    assert min(gaps) > 1e-9
    assert metrics["gap/energy"].value == pytest.approx(np.mean(gaps), rel=1e-6)
    assert metrics["step/distance"].value == pytest.approx(np.mean(distances), rel=1e-4)
    assert metrics["step/curvature"].value == pytest.approx(np.mean(curvatures), rel=1e-4)


def values(metrics):
    return {name: getattr(number, "value", number) for name, number in metrics.items()}


@pytest.mark.parametrize("name", ["hanging_sheet", "sheet_on_sphere"])
def test_the_gap_is_zero_for_the_reference_and_falls_with_the_iterations(name):
    scene = small_scene(name)

    def judged(**options):
        positions = simulated(scene, frames=10, **options).positions
        return values(optimality(scene, positions, samples=99).metrics())

    whole, some, one = judged(), judged(max_iterations=8), judged(max_iterations=1)
    for metric in ("gap/energy", "gradient/norm", "step/distance"):
        assert 0.0 <= whole[metric] < 1e-6 < some[metric] < one[metric], metric
    assert 0.0 <= whole["step/curvature"] < 1e-6 < some["step/curvature"]
    x = [scene.start, scene.start]
    assert optimality(scene, np.array(x), samples=3).metrics() == {}
    if scene.obstacle is not None:
        # Planes searched at the end of the step are others than those at its beginning.
        assert whole["gap/refrozen"] > 10.0 * whole["gap/energy"]
        assert judged(refreeze=1)["gap/refrozen"] < 0.1 * whole["gap/refrozen"]
    else:
        assert "gap/refrozen" not in whole


def test_one_scale_serves_all_methods_of_a_scene():
    """The scale is the mean energy of first guess minus reference step; a method's history does not enter."""
    scene = small_scene("hanging_sheet", cells=4)
    x = simulated(scene, frames=8).positions
    wild = x + 0.05 * np.random.default_rng(0).standard_normal(x.shape)
    group = grouped(scene, {"simulation": x, "newton-1": wild})
    scale, potential = gap_scale(group), Potential([*scene.energies, Inertia(scene.cloth, scene.dt)])
    above = []
    for frame in range(2, 8):
        velocity = (x[frame - 1] - x[frame - 2]) / scene.dt
        guess = first_guess(scene, x[frame - 1], velocity, frame)
        potential.prepare(Step(x[frame - 1], velocity, guess, scene.dt, None, frame))
        above.append(potential.value(guess) - potential.value(x[frame]))
    assert scale == pytest.approx(np.mean(above), rel=1e-12)
    for roll_out in group.roll_outs:
        metrics = values(module.measure(roll_out))
        assert metrics["gap/relative"] == pytest.approx(metrics["gap/energy"] / scale, rel=1e-12)
        assert ("gap/scale" in metrics) == (roll_out is group.reference)
        away = module.series(roll_out)["step/vertices"]
        assert away.shape == x.shape[:2] and np.isnan(away[: scene.warm_up]).all()
        rms = np.sqrt((away[scene.warm_up :] ** 2).mean(axis=1))
        assert rms.mean() == pytest.approx(metrics["step/distance"], rel=1e-5, abs=1e-9)
    assert gap_scale(grouped(scene, {})) is None


@pytest.mark.parametrize("scale", [-0.5, float("nan"), 0.0])
def test_a_reference_above_the_first_guess_has_no_scale_and_gaps_are_measured(scale):
    scene = small_scene("hanging_sheet", cells=4)
    x = np.array([scene.start + 0.02 * k**2 for k in range(4)])
    without_scale = optimality(scene, x, samples=1).metrics()
    assert optimality(scene, x, samples=1, scale=scale).metrics() == without_scale


def test_every_judged_frame_counts_and_those_of_the_warm_up_do_not():
    scene = small_scene("hanging_sheet", cells=4)
    x = simulated(scene, frames=9).positions.copy()
    x[4] += 1e-3
    all_of = optimality(scene, x, samples=99)
    assert len(all_of.values["gap/energy"]) == 7 and all_of.metrics()["gap/energy"].uncertainty == 0.0
    later = dataclasses.replace(scene, warm_up=7)  # frames 4 to 6 feel the moved one; 7 and 8 do not
    assert optimality(later, x, samples=99).metrics()["gap/energy"].value < 1e-9
    assert all_of.metrics()["gap/energy"].value > 1e-5
    # A frame of two steps ends at the minimum of neither.
    assert optimality(dataclasses.replace(scene, substeps=2), x, samples=99).metrics() == {}


def test_frames_are_sampled_evenly_and_until_the_mean_is_known(monkeypatch):
    assert sorted(spread_evenly(range(3, 14))) == list(range(3, 14))
    assert sorted(itertools.islice(spread_evenly(range(64)), 8)) == list(range(0, 64, 8))
    scene = small_scene("hanging_sheet", cells=4)
    x = simulated(scene, frames=40, method="newton", max_iterations=1).positions
    few, whole = (optimality(scene, x, samples=samples) for samples in (4, 99))
    value, asked = few.metrics()["gap/energy"], whole.metrics()["gap/energy"]
    assert 4 <= len(few.values["gap/energy"]) <= len(whole.values["gap/energy"]) == 38
    assert value.uncertainty <= module.PRECISION * value.value
    assert abs(value.value - asked.value) <= 4 * value.uncertainty
    monkeypatch.setattr(module, "PRECISION", 10.0)
    rough = optimality(scene, x, samples=4)
    assert len(rough.values["gap/energy"]) == 4
    expected = np.std(rough.values["gap/energy"], ddof=1) * np.sqrt((1 - 4 / 38) / 4)
    assert rough.metrics()["gap/energy"].uncertainty == pytest.approx(expected)


def test_the_gap_is_taken_to_the_lowest_minimum_found_and_distances_to_the_one_below():
    scene = small_scene("hanging_sheet", cells=12)
    crumpled = np.random.default_rng(0).uniform(-0.3, 0.3, scene.start.shape)
    crumpled[scene.cloth.pins] = scene.start[scene.cloth.pins]
    still = np.zeros_like(crumpled)
    potential = Potential([*scene.energies, Inertia(scene.cloth, scene.dt)])
    guess = first_guess(scene, scene.start, still, 2)
    potential.prepare(Step(scene.start, still, guess, scene.dt, None, 2))
    folded = minimise(potential, crumpled, "lbfgs").positions
    crumpled = folded + 1e-4 * np.random.default_rng(1).standard_normal(folded.shape)
    crumpled[scene.cloth.pins] = scene.start[scene.cloth.pins]
    low, below = minimise(potential, guess).energy, minimise(potential, crumpled, "lbfgs")
    crumpled_energy = potential.value(crumpled)
    # Several minima: the one reached from the frame itself is near, and not the best.
    assert crumpled_energy - low > 2.0 * (crumpled_energy - below.energy) > 0.0
    metrics = optimality(scene, np.array([scene.start, scene.start, crumpled]), samples=1).metrics()
    assert metrics["gap/energy"].value == pytest.approx(crumpled_energy - low, rel=1e-6)
    assert metrics["gap/local"].value == pytest.approx(crumpled_energy - below.energy, rel=1e-9)
    apart = 1e3 * np.sqrt(((crumpled - below.positions) ** 2).sum(1).mean())
    assert metrics["step/distance"].value == pytest.approx(apart, rel=1e-9)


def test_a_garment_that_collapsed_a_frame_ago_spoils_its_own_gap_alone(monkeypatch):
    """Its first guess has no energy; the minimum found from its frame has one."""
    scene = small_scene("hanging_sheet")
    still = np.repeat(scene.start[None], 3, axis=0)
    monkeypatch.setattr(energy, "first_guess", lambda scene, x, *_: np.full_like(x, np.nan))
    gaps = optimality(scene, still, samples=1)
    assert gaps.values["gap/energy"][0] >= 0.0
