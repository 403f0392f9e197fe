"""The simulator's own benchmark: its command, the Cholesky packages, and what it says of other simulators."""

from __future__ import annotations

import csv
import os
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import parts
from benchmarks.solver_speed import barrier, linear, peers
from benchmarks.solver_speed.__main__ import PARTS, main
from benchmarks.solver_speed.cholesky_packages import PACKAGES
from benchmarks.solver_speed.peer_energies import StableNeoHookean, UnequalSprings, spring_stiffness
from benchmarks.solver_speed.sheet import DT, regular_sheet
from reference_sim import Potential
from reference_sim.energies import StretchStVK


@pytest.fixture(scope="module")
def hessians():
    return linear.hessians(3)


def test_help_lists_every_part():
    command = [sys.executable, "-m", "benchmarks.solver_speed", "--help"]
    said = subprocess.run(command, capture_output=True, text=True, check=True)
    assert all(f"  {part} " in said.stdout for part in PARTS) and said.stderr == ""


@pytest.mark.parametrize("wrong", [["--parts", "sheet,nonsense"], ["--parts", "linear", "--repeats", "0"]])
def test_a_wrong_word_is_one_line_and_exit_2(wrong, capsys):
    assert main(wrong) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert "nonsense" in said.err or "--repeats" in said.err


def test_the_command_runs_a_case_in_its_own_process_and_writes_its_rows(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(linear, "CASES", ("2 x 2 cells",))
    assert main(["--parts", "linear", "--repeats", "1", "-o", str(tmp_path)]) == 0
    with (tmp_path / "solver_speed.csv").open(newline="") as file:
        rows = {row["metric"]: row for row in csv.DictReader(file)}
    assert rows["unknowns"]["value"] == "21"
    assert float(rows["CHOLMOD, METIS: factorise"]["value"]) > 0
    assert rows["CHOLMOD, METIS: factorise"]["unit"] == "ms"
    assert float(rows["peak memory of the process"]["value"]) > 1
    assert "CHOLMOD, METIS: factorise" in capsys.readouterr().out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["solver_speed.csv", "solver_speed.json"]


def die(*_):
    os._exit(7)


def test_a_case_whose_process_dies_is_a_row(monkeypatch):
    monkeypatch.setattr(parts, "_report", die)
    assert parts._in_own_process("linear", "one", None) == [("failed", "the process ended with status 7", "")]


def test_frames_with_an_intersection_are_counted():
    """A sheet beside the ball, through the ball, and folded through itself."""
    pytest.importorskip("ipctk")
    scene = barrier.sheet_on_ball("sheet, 6 x 6")
    sheet, faces = scene.start, scene.cloth.faces
    through = sheet - [0.0, sheet[:, 1].mean(), 0.0]
    folded = sheet + np.array([0.0, 1.0, 0.0])
    right = folded[:, 0] > 0.05  # turned back over the left half, from below it to above it
    folded[right] = folded[right] * [-1, 1, 1] + np.outer(folded[right, 0] - 0.12, [0, 0.5, 0])
    positions = np.stack([sheet, through, folded])
    counts = [barrier.crossings(positions, faces, scene.obstacle, itself=itself) for itself in (False, True)]
    assert counts == [1, 1]
    assert barrier.crossings(positions[:1], faces, scene.obstacle, itself=False) == 0


def test_a_barrier_stands_in_the_place_of_the_penalty():
    pytest.importorskip("ipctk")
    scene = barrier.sheet_on_ball("sheet, 6 x 6")
    for contact, self_contact in (("barrier", False), ("barrier, self-contact", True)):
        *others, last = barrier.with_contact(scene, contact)
        assert [e.name for e in others] == ["strain", "bending", "gravity"]
        assert last.parameters()["self_contact"] is self_contact
    assert [e.name for e in barrier.with_contact(scene, "penalty")][-1] == "collision"


def test_one_hessian_is_positive_definite_and_the_other_is_not(hessians):
    pattern, definite, indefinite = hessians
    assert np.linalg.eigvalsh(pattern.symmetric(definite).toarray())[0] > 0
    assert np.linalg.eigvalsh(pattern.symmetric(indefinite).toarray())[0] < 0


@pytest.mark.parametrize("name", PACKAGES)
def test_every_package_solves_as_dense_numpy_does(name, hessians):
    pattern, definite, indefinite = hessians
    install, build = PACKAGES[name]
    try:
        solver = build(pattern.indptr, pattern.indices)
    except ImportError:
        pytest.skip(f"needs {install}")
    b = np.random.default_rng(0).normal(size=pattern.size)
    dense = pattern.symmetric(definite).toarray()
    for _ in range(2):  # again after a failure
        assert solver.factorise(definite)
        x = solver.solve(b)
        assert np.abs(dense @ x - b).max() < 1e-14 * np.linalg.cond(dense) * np.abs(b).max()
        assert not solver.factorise(indefinite)


def test_an_absent_package_is_one_row(monkeypatch):
    monkeypatch.setitem(sys.modules, "qdldl", None)
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    linear_rows = linear.measure("2 x 2 cells", 1)
    of = {name: [row for row in linear_rows if row[0].startswith(name)] for name in PACKAGES}
    assert of["qdldl"] == [("qdldl", "absent: pip install qdldl", "")]
    assert of["CHOLMOD, AMD"][-1] == ("CHOLMOD, AMD: not positive definite", "reported", "")
    errors = [value for metric, value, _ in linear_rows if metric.endswith("backward error")]
    assert len(errors) >= 3 and max(errors) < 1e-15


@pytest.mark.parametrize("case", peers.CASES)
def test_without_newton_there_is_one_row(case, monkeypatch):
    monkeypatch.setitem(sys.modules, "newton", None)
    monkeypatch.setitem(sys.modules, "warp", None)
    assert peers.measure(case, 1) == [("newton", "absent: pip install -e .[peers]", "")]


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
    pytest.importorskip("newton", reason="needs the extra `peers`")
    from benchmarks.solver_speed.newton_peer import build_model

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
    scale = length if solver == "VBD" else 2 * cloth.areas.mean()
    assert ke[inner] * scale == pytest.approx(cloth.material.bending_stiffness, rel=1e-5)
    if solver == "XPBD":
        assert model.spring_count == len(cloth.edges)
        assert model.spring_stiffness.numpy() == pytest.approx(spring_stiffness(cloth), rel=1e-6)


@pytest.mark.slow  # newton compiles its kernels at first use
@pytest.mark.parametrize(
    "solver, iterations, dt", [("VBD", 1000, DT), ("XPBD", 300, DT / 16)], ids=["VBD", "XPBD"]
)
def test_newton_descends_the_energy_that_we_say_it_does(solver, iterations, dt):
    """Many iterations of one step end within float32 of the minimum that our Newton finds in float64."""
    pytest.importorskip("newton", reason="needs the extra `peers`")
    from benchmarks.solver_speed.newton_peer import Peer

    fall = peers.Fall(regular_sheet(6))
    for _ in range(8):
        fall.step()
    judge = peers.Judge(fall)
    x, v = (a.astype(np.float32).astype(np.float64) for a in (fall.x, fall.v))
    potential: Potential = judge.own(solver, dt)
    problem = peers.Problem(potential, x, v, dt)
    problem.descend(problem.guess)
    at_start = problem.gap(problem.guess)
    found = Peer(judge.cloth, solver, iterations=iterations).advance(x, v, dt).x
    assert (found[judge.cloth.pins] == x[judge.cloth.pins]).all()
    assert 0 <= problem.gap(found) + 1e-12 < 1e-5 * at_start
