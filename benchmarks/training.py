"""Training of a network of the benchmark: its recipe, the simulations it learns from, when it stops.

The table of the project's own networks is benchmarks.methods.declared_networks.TRAININGS; a method from
outside brings its own by `MethodEntry(training=Training(...))`. Imports nothing heavy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from snug.recipe import Recipe


@dataclass(frozen=True)
class Simulated:
    """Simulated training data: the training motions, and augmented clips made from them.

    Attributes:
        mixed: frames of augmented clips for each original frame, up to 20,000. The clips are the same for
            every training and seed, see snug.training.augmentation.make_shared_clips.
        method: name of the method that simulates.
    """

    mixed: int = 0
    method: str = "simulation"


@dataclass(frozen=True)
class Training:
    """Training of one network.

    Attributes:
        kind: one of snug.kinds.KINDS.
        recipe: options of network and training.
        simulated: simulations that it learns from; None if it learns from the energies alone.
        steps_of: name of the training whose number of steps it takes; empty for its own number.
        held_out: number of training motions, counted from the last, that are not trained on, unless there
            are no more.
        converged: whether it continues, for several times these steps, until the held-out motions get no
            better; the weights that did best on them are kept.
    """

    kind: str
    recipe: Recipe
    simulated: Simulated | None = None
    steps_of: str = ""
    held_out: int = 0
    converged: bool = False
