"""How far a frame is from the minimum of its own time step: energy, share of skinning's, and force.

At frame t the step's objective is Phi(x) = inertia + all declared terms, with x_hat from the method's own
two previous frames and contact planes frozen at the step's initial guess x_0 (the same guess as the
simulator's: carried by the obstacle, else x + dt v). Over the sampled frames

    energy = mean of Phi(x_t) - Phi* [J]
    gap    = sum (Phi(x_t) - Phi*) / sum (Phi(x_s) - Phi*)
    local  = sum (Phi(x_t) - Phi(minimum below x_t)) / the same denominator
    norm   = mean of the largest component of grad Phi(x_t), in mean vertex weights

x_s is the garment skinned to the frame's pose or, where there is no body, the guess x_0: 0 is a minimiser, 1
no better than that. Phi* is the lowest value found by L-BFGS and Newton from x_0 (as the simulator does), by
Newton alone from x_0, by both from x_t, or x_t itself, and who found it is counted. A step has several
minima, so the reference's own local gap is 0 by construction and its gap is what another solver found below.

Each method is judged from its own history: a small gap says that a step was solved, not that the past was
right; it does not measure dynamics. And where the past went far from the body, as a solver's that stops much
too early, skinning is far from that past, the denominator grows and the share flatters: the energy does not.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..metric import Metric, skinned
from .energy import FIRST_FULL_FRAME
from .step import own_terms, prepared

if TYPE_CHECKING:
    from ..metric import RollOut
    from ..scene import BuiltScene

SUITES = ("speed",)  # each sample is four minimisations

ITERATIONS = 300  # of one minimisation: a limit by the clock would make a gap depend on how busy a machine is
FINDERS = ("simulator", "newton", "from_frame", "frame")
ALIKE = 1e-9  # of the denominator: minima this near are one

METRICS = (
    Metric(
        name="gap/relative", unit="1", title="Energy gap", table="speed", lower_is_better=True,
        definition="how far frames lie above the minimum of their own time step, as a share of what "
        "skinning, or the first guess, lies above it",
    ),
    Metric(
        name="gap/energy", unit="J", title="Energy gap", table="speed", lower_is_better=True,
        definition="the same in joules, mean over sampled frames; a wrong past does not show in either",
    ),
    Metric(
        name="gap/local", unit="1", title="Local gap", lower_is_better=True,
        definition="the same share for the minimum that lies below the frame itself",
    ),
    Metric(
        name="gradient/norm", unit="1", title="Gradient", table="speed", lower_is_better=True,
        definition="largest component of the gradient left in a step, in mean vertex weights",
    ),
    *(
        Metric(
            name=f"gap/found_by_{finder}", unit="frames", title=f"Found by {finder.replace('_', ' ')}",
            definition="sampled frames whose lowest minimum was found so",
        )
        for finder in FINDERS
    ),
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    group = roll_out.group
    return optimality(
        roll_out.scene, roll_out.positions, samples=group.gap_samples, skinned=group.kept(skinned)
    ).metrics()


@dataclass
class Optimality:
    """Sums over sampled frames. found_by: whose minimum was the lowest; of equals the first in FINDERS."""

    missed: float = 0.0
    missed_locally: float = 0.0
    to_gain: float = 0.0
    gradients: list[float] = field(default_factory=list)
    found_by: dict[str, int] = field(default_factory=lambda: dict.fromkeys(FINDERS, 0))

    def metrics(self) -> dict[str, float]:
        """gap/* and gradient/norm; empty without a frame."""
        if not self.gradients:
            return {}
        scale = self.to_gain if self.to_gain > 0.0 else float("nan")
        return {
            "gap/energy": self.missed / len(self.gradients),
            "gap/relative": self.missed / scale,
            "gap/local": self.missed_locally / scale,
            "gradient/norm": float(np.mean(self.gradients)),
        } | {f"gap/found_by_{finder}": float(count) for finder, count in self.found_by.items()}


def optimality(
    scene: BuiltScene,
    positions: NDArray[np.float64],
    *,
    samples: int,
    skinned: NDArray[np.float64] | None = None,
) -> Optimality:
    """Judge positions (T,V,3) [m] at `samples` frames spread evenly; skinned (T,V,3) are the x_s of above."""
    from reference_sim import Potential
    from reference_sim.minimise import LBFGS, Newton
    from reference_sim.minimise.descent import mean_weight

    found = Optimality()
    if len(positions) <= FIRST_FULL_FRAME:
        return found
    potential = Potential(own_terms(scene))
    newton = Newton(potential, max_iterations=ITERATIONS)
    both = LBFGS(potential, max_iterations=ITERATIONS)
    frames = np.unique(np.linspace(FIRST_FULL_FRAME, len(positions) - 1, samples).round().astype(int))
    for frame in frames:
        x = np.ascontiguousarray(positions[frame])
        guess = prepared(scene, potential, positions, int(frame)).guess
        here, gradient = potential.value_and_gradient(x)
        if not np.isfinite(here):  # no gap to speak of, and no place for a minimiser to start
            found.missed = found.missed_locally = float("nan")
            found.gradients.append(float("nan"))
            continue
        energies = {
            "simulator": both.minimise(guess).energy,
            "newton": newton.minimise(guess).energy,
            "from_frame": both.minimise(x).energy,
            "frame": here,
        }
        # A guess that has no energy, as of a garment that collapsed a frame ago, leads nowhere.
        best = min(energy for energy in energies.values() if np.isfinite(energy))
        to_gain = potential.value(guess if skinned is None else skinned[frame]) - best
        alike = ALIKE * abs(to_gain) if np.isfinite(to_gain) else 0.0
        finder = next(name for name in FINDERS if energies[name] <= best + alike)
        found.found_by[finder] += 1
        found.missed += here - best
        found.missed_locally += here - min(here, energies["from_frame"])
        found.to_gain += to_gain
        found.gradients.append(float(np.abs(gradient[scene.cloth.free]).max()) / mean_weight(potential))
    return found
