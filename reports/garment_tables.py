"""The tables of garments on moving bodies: the paper's three, and what they leave out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from benchmarks.results import Row
from reports.ablations import set_apart
from reports.summary import (
    EXTRA_TERMS,
    TERMS,
    Measurements,
    benchmark_cells,
    suite_rows,
    wardrobe,
    worn_scenes,
)
from reports.table import Cell, Column, Table

# Columns that stand in a table only where the run measured them; any other one is kept, as dashes.
OPTIONAL = ("distance/p95", "distance/floor", "cost/batch", "cost/peak", "intersections/triangles")


def _by_garment(name: str, rows: Sequence[Row], columns: Iterable[tuple[str, Column]]) -> Table | None:
    """One row per garment and method with any of the metrics, as means over the garment's scenes.

    Ablations beside the full recipe have a table of their own. Columns nobody has are dashes, or left out
    if OPTIONAL.
    """
    measured = Measurements(suite_rows(rows, "garments"))
    pairs = [p for p in columns if p[0] not in OPTIONAL or p[0] in measured.metrics]
    lines: list[tuple[Cell, ...]] = []
    for garment, scenes in wardrobe(measured).items():
        apart = set_apart(measured, scenes)
        for method in measured.methods:
            means = [measured.mean(method, metric, scenes) for metric, _ in pairs]
            if method not in apart and any(mean is not None for mean in means):
                lines.append((garment, method, *means))
    if not lines:
        return None
    head = (Column("garment", "Garment"), Column("method", "Method"))
    return Table(name, (*head, *(column for _, column in pairs)), tuple(lines))


def energy_columns(measurements: Measurements) -> list[tuple[str, Column]]:
    """The paper's terms and the total, and any further term that some row of these carries."""
    further = [term for term in EXTRA_TERMS if f"energy/{term}" in measurements.metrics]
    names = [*TERMS[:-1], *further, TERMS[-1]]
    return [(f"energy/{term}", Column(term, term.capitalize(), "J")) for term in names]


def energies(rows: Sequence[Row]) -> Table | None:
    """Table 1 of the paper: energy per term, J per frame, mean over the scenes of each garment."""
    measured = Measurements(suite_rows(rows, "garments"))
    return _by_garment("energies", rows, energy_columns(measured.only(worn_scenes(measured))))


def energies_by_scene(rows: Sequence[Row]) -> Table | None:
    """The same scene by scene, small scenes and cut solvers included."""
    measured = Measurements(benchmark_cells(rows, "garments"))
    columns = energy_columns(measured)
    lines: list[tuple[Cell, ...]] = []
    for scene in measured.scenes:
        for method in measured.methods:
            means = [measured.mean(method, metric, [scene]) for metric, _ in columns]
            if any(mean is not None for mean in means):
                lines.append((scene, method, *means))
    if not lines:
        return None
    head = (Column("scene", "Scene"), Column("method", "Method"))
    return Table("energies_by_scene", (*head, *(column for _, column in columns)), tuple(lines))


def curvature(rows: Sequence[Row]) -> Table | None:
    """Table 2 of the paper, with the mean curvature itself beside its error."""
    return _by_garment(
        "curvature",
        rows,
        [
            ("curvature/error", Column("error", "Mean-curvature error", "1/m")),
            ("curvature/mean", Column("mean", "Mean curvature", "1/m")),
            ("curvature/mean_difference", Column("mean_difference", "Difference of means", "1/m")),
        ],
    )


def geometry(rows: Sequence[Row]) -> Table | None:
    """Distance to the simulation, response to motion and penetration into the body."""
    return _by_garment(
        "penetration",
        rows,
        [
            ("penetration/vertices", Column("vertices", "Below the skin", "%")),
            ("penetration/deep", Column("deep", "Deep", "%")),
            ("penetration/own_part_p999", Column("own_part_p999", "Own part", "mm")),
            ("drift/hem", Column("hem_drift", "Hem drift", "mm")),
            ("distance/rms", Column("distance_rms", "Distance", "mm")),
            ("distance/p95", Column("distance_p95", "95 %", "mm")),
            ("distance/floor", Column("distance_floor", "Floor", "mm")),
        ],
    )


def shape(rows: Sequence[Row]) -> Table | None:
    """How far the cloth is from its rest shape and through itself, and how its curvature is spread."""
    return _by_garment(
        "shape",
        rows,
        [
            ("deformation/edges", Column("edges", "Edges", "%")),
            ("deformation/areas", Column("areas", "Areas", "%")),
            ("dihedral/mean", Column("dihedral", "Folds", "deg")),
            ("intersections/triangles", Column("intersections", "Self-cut", "%")),
            ("curvature/histogram", Column("histogram", "Histogram", "1/m")),
        ],
    )


def dynamics(rows: Sequence[Row]) -> Table | None:
    """How the hem answers to the body's motion, beside the simulation's answer."""
    return _by_garment(
        "dynamics",
        rows,
        [
            ("dynamics/amplitude", Column("amplitude", "A")),
            ("dynamics/correlation", Column("correlation", "Correlation")),
            ("dynamics/gain", Column("gain", "Gain")),
            ("dynamics/lag", Column("lag", "Lag", "frames")),
            ("dynamics/ringing", Column("ringing", "Ringing", "mm")),
            ("dynamics/spectrum", Column("spectrum", "Spectrum")),
            ("dynamics/held_difference", Column("held_difference", "Held", "mm")),
        ],
    )


def cost(rows: Sequence[Row]) -> Table | None:
    """Table 3 of the paper: data generation, training, run time of one frame, memory."""
    return _by_garment(
        "cost",
        rows,
        [
            ("cost/data", Column("data_generation", "Data generation", "s")),
            ("cost/setup", Column("making_ready", "Making ready", "s")),
            ("cost/train", Column("training", "Training", "s")),
            ("cost/frame", Column("run_time", "Frame", "ms")),
            ("cost/batch", Column("batch", "In batch", "ms")),
            ("cost/memory", Column("memory", "Memory", "MB")),
            ("cost/peak", Column("peak", "Process", "MB")),
        ],
    )
