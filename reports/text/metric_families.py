"""Rows of the table of metrics in docs/metrics.md that differ from the declared definitions.

A pattern of several metrics gives one row for all of them; a single name gives a row in plainer words.
tables/dictionary.csv of each run lists every metric with its declared definition.
"""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from benchmarks.metric import Metric

# Pattern of names -> definition. The first pattern that matches a name has it.
FAMILIES = {
    "energy/collision": "penalty of contact samples within the margin of the body, contact planes searched "
    "at the method's own positions; mean over frames",
    "step/distance": "root mean square distance between a frame and the local minimum of its own time step, "
    "mean over frames",
    "step/curvature": "|H - H_min| between a frame and that minimum, mean by area and over frames",
    "velocity/error": "root mean square difference of the velocities (x - x') / dt of the same vertices",
    "penetration/own_part_p999": "99.9th percentile of the depth below the part of the body that a vertex "
    "belongs to: cloth in the fold of a hip does not count",
    "inertia/correlation": "correlation over frames of the roots of two inertias: the method's, and that "
    "of skinning alone, which follows the body",
    "energy/bending_printed": "energy of the hinges as the SNUG paper prints it, k/2 theta^2; no part of "
    "the total; mean over frames",
    "excess/*": "sum of all terms (or of all but gravity, which sagging cloth lowers) minus that of "
    "vertices optimised directly, mean over frames",
    "deformation/*": "|length / rest length - 1| of edges, |area / rest area - 1| of faces; mean over frames",
    "intersections/swept": "pairs of a vertex and a triangle, or of two edges, of the cloth that pass "
    "through each other on straight ways between two frames; mean over 12 pairs of frames",
    "surface/*": "mean distance, and mean angle of normals, between vertices of either surface and the "
    "nearest points of the other, by area, over 12 evaluated frames",
    "curvature/change": "share of the scatter of curvature that is change over time: mean |H - median of "
    "the vertex over frames| divided by mean |H - mean of all vertices and frames|, weighted by area; 0 "
    "where wrinkles never change, at most 1",
    "wrinkles/error_*": "|a - a_ref|, a the amplitude of the row above, at the same frame and wherever on "
    "the garment the wrinkles are; mean over frames",
    "wrinkles/*": "amplitude a of a band of wavelengths (over 400, 200 to 400, 100 to 200, under 100 mm): "
    "root mean square of that part of the signed mean curvature, mean over frames",
    "stretch/*": "larger (tension) and smaller (compression) principal stretch of a triangle minus 1: "
    "percentiles 1, 50 and 99 over rest area and evaluated frames",
    "body/self_intersection*": "vertices of the body inside another part of it and not so at rest, in the "
    "worst of 24 evaluated frames; which frame that is",
    "gap/relative": "energy gap divided by `gap/scale`, which is the same for all methods of a scene",
    "gap/scale": "energy of the skinned garment (without a body: of the step's first guess) above the "
    "reference's, in the reference's time steps; mean over frames",
    "gap/local": "energy of a frame above the minimum that a descent from this frame reaches, mean over "
    "frames",
    "gap/refrozen": "the same with contact planes searched at the frame in place of the step's first guess",
    "gap/found_by_*": "number of sampled frames whose lowest minimum came from the simulator's solve, from "
    "a descent from the frame, or was the frame itself",
    "dynamics/quasi_static_difference": "root mean square distance to the method's own quasi-static solution",
    "dynamics/amplitude": "hem amplitude: root mean square of the hem's dynamic part, divided by the "
    "simulation's",
    "dynamics/correlation": "cosine between the dynamic parts of method and simulation",
    "dynamics/gain": "factor of the least-squares fit of the hem's turn (or shift) to that of its own "
    "quasi-static solution, `dynamics/lag` frames earlier",
    "dynamics/lag": "frames by which the hem follows its own quasi-static solution",
    "dynamics/common_*": "the four above with the simulation's quasi-static solution for every method",
    "dynamics/ringing*": "root mean square distance of the hem from its final place 0, 1, 2, 4, 8 and 16 "
    "frames after the body has stopped, and the mean of these",
    "training_distance/*": "angle to the nearest training pose, augmented ones included, mean over joints: "
    "median and 95th percentile over frames",
    "conservation/*": "violation of the laws of a time step: momentum, angular momentum, energy that "
    "rises, frames above the step's first guess (descent), gradient left (residual)",
    "time_error/*": "curvature or energy of the reference minus its limit of small time steps "
    "(Richardson), where the observed order is 0.5 to 1.5, else minus the value at an eighth of the time "
    "step",
    "cost/train_*": "updates of the training; frames that it learned from, augmented ones included",
    "cost/frame": "inference time: run time divided by the number of frames, one frame at a time on one "
    "thread; median of repeated runs",
    "cost/whole": "end-to-end time: inference and the preparation of its inputs, from pose to world vertices",
    "cost/frame_*": "inference time of single frames, each by its median run: median, 95th percentile, "
    "slowest",
    "motion/*": "suite `extremes`: worst strain, its ratio to the ordinary walk's, largest offset from the "
    "skinned garment, penetration, total energy; distance to the ordinary walk 1, 10 and 30 frames after a "
    "wrong frame",
    "roll_out/*": "a motion shown early and late in a long roll-out: energy (strain, bending, inertia) of "
    "both stretches, and the distance between them about the pelvis",
    "fabric/*": "textile tests: bending length, drape coefficient, and their errors",
    "mesh/*": "vertices, mean length of an edge at rest, time steps of a frame",
}


def family_of(name: str) -> str:
    """Return the first pattern of FAMILIES that matches the name of a metric; empty for none.

    >>> family_of("wrinkles/error_over_400"), family_of("energy/strain")
    ('wrinkles/error_*', '')
    """
    return next((pattern for pattern in FAMILIES if fnmatchcase(name, pattern)), "")


def family_rows(metrics: Iterable[Metric]) -> list[tuple[str, str, str]]:
    """Return (name or pattern, units, definition) of metrics, a family in one row at its first metric."""
    units: dict[str, list[str]] = {}
    definitions: dict[str, str] = {}
    for metric in metrics:
        row = family_of(metric.name) or metric.name
        definitions[row] = FAMILIES.get(row, metric.definition)
        units.setdefault(row, [])
        if metric.unit not in units[row]:
            units[row].append(metric.unit)
    return [(f"`{row}`", ", ".join(units[row]), definition) for row, definition in definitions.items()]
