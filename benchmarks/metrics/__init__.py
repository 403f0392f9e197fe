"""The visible tuple of metrics: one module each. See benchmarks.metric for what a module holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import ModuleType

from ..metric import Metric
from ..registry import DeclarationError, by_name, load

MODULES = (
    "energy",
    "printed_bending",
    "excess",
    "curvature",
    "shape",
    "geometry",
    "body",
    "optimality",
    "solver",
    "exact",
    "dynamics",
    "training_distance",
    "conservation",
    "time_error",
    "cost",
)
WHERE_NAMED = (
    "extrapolation",
    "roll_out",
    "mesh",
    "body_shape",
    "training",
)  # measured only in scenes that name them


def names_of(chosen: Sequence[str] | None) -> tuple[str, ...]:
    """The modules that a scene measures, from what it declares."""
    return MODULES if chosen is None else tuple(name for name in (*MODULES, *WHERE_NAMED) if name in chosen)


@cache
def modules() -> dict[str, ModuleType]:
    """Name -> module, of all there are; loads them."""
    return {name: load(f"{__name__}.{name}") for name in (*MODULES, *WHERE_NAMED)}


@cache
def declared(outside: tuple[str, ...] = ()) -> dict[str, Metric]:
    """Name -> metric, of all modules, of microbenchmarks, and of modules outside. Raises DeclarationError."""
    from ..performance.metrics import METRICS

    own: list[Metric] = []
    for name, module in modules().items():
        if not hasattr(module, "METRICS"):
            raise DeclarationError(f"benchmarks.metrics.{name} declares no METRICS, a tuple of Metric")
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
