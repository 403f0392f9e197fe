"""Dependence on mesh and time step: the same measures for each, and which scenes a preset asks for."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.assets import Assets
from benchmarks.presets import Dependence, find_preset
from benchmarks.runner.measurements import measure_roll_out
from benchmarks.scenes import find_scene
from snug.body.parametric_body import Body
from tests.benchmarks.runner.tasks_by_hand import grouped, prepared

SIZES = Dependence((200,), 200, (1, 2), 4, 4)
SCENES = ("dependence/mesh/200", "dependence/dt/60")
METHODS = ("simulation", "skinning", "newton-1")


@pytest.fixture(scope="module")
def assets():
    """A body; nothing of the run's own garments and motions is looked at."""
    return Assets(Body.load(), {}, {}, {})


def built(name, assets):
    preset = dataclasses.replace(find_preset("smoke"), dependence=SIZES)
    return find_scene(name).at(preset).build(assets)


def test_each_mesh_and_time_step_is_measured_the_same_way(assets):
    value = {}
    for name in SCENES:
        scene = built(name, assets)
        positions = {method: prepared(method, scene).run().positions for method in METHODS}
        for roll_out in grouped(scene, positions, suites=("validation",)).roll_outs:
            metrics = measure_roll_out(roll_out, find_scene(name).metrics)[0]
            value |= {(name, roll_out.entry.name, metric): number for metric, number in metrics.items()}
    for name in SCENES:
        assert abs(value[name, "simulation", "mesh/vertices"] - 200) < 40
        assert value[name, "newton-1", "curvature/error"] > 0
        assert (name, "simulation", "curvature/error") not in value
        assert (name, "skinning", "mesh/vertices") not in value
    # Skinning knows no time step; the simulation does.
    of_skinning, simulated = (
        [value[name, method, "energy/strain"] for name in SCENES] for method in ("skinning", "simulation")
    )
    assert of_skinning[0] == of_skinning[1] and simulated[0] != simulated[1]


def test_time_steps_of_a_frame_are_taken_from_the_scene(assets):
    scene = built("dependence/dt/60", assets)
    scene = dataclasses.replace(scene, settle=lambda: scene.cloth.rest_positions)
    # So many for each of those that a method takes by itself.
    for name, steps in (("simulation", 2), ("newton-1", 2), ("simulation-dt/4", 8)):
        assert prepared(name, scene).stepper.substeps == steps
