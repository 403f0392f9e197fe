"""Own energies: the minimiser of a network's loss has no excess in them, whatever it has by the scene's."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.assets import make_motions, open_assets
from benchmarks.methods import find_method
from benchmarks.methods.own_energies import OWN_REFERENCES, STATIC, find_energies, find_own_reference
from benchmarks.methods.simulation import STATIC as AT_REST
from benchmarks.methods.simulation import Simulation
from benchmarks.metrics.own_energies import NAME, compare, measure
from benchmarks.presets import find_preset
from snug.kinds import KINDS
from tests.benchmarks.plan.planned import planned
from tests.benchmarks.runner.tasks_by_hand import dressed_scene, grouped, prepared

MOTION = "arm_raise"


@pytest.fixture(scope="module")
def scene():
    sizes = dataclasses.replace(find_preset("smoke"), frames=8, settle_frames=8, garment_vertices=300)
    assets = open_assets(sizes, make_motions([MOTION]), ["tshirt"])
    built = dressed_scene(MOTION, preset=sizes).build(assets)
    start = built.start_state
    return dataclasses.replace(built, settle=lambda: start)


@pytest.fixture(scope="module")
def simulations(scene):
    """Name -> positions of the reference, "at rest" its quasi-static twin, and of own references."""
    names = ("simulation", *(entry.name for entry in OWN_REFERENCES))
    x = {name: prepared(name, scene).run().positions for name in names}
    at_rest = Simulation(AT_REST)
    at_rest.prepare(scene)
    x["at rest"] = at_rest.run().positions
    return x


def excess(scene, simulations, name, positions):
    """Return a method's excess [%] in its own energies, and that of the same roll-out in the scene's."""
    at_rest = simulations["at rest"]
    known = {other: x for other, x in simulations.items() if other != "at rest"}
    group = grouped(scene, known | {name: positions, "skinning": positions})
    group.quasi_static = at_rest
    trained, plain = group.roll_outs[-2:]
    values = measure(trained) or compare(trained, group.reference)
    return values[NAME], compare(plain, group.reference)[NAME]


@pytest.mark.parametrize(
    "name",
    ["snug", "snug-paper", "pbns", "pbns-paper", "pbns-springs", "snug-springs", "snug-no-inertia"],
)
def test_the_minimiser_of_its_own_energies_leaves_a_network_no_excess(scene, simulations, name):
    entry = find_method(name)
    reference = find_own_reference(entry)
    usual = "at rest" if find_energies(entry) == STATIC else "simulation"
    best = simulations[reference.name if reference else usual]
    value, common = excess(scene, simulations, name, best)
    assert value == pytest.approx(0.0, abs=1e-9)
    if name in ("snug-paper", "pbns-springs"):  # another contact, other springs: no fault of a training
        assert common > 5.0
    shaken = best + 1e-3 * np.random.default_rng(0).standard_normal(best.shape)
    assert excess(scene, simulations, name, shaken)[0] > 1.0


def test_simulations_have_the_constants_that_are_trained_on(scene):
    def terms(name):
        return {term.name: term for term in prepared(f"simulation-{name}", scene).scene.energies}

    contact = terms("paper")["collision"]
    assert (contact.margin, contact.samples) == (0.002, "vertices")
    assert contact.stiffness.sum() == pytest.approx(1.34e6 * scene.cloth.areas.sum())
    hinges = terms("printed-bending")["bending"]
    assert (hinges.stiffness == scene.cloth.material.bending_stiffness).all()
    pbns = terms("pbns-springs-at-rest")
    assert pbns["spring"].stiffness == 15.0 and (pbns["bending"].stiffness == 1e-4).all()
    assert (pbns["collision"].power, pbns["collision"].margin) == (2, 4e-3)
    assert set(terms("no-gravity")) == {"strain", "bending", "collision"}


@pytest.mark.parametrize("name", ["supervised", "snug-no-strain", "snug-no-collision"])
def test_what_has_no_minimum_or_learned_vertices_has_no_own_excess(scene, simulations, name):
    assert find_energies(find_method(name)) is None and find_own_reference(find_method(name)) is None
    group = grouped(scene, {"simulation": simulations["simulation"], name: simulations["simulation"]})
    assert measure(group.roll_outs[1]) == compare(group.roll_outs[1], group.reference) == {}


def test_solvers_and_networks_of_the_scenes_energies_need_no_further_simulation():
    for name in ("newton-1", "snug+newton-1", "snug", "skinning", "handles-80", "ncs"):
        assert find_own_reference(find_method(name)) is None, name


def test_a_kind_is_static_where_its_network_carries_no_state():
    for kind in KINDS.values():
        assert kind.static is not kind.network.sequential, kind.name


def test_the_simulation_joins_where_the_network_meets_the_reference():
    def methods(*names):
        cells = planned("smoke", "--scenes", "tshirt/01_01_a", "--methods", ",".join(names)).cells
        return [cell.method for cell in cells]

    assert methods("simulation", "snug-paper") == ["simulation", "snug-paper", "simulation-paper"]
    assert methods("snug-paper") == ["snug-paper"]
    assert methods("simulation", "snug") == ["simulation", "snug"]
