"""The protocol: recorded digests hold, a changed definition is seen, and rows say whose their scene is.

Digests are of contents (arrays, declared values, energies of a probe), never of source code: code that is
written anew and computes the same has the same digests. What numbers depend on and no method brings is here
as values for a digest; `benchmarks.results.protocol` records number and digests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import partial
from inspect import signature
from typing import Any

import numpy as np
import pytest

from benchmarks import metrics
from benchmarks.methods.simulation import STATIC as AT_REST
from benchmarks.metrics import dynamics, energy_gap, intersections, scene_facts, surface_distance
from benchmarks.metrics.energy import energy_series
from benchmarks.plan.plan import make_plan, protocol_of, protocol_of_case
from benchmarks.presets import PRESETS, find_preset
from benchmarks.provenance import digest
from benchmarks.results import protocol as recorded
from benchmarks.results.protocol import DIGESTS, NUMBER, OWN, STARTS
from benchmarks.scenes import GARMENT_SCENES, SCENES, all_scenes, dressed_body
from reference_sim import material
from reference_sim.energies.contact_penalty import DEFAULT_MARGIN, DEFAULT_STIFFNESS
from reference_sim.minimise.newton import Newton
from reports.comparison import NOT_OF_SCENES
from snug.body.parametric_body import Body
from snug.garments.templates import find_template
from snug.motion import library
from snug.motion.motion import Motion
from snug.networks.roll_out import QUASI_STATIC_FRAMES
from snug.recipe import DEFAULT
from snug.training.simulated_data import settings_of
from tests.benchmarks.plan.planned import study_with

PRESET = "quick"  # whose sizes the meshes of the digest have
DECIMALS = 6  # [um, urad] of arrays: more may differ between processors
DIGITS = 9  # of probed energies
PROBED = ("hanging_sheet", "sheet_on_sphere")
FALL = 0.12  # [m] of the probe: onto the sphere
PATH = (0.0, 0.3, 1.0, 1.6)  # share of the fall in each frame of the probe: it accelerates
# Of a scene: prose, places of code, and an option that no declared scene takes.
OUTSIDE = ("name", "description", "module", "declared_in", "files", "self_contact")


def _scenes() -> dict[str, Any]:
    """Return declarations of all scenes, body and T-shirt, and what small scenes are built of."""
    templates = {worn.garment: find_template(worn.garment) for worn in GARMENT_SCENES}
    preset = find_preset(PRESET)
    body = Body.load()
    declared = all_scenes(
        (*library.TEST, *library.VALIDATION), (*library.DYNAMIC_TEST, *library.DYNAMIC_VALIDATION)
    )
    built = {scene.name: scene.at(preset).build() for scene in SCENES}
    return {
        "declared": {
            name: {field: value for field, value in vars(scene).items() if field not in OUTSIDE}
            for name, scene in declared.items()
        },
        "worn": settings_of(body, find_template("tshirt").tailor(body, vertices=preset.garment_vertices)),
        "garments": {
            name: {"vertices": signature(template.tailor).parameters["vertices"].default, **template.measures}
            for name, template in templates.items()
        },
        "built": {
            name: (
                _rounded(scene.cloth.rest_positions), scene.cloth.faces, scene.terms, scene.dt, scene.frames,
                _rounded(scene.start_state), scene.warm_up,
            )
            for name, scene in built.items()
        },
        "energies": {name: list(_probed(built[name])) for name in PROBED},
    }  # fmt: skip


def _rounded(array: np.ndarray) -> np.ndarray:
    """Return the array as the digest takes it; a zero has no sign."""
    return np.round(np.asarray(array, dtype=np.float64), DECIMALS) + 0.0


def _probed(scene: Any) -> Iterator[tuple[str, list[str]]]:
    """Yield each term and its energies in the last frames of a falling, waving sheet: what formulas give."""
    wave = 0.04 * np.sin(9.0 * scene.start[:, [2, 0, 1]])
    positions = np.stack([scene.start + share * (wave - [0.0, FALL, 0.0]) for share in PATH])
    for term, series in energy_series(scene, [positions])[0].items():
        yield term, [f"{value:.{DIGITS}g}" for value in series[2:]]


def _materials() -> dict[str, Any]:
    return {
        "cloth": asdict(material.Material()), "gravity": material.GRAVITY,
        "contact": (DEFAULT_STIFFNESS, DEFAULT_MARGIN),
    }  # fmt: skip


def _motions() -> dict[str, Any]:
    """Roles, and the content of every motion of the library; of whole recorded clips their frozen digests."""
    roles = ("TRAIN", "VALIDATION", "TEST", "DYNAMIC_VALIDATION", "DYNAMIC_TEST")
    clips = (library.make_motion(name) for name in library.LIBRARY if name not in library.CLIPS)
    return {
        "roles": {role.lower(): getattr(library, role) for role in roles},
        "clips": {name: clip.digest for name, clip in library.CLIPS.items()},
        "segments": {name: list(segment) for name, segment in library.SEGMENTS.items()},
        "made": {m.name: (_rounded(m.poses), _rounded(m.translations), m.fps) for m in clips},
    }


def _metrics() -> dict[str, Any]:
    without = ("title", "definition", "table", "declared_in")  # prose, and how a report shows it
    return {
        name: {field: value for field, value in asdict(metric).items() if field not in without}
        for name, metric in metrics.list_metrics().items()
    }


def _sampling() -> dict[str, Any]:
    return {
        "presets": {p.name: {n: v for n, v in asdict(p).items() if n not in NOT_OF_SCENES} for p in PRESETS},
        "gap": (energy_gap.PRECISION, energy_gap.NEGLIGIBLE, energy_gap.ITERATIONS),
        "hem": (
            dynamics.SHIFTING, dynamics.MAX_LAG, dynamics.SHORTEST, dynamics.NO_MOTION,
            float(dynamics.TURNING),
        ),
        "start": (dressed_body.HOLD, dressed_body.SHORT),
        "quasi-static frames": QUASI_STATIC_FRAMES,
        "body": (scene_facts.SAMPLED_FRAMES, scene_facts.OFFSET),
        "surface": surface_distance.SAMPLED_FRAMES,
        "crossings": intersections.SAMPLED_STEPS,
    }  # fmt: skip


def _reference() -> dict[str, Any]:
    return {
        "family": STARTS, "tolerance": Newton.__init__.__kwdefaults__["tolerance"],
        "quasi-static": (AT_REST["dt"], AT_REST["tolerance"]), "skinning": DEFAULT.smoothing,
    }  # fmt: skip


def _statistics() -> dict[str, Any]:
    return {
        "level": recorded.LEVEL, "tie": recorded.TIE, "softening": recorded.SOFTENING,
        "motions": recorded.LEAST_MOTIONS, "bootstrap": (recorded.DRAWS, recorded.SEED),
    }  # fmt: skip


# Part of the protocol -> what it defines, as values that `digest` takes.
PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    "scenes": _scenes,
    "materials": _materials,
    "motions": _motions,
    "metrics": _metrics,
    "reference": _reference,
    "sampling": _sampling,
    "statistics": _statistics,
}


def test_the_recorded_digests_are_those_of_the_code():
    digests = {part: digest(make()) for part, make in PARTS.items()}
    changed = {part: digests[part] for part in digests if digests[part] != DIGESTS.get(part)}
    assert changed == {}, (
        f"no longer protocol {NUMBER}: set DIGESTS (benchmarks/results/protocol.py) anew, raise NUMBER "
        "unless something was only added, and write down what changed in docs/protocol.md and CHANGELOG.md"
    )
    assert list(DIGESTS) == list(PARTS) and digest(DIGESTS) == recorded.DIGEST


def _motion_of_one_more_degree(name: str, make: Callable[[str], Motion] = library.make_motion) -> Motion:
    motion = make(name)
    poses = motion.poses.copy()
    poses[3, 5, 0] += np.radians(1.0 if name == "push_recovery" else 0.0)
    return replace(motion, poses=poses)


@pytest.mark.parametrize(
    ("part", "place", "name", "value"),
    [
        ("motions", library, "make_motion", _motion_of_one_more_degree),
        ("materials", material, "Material", partial(material.Material, bending_stiffness=4e-5)),
        ("metrics", metrics, "list_metrics", dict),
        ("reference", Newton.__init__, "__kwdefaults__", {"tolerance": 1e-5}),
        ("sampling", surface_distance, "SAMPLED_FRAMES", 24),
        ("statistics", recorded, "TIE", 0.1),
    ],
)
def test_a_changed_definition_changes_its_digest(monkeypatch, part, place, name, value):
    monkeypatch.setattr(place, name, value)
    assert digest(PARTS[part]()) != DIGESTS[part]


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
    other = replace(cell.scene, options={**cell.scene.options, "sheet_cells": 99})
    assert protocol_of(replace(cell, scene=other), plan) == OWN
    assert protocol_of_case("measured/percentile", "check") == OWN
