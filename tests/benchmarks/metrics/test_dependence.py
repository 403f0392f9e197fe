"""Dependence on mesh and time step: the same measures for each, and which scenes a preset asks for."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.assets import Assets
from benchmarks.methods import find_method
from benchmarks.metric import RollOut, SceneRollOuts
from benchmarks.presets import Dependence, find_preset
from benchmarks.runner.measurements import measured
from benchmarks.scenes import find_scene
from snug.body.parametric_body import Body

SIZES = Dependence((200,), 200, (1, 2), 4, 4)
SCENES = ("dependence/mesh/200", "dependence/dt/60")


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
        group = SceneRollOuts(scene)
        for method in ("simulation", "skinning", "newton-1"):
            made = find_method(method).make(models=None, seed=0)
            made.prepare(scene)
            group.roll_outs.append(RollOut(group, find_method(method), made.run(), suites=("validation",)))
        for roll_out in group.roll_outs:
            metrics, _, ended = measured(roll_out, find_scene(name).metrics)
            assert ended == ("ok", "") and not any(metric.startswith("cost/") for metric in metrics)
            value |= {(name, roll_out.entry.name, metric): number for metric, number in metrics.items()}
    for name in SCENES:
        assert abs(value[name, "simulation", "mesh/vertices"] - 200) < 40
        assert value[name, "newton-1", "curvature/error"] > 0
        assert (name, "simulation", "curvature/error") not in value
        assert (name, "skinning", "mesh/vertices") not in value
    # Skinning knows no time step; the simulation does.
    for metric in ("energy/strain", "energy/inertia", "curvature/mean"):
        mesh_number, step_number = (value[name, "skinning", metric] for name in SCENES)
        assert mesh_number == step_number
    strains = [value[name, "simulation", "energy/strain"] for name in SCENES]
    assert strains[0] != strains[1]


def test_time_steps_of_a_frame_are_taken_from_the_scene(assets):
    taken, scene = [], built("dependence/dt/60", assets)
    scene = dataclasses.replace(scene, settle=lambda: scene.cloth.rest_positions)
    for method in ("simulation", "newton-1", "simulation-dt/4"):
        made = find_method(method).make(models=None, seed=0)
        made.prepare(scene)
        taken.append(made.stepper.substeps)
    assert taken == [2, 2, 8]  # so many for each of those that a method takes by itself
