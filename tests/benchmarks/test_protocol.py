"""The protocol: recorded digests hold, a changed definition is seen, and rows say whose their scene is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.plan.plan import make_plan, protocol_of, protocol_of_case
from benchmarks.provenance import digest
from benchmarks.results import protocol as recorded
from benchmarks.results.protocol import DIGESTS, NUMBER, OWN
from reference_sim.material import Material
from snug.motion.library import make_motion
from tests.benchmarks import protocol_definitions as protocol
from tests.benchmarks.plan.planned import study_with


@pytest.fixture(scope="module")
def parts():
    return {part: make() for part, make in protocol.PARTS.items()}


def test_the_recorded_digests_are_those_of_the_code(parts):
    digests = {part: digest(content) for part, content in parts.items()}
    changed = {part: digests[part] for part in digests if digests[part] != DIGESTS.get(part)}
    assert changed == {}, (
        f"no longer protocol {NUMBER}: set DIGESTS (benchmarks/results/protocol.py) anew, raise NUMBER "
        "unless something was only added, and write down what changed in docs/protocol.md and CHANGELOG.md"
    )
    assert list(DIGESTS) == list(parts) and digest(DIGESTS) == recorded.DIGEST


def _motion_of_one_more_degree(name):
    motion = make_motion(name)
    poses = motion.poses.copy()
    poses[3, 5, 0] += np.radians(1.0 if name == "push_recovery" else 0.0)
    return dataclasses.replace(motion, poses=poses)


@pytest.mark.parametrize(
    ("part", "place", "name", "value"),
    [
        ("motions", "snug.motion.library", "make_motion", _motion_of_one_more_degree),
        ("materials", "reference_sim.material", "Material", lambda: Material(bending_stiffness=4e-5)),
        ("metrics", "benchmarks.metrics", "declared", dict),
        ("reference", f"{protocol.__name__}.Newton.__init__", "__kwdefaults__", {"tolerance": 1e-5}),
        ("sampling", "benchmarks.metrics.surface_distance", "SAMPLED_FRAMES", 24),
        ("statistics", "benchmarks.results.protocol", "TIE", 0.1),
    ],
)
def test_a_changed_definition_changes_its_digest(monkeypatch, part, place, name, value):
    monkeypatch.setattr(f"{place}.{name}", value)
    assert digest(protocol.PARTS[part]()) != DIGESTS[part]


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"scenes": ("flag",)}, NUMBER),
        ({"scenes": ("tshirt/dance_turn", "tshirt/07_02")}, NUMBER),
        ({"scenes": ("tshirt/dance_turn",), "sizes": {"frames": 20}}, OWN),
        ({"scenes": ("tshirt/kick",), "methods": ("simulation", "snug")}, NUMBER),
        ({"scenes": ("tshirt/dance_turn",), "validation_motions": ("05_04",), "methods": ("snug",)}, OWN),
    ],
)
def test_a_row_is_of_the_protocol_where_scene_and_settings_are(tmp_path, fields, expected):
    plan = make_plan(study_with(**{"methods": "simulation", **fields}), folder=tmp_path / "run")
    assert {protocol_of(cell, plan) for cell in plan.cells} == {expected}


def test_a_scene_of_another_size_and_a_users_case_are_own(tmp_path):
    plan = make_plan(study_with(scenes="flag", methods="simulation"), folder=tmp_path / "run")
    cell = plan.cells[0]
    other = dataclasses.replace(cell.scene, options={**cell.scene.options, "sheet_cells": 99})
    assert protocol_of(dataclasses.replace(cell, scene=other), plan) == OWN
    assert protocol_of_case("measured/percentile", "check") == OWN
