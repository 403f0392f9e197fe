"""Networks that learn from the same motions (equal data). They run when they are named.

The last training motion is held out of all of them. Those that simulated vertices teach get the same mixed
clips with every seed, simulated once; the others mix as many anew. All have SNUG's number of steps, or go on
until the held-out motion gets no better; learners without steps are fitted once. Members of a family differ
in their number of frames alone.
"""

from __future__ import annotations

from dataclasses import replace

from benchmarks.method import MethodEntry, Reporting
from benchmarks.methods.catalogue.networks import network, post_processed
from benchmarks.methods.catalogue.trainings import TRAININGS
from benchmarks.training import Simulated, Training

# Mixed frames for each given one; between the ends for the curve of error against training frames.
ENDS, CURVE = (0, 12), (0, 1, 3, 12)
FAMILIES_OF_NETWORKS = (
    ("snug", "SNUG", CURVE),
    ("pbns", "PBNS", ENDS),
    ("supervised", "Supervised", CURVE),
    ("santesteban2019", "Santesteban 2019", ENDS),
    ("tailornet", "TailorNet", ENDS),
)
FITTED = (("nearest-poses", "Nearest poses"), ("pose-regression", "Ridge on principal components"))


def _training(name: str, mixed: int, *, converged: bool) -> Training:
    training = TRAININGS[name]
    recipe = replace(training.recipe, name=f"{training.recipe.name}-data-{mixed}")
    if training.simulated:
        training = replace(training, simulated=Simulated(mixed=mixed))
    else:
        recipe = replace(recipe, mixed=float(mixed))
    return replace(training, recipe=recipe, steps_of="snug", held_out=1, converged=converged)


def _entry(name: str, label: str, mixed: int, *, converged: bool = False, seeded: bool = True) -> MethodEntry:
    """Declare a network on equal data. Not timed: its run time is that of the network of the usual data."""
    family = f"{name}-data" + "-converged" * converged
    data = f"original data and {mixed} augmented frames for each" if mixed else "original data"
    title = f"{label}, {mixed} augmented for each" if mixed else f"{label}, original data"
    return network(
        f"{family}-{mixed}", title + ", converged" * converged,
        f"{name} that learns from {data}" + ", until a held-out motion gets no better" * converged,
        training=_training(name, mixed, converged=converged), role="ablation", batched=False, timed=False,
        seeded=seeded,
        reporting=Reporting(
            family=family, level=float(mixed), base=f"{name}-data-{mixed}" if converged else name,
            pairing_group=name,
        ),
    )  # fmt: skip


def _block(name: str, label: str, numbers: tuple[int, ...]) -> tuple[MethodEntry, ...]:
    """Declare all numbers at equal steps, the ends to convergence too, and these with post-processing."""
    equal = tuple(_entry(name, label, mixed, converged=False) for mixed in numbers)
    converged = tuple(_entry(name, label, mixed, converged=True) for mixed in ENDS)
    ends = (entry for entry in (*equal, *converged) if entry.reporting.level in ENDS)
    return (*equal, *converged, *map(post_processed, ends))


EQUAL_DATA = tuple(
    entry for network_and_numbers in FAMILIES_OF_NETWORKS for entry in _block(*network_and_numbers)
) + tuple(_entry(name, label, mixed, seeded=False) for name, label in FITTED for mixed in ENDS)
