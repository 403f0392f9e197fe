"""The visible tuple of metrics: one module each. See benchmarks.metric for what a module holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import ModuleType

from benchmarks.metric import Metric
from benchmarks.registry import DeclarationError, by_name, load

MODULES = {
    "energy": "benchmarks.metrics.energies.energy",
    "printed_bending": "benchmarks.metrics.energies.printed_bending",
    "excess": "benchmarks.metrics.energies.excess",
    "curvature": "benchmarks.metrics.surface.curvature",
    "shape": "benchmarks.metrics.surface.rest_shape",
    "geometry": "benchmarks.metrics.surface.distances",
    "body": "benchmarks.metrics.surface.body_intersections",
    "optimality": "benchmarks.metrics.energies.energy_gap",
    "solver": "benchmarks.metrics.cost.solver",
    "exact": "benchmarks.metrics.motion.exact_answer",
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


def names_of(chosen: Sequence[str] | None) -> tuple[str, ...]:
    """The modules that a scene measures, from what it declares."""
    return tuple(MODULES) if chosen is None else tuple(name for name in MODULE_OF if name in chosen)


@cache
def modules() -> dict[str, ModuleType]:
    """Name -> module, of all there are; loads them."""
    return {name: load(module) for name, module in MODULE_OF.items()}


@cache
def declared(outside: tuple[str, ...] = ()) -> dict[str, Metric]:
    """Name -> metric, of all modules, of microbenchmarks, and of modules outside. Raises DeclarationError."""
    from benchmarks.metrics.cost.microbenchmarks import METRICS

    own: list[Metric] = []
    for name, module in modules().items():
        if not hasattr(module, "METRICS"):
            raise DeclarationError(f"{MODULE_OF[name]} declares no METRICS, a tuple of Metric")
        own += module.METRICS
    others = [replace(metric, declared_in=home) for home in outside for metric in load(home).METRICS]
    return by_name("metric", (*own, *METRICS, *others))


def find_metric(name: str, outside: tuple[str, ...] = ()) -> Metric:
    """The declaration of a metric, also by a pattern such as "energy/*". Raises KeyError.

    outside: modules, or paths of files, of metrics that are not the project's.
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
