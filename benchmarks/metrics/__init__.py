"""Metrics: the visible tuple of what is measured, in the order of the tables. See benchmarks.metric.

>>> find_metric("curvature/mean").unit
'1/m'
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from benchmarks.declarations import by_name
from benchmarks.metric import Measurements, Metric, measurements_in
from benchmarks.metrics.cost import COST, RELAXED
from benchmarks.metrics.curvature import CURVATURE
from benchmarks.metrics.dynamics import DYNAMICS
from benchmarks.metrics.energy import ENERGY, PRINTED_BENDING
from benchmarks.metrics.energy_gap import GAP
from benchmarks.metrics.intersections import INTERSECTIONS
from benchmarks.metrics.own_energies import OWN_ENERGIES
from benchmarks.metrics.penetration_and_distances import DEFORMATION, EXACT, GEOMETRY
from benchmarks.metrics.roll_out import EXTRAPOLATION, LONG_ROLL_OUT
from benchmarks.metrics.scene_facts import BODY, BODY_SHAPE, MESH
from benchmarks.metrics.surface_distance import SURFACE

MEASUREMENTS = (
    ENERGY, OWN_ENERGIES, PRINTED_BENDING, CURVATURE, DEFORMATION, INTERSECTIONS, GEOMETRY, SURFACE, BODY,
    GAP, RELAXED, EXACT, DYNAMICS, COST, EXTRAPOLATION, LONG_ROLL_OUT, MESH, BODY_SHAPE,
)  # fmt: skip


def pick_measured(chosen: Sequence[str] | None) -> tuple[Measurements, ...]:
    """Return what a scene measures, from the names that it declares; None for all that apply everywhere."""
    return tuple(m for m in MEASUREMENTS if (not m.where_named if chosen is None else m.name in chosen))


@cache
def list_metrics(outside: tuple[str, ...] = ()) -> dict[str, Metric]:
    """Return every metric by name, also those of files outside.

    Raises DeclarationError where two have one name.
    """
    metrics = [metric for measurements in MEASUREMENTS for metric in measurements.metrics]
    others = [
        replace(metric, declared_in=home) for home in outside for metric in measurements_in(home).metrics
    ]
    return by_name("metric", (*metrics, *others))


def find_metric(name: str, outside: tuple[str, ...] = ()) -> Metric:
    """Return the declaration of a metric, also by a pattern such as "energy/*". Raises KeyError.

    outside: modules, or paths of files, of metrics not the project's.

    >>> find_metric("energy/wind").unit
    'J'
    """
    metrics = list_metrics(outside)
    if name in metrics:
        return metrics[name]
    family, _, last = name.rpartition("/")
    metric = metrics.get(f"{family}/*")
    if metric is None:
        raise KeyError(f"no metric is called {name}: declare it among METRICS of what measures it")
    return replace(metric, name=name, title=metric.title.format(last.replace("_", " ").capitalize()))
