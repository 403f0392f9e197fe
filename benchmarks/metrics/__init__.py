"""Metrics: the visible tuple of modules, each with the metrics it measures. See benchmarks.metric.

| folder | metrics |
| --- | --- |
| energies | energy/*, excess/*, gap/*, step/*, gradient/norm |
| surface | curvature/*, wrinkles/*, deformation/*, stretch/*, dihedral/mean, intersections/* |
| surface | distance/*, surface/*, penetration/*, drift/hem, body/*, mesh/* |
| motion | velocity/error, acceleration/error, dynamics/*, conservation/*, exact/distance |
| motion | time_error/*, motion/*, roll_out/* |
| cost | cost/*, solver/*, training_distance/* |

>>> find_metric("curvature/mean").unit
'1/m'
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import ModuleType

from benchmarks.declarations import DeclarationError, by_name, load
from benchmarks.metric import Metric

MODULES = {
    "energy": "benchmarks.metrics.energies.energy",
    "printed_bending": "benchmarks.metrics.energies.printed_bending",
    "excess": "benchmarks.metrics.energies.excess",
    "curvature": "benchmarks.metrics.surface.curvature",
    "wrinkles": "benchmarks.metrics.surface.wrinkle_spectrum",
    "shape": "benchmarks.metrics.surface.rest_shape",
    "swept": "benchmarks.metrics.surface.swept_crossings",
    "stretch": "benchmarks.metrics.surface.principal_stretches",
    "geometry": "benchmarks.metrics.surface.penetration_and_distances",
    "surface": "benchmarks.metrics.surface.surface_distance",
    "body": "benchmarks.metrics.surface.body_intersections",
    "optimality": "benchmarks.metrics.energies.energy_gap",
    "solver": "benchmarks.metrics.cost.relaxed_frames",
    "exact": "benchmarks.metrics.motion.exact_distance",
    "velocity": "benchmarks.metrics.motion.velocity_error",
    "dynamics": "benchmarks.metrics.motion.dynamics",
    "training_distance": "benchmarks.metrics.cost.training_distance",
    "conservation": "benchmarks.metrics.motion.conservation",
    "time_error": "benchmarks.metrics.motion.time_step_error",
    "cost": "benchmarks.metrics.cost.cost",
}
WHERE_NAMED = {
    "extrapolation": "benchmarks.metrics.motion.extrapolation",
    "roll_out": "benchmarks.metrics.motion.long_roll_out",
    "mesh": "benchmarks.metrics.surface.mesh_size",
    "body_shape": "benchmarks.metrics.surface.body_shape",
}  # measured only in scenes that name them
MODULE_OF = MODULES | WHERE_NAMED
OF_OTHER_MESHES = ("surface",)  # all that is measured of a roll-out on another mesh than the scene's


def names_of(chosen: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of the modules that a scene measures, from what it declares."""
    return tuple(MODULES) if chosen is None else tuple(name for name in MODULE_OF if name in chosen)


@cache
def modules() -> dict[str, ModuleType]:
    """Load every module of metrics, by name."""
    return {name: load(module) for name, module in MODULE_OF.items()}


@cache
def declared(outside: tuple[str, ...] = ()) -> dict[str, Metric]:
    """Return every metric by name: of all modules, and of modules outside.

    Raises DeclarationError where a module declares no METRICS, or two declare one name.
    """
    metrics: list[Metric] = []
    for name, module in modules().items():
        if not hasattr(module, "METRICS"):
            raise DeclarationError(f"{MODULE_OF[name]} declares no METRICS, a tuple of Metric")
        metrics += module.METRICS
    others = [replace(metric, declared_in=home) for home in outside for metric in load(home).METRICS]
    return by_name("metric", (*metrics, *others))


def find_metric(name: str, outside: tuple[str, ...] = ()) -> Metric:
    """Return the declaration of a metric, also by a pattern such as "energy/*". Raises KeyError.

    outside: modules, or paths of files, of metrics that are not the project's.

    >>> find_metric("energy/wind").unit
    'J'
    """
    metrics = declared(outside)
    if name in metrics:
        return metrics[name]
    family, _, last = name.rpartition("/")
    metric = metrics.get(f"{family}/*")
    if metric is None:
        raise KeyError(
            f"no module of metrics declares {name}: name it in METRICS of the one that measures it"
        )
    return replace(metric, name=name, title=metric.title.format(last.replace("_", " ").capitalize()))
