"""Definitions of the protocol, as values for a digest: what numbers depend on and no method brings.

Digests are of contents (arrays, declared values, energies of a probe), never of source code: code that is
written anew and computes the same has the same digests. `benchmarks.results.protocol` records number and
digests; test_protocol.py compares them with the code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from inspect import signature
from typing import Any

import numpy as np

from benchmarks.presets import PRESETS, find_preset
from benchmarks.results import protocol as recorded
from benchmarks.results.protocol import STARTS
from benchmarks.scenes import GARMENT_SCENES, SCENES, all_scenes
from reference_sim.minimise.newton import Newton

PRESET = "quick"  # whose sizes the meshes of the digest have
DECIMALS = 6  # [um, urad] of arrays: more may differ between processors
DIGITS = 9  # of probed energies
PROBED = ("hanging_sheet", "sheet_on_sphere")
FALL = 0.12  # [m] of the probe: onto the sphere
PATH = (0.0, 0.3, 1.0, 1.6)  # share of the fall in each frame of the probe: it accelerates
# Of a scene: prose, places of code, and an option that no declared scene takes: its rows have no
# protocol.
OUTSIDE = ("name", "description", "module", "declared_in", "files", "self_contact")


def _scenes() -> dict[str, Any]:
    """Return declarations of all scenes, body and T-shirt, and what small scenes are built of."""
    from snug.body.parametric_body import Body
    from snug.garments.templates import find_template
    from snug.motion.library import DYNAMIC_TEST, DYNAMIC_VALIDATION, TEST, VALIDATION
    from snug.training.simulated_data import settings_of

    templates = {worn.garment: find_template(worn.garment) for worn in GARMENT_SCENES}
    preset = find_preset(PRESET)
    body = Body.load()
    declared = all_scenes((*TEST, *VALIDATION), (*DYNAMIC_TEST, *DYNAMIC_VALIDATION))
    built = {scene.name: scene.at(preset).build() for scene in SCENES}
    return {
        "declared": {
            name: {field: value for field, value in vars(scene).items() if field not in OUTSIDE}
            for name, scene in declared.items()
        },
        "worn": settings_of(body, find_template("tshirt").tailor(body, vertices=preset.garment_vertices)),
        "garments": {
            name: {"vertices": signature(made.tailor).parameters["vertices"].default, **made.measures}
            for name, made in templates.items()
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
    from benchmarks.metrics.energy import energy_series

    wave = 0.04 * np.sin(9.0 * scene.start[:, [2, 0, 1]])
    positions = np.stack([scene.start + share * (wave - [0.0, FALL, 0.0]) for share in PATH])
    for term, series in energy_series(scene, [positions])[0].items():
        yield term, [f"{value:.{DIGITS}g}" for value in series[2:]]


def _materials() -> dict[str, Any]:
    from reference_sim.energies.contact_penalty import DEFAULT_MARGIN, DEFAULT_STIFFNESS
    from reference_sim.material import GRAVITY, Material

    return {
        "cloth": asdict(Material()), "gravity": GRAVITY, "contact": (DEFAULT_STIFFNESS, DEFAULT_MARGIN),
    }  # fmt: skip


def _motions() -> dict[str, Any]:
    """Roles, and the content of every motion of the library; of whole recorded clips their frozen digests."""
    from snug.motion import library
    from snug.motion.library import CLIPS, SEGMENTS

    roles = ("TRAIN", "VALIDATION", "TEST", "DYNAMIC_VALIDATION", "DYNAMIC_TEST")
    made = (library.make_motion(name) for name in library.LIBRARY if name not in CLIPS)
    return {
        "roles": {role.lower(): getattr(library, role) for role in roles},
        "clips": {name: clip.digest for name, clip in CLIPS.items()},
        "segments": {name: list(segment) for name, segment in SEGMENTS.items()},
        "made": {m.name: (_rounded(m.poses), _rounded(m.translations), m.fps) for m in made},
    }


def _metrics() -> dict[str, Any]:
    from benchmarks.metrics import declared

    without = ("title", "definition", "table", "declared_in")  # prose, and how a report shows it
    return {
        name: {field: value for field, value in asdict(metric).items() if field not in without}
        for name, metric in declared().items()
    }


def _sampling() -> dict[str, Any]:
    from benchmarks.metrics import dynamics, energy_gap, intersections, scene_facts, surface_distance
    from benchmarks.scenes import dressed_body
    from snug.networks.roll_out import QUASI_STATIC_FRAMES

    return {
        "presets": {preset.name: asdict(replace(preset, description="", steps={})) for preset in PRESETS},
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
    from benchmarks.methods.simulation import STATIC as AT_REST
    from snug.recipe import DEFAULT

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
