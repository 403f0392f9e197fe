"""Sum of energies that the solver minimises, a network is trained on and every method is measured by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from reference_sim.assembly.hessian_pattern import HessianPattern
from reference_sim.energies.energy import Energy, Step


class Potential:
    """Sum of energies: value, gradient and sparse Hessian on a fixed pattern.

    Leaving a term out of `energies` is an ablation; nothing of it is evaluated.

    Args:
        energies: the terms, all of one cloth.

    Raises:
        ValueError: no energies, energies of different cloths, or two of the same name.

    Example: the weight of a triangle pulls its corners down.

        >>> import numpy as np
        >>> from reference_sim import Cloth, Potential
        >>> from reference_sim.energies import Gravity, StretchStVK
        >>> x = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
        >>> cloth = Cloth(x, np.array([[0, 2, 1]]))
        >>> potential = Potential([StretchStVK(cloth), Gravity(cloth)])
        >>> list(potential.terms(x))
        ['strain', 'gravity']
        >>> potential.gradient(x)[:, 1].round(6).tolist()  # m g / 3 [N]
        [0.003274, 0.003274, 0.003274]
        >>> potential.hessian(x).shape
        (9, 9)
    """

    def __init__(self, energies: Sequence[Energy]) -> None:
        if not energies:
            raise ValueError("a Potential needs at least one energy")
        self.energies = tuple(energies)
        self.cloth = self.energies[0].cloth
        for energy in self.energies:
            if energy.cloth is not self.cloth:
                first = self.energies[0].name
                raise ValueError(f"energies {first!r} and {energy.name!r} are of different cloths: use one")
        names = [energy.name for energy in self.energies]
        for name in names:
            if names.count(name) > 1:  # one would hide the other in tables and files
                raise ValueError(f"two energies are named {name!r}: give each a name of its own")
        self._patterns: dict[tuple[bytes, int], HessianPattern] = {}

    @property
    def time_step(self) -> float | None:
        """Time step dt [s] of the inertia among the terms; None for a static potential."""
        steps = (energy.parameters()["dt_s"] for energy in self.energies if energy.name == "inertia")
        return next(steps, None)

    @property
    def impassable(self) -> bool:
        """True if some term may stop an obstacle on its way."""
        return any(energy.impassable for energy in self.energies)

    def prepare(self, step: Step) -> None:
        """Freeze in every term what it needs for one step."""
        for energy in self.energies:
            energy.prepare(step)

    def terms(self, x: np.ndarray) -> dict[str, float]:
        """Return the energy of each term [J] at x (V, 3) [m], by name."""
        return {energy.name: energy.value_and_gradient(x)[0] for energy in self.energies}

    def value(self, x: np.ndarray) -> float:
        """Return the sum [J] at x (V, 3) [m]."""
        return self.value_and_gradient(x)[0]

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return dPhi/dx (V, 3) [N] at x (V, 3) [m]."""
        return self.value_and_gradient(x)[1]

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return both at once [J], [N]: they share most of their work."""
        x = np.ascontiguousarray(x, dtype=np.float64)
        total, gradient = 0.0, np.zeros_like(x)
        for energy in self.energies:
            value, part = energy.value_and_gradient(x)
            total += value
            gradient += part
        return total, gradient

    def largest_step(self, x: np.ndarray, direction: np.ndarray) -> float:
        """Return the largest share of `direction` (V, 3) [m] that every term allows from x (V, 3)."""
        return min(energy.largest_step(x, direction) for energy in self.energies)

    def ccd_fraction(self, x: np.ndarray, goal: np.ndarray, progress: float) -> float:
        """Return the share of the way from x to goal (V, 3) that all terms find free; see `Energy`."""
        return min(energy.ccd_fraction(x, goal, progress) for energy in self.energies)

    def set_progress(self, progress: float) -> None:
        """Put the obstacle of every term at `progress` (0 to 1) of its motion in this step."""
        for energy in self.energies:
            energy.set_progress(progress)

    def predict_stress(self, x: np.ndarray, step: np.ndarray) -> None:
        """Let every term's Hessian use what `step` from x (V, 3) predicts of its stresses; see `Energy`."""
        for energy in self.energies:
            energy.predict_stress(x, step)

    def forget(self) -> None:
        """Go back to the true second derivatives, without predicted stresses."""
        for energy in self.energies:
            energy.forget()

    def infeasibility(self, x: np.ndarray) -> str:
        """Return why x (V, 3) is impossible for the first term that finds something; "" if none does."""
        return next(filter(None, (energy.infeasibility(x) for energy in self.energies)), "")

    def hessian(self, x: np.ndarray) -> sp.csc_matrix:
        """Return second derivatives (3V, 3V) [N/m] at x (V, 3) [m], coordinates of a vertex side by side."""
        x = np.ascontiguousarray(x, dtype=np.float64)
        pattern = self.pattern(np.ones(self.cloth.vertex_count, dtype=bool))
        changing = pattern.changing(x)
        pattern = pattern.covering(changing)
        return pattern.symmetric(pattern.assemble(x, changing))

    def pattern(self, free: np.ndarray, *, block: int = 3) -> HessianPattern:
        """Return the pattern over the free vertices (V,): of the Hessian, or (block=1) scalar stiffness."""
        key = (np.packbits(free).tobytes(), block)
        if key not in self._patterns:
            terms = [e for e in self.energies if block == 3 or e.has_scalar_stiffness]
            self._patterns[key] = HessianPattern(terms, self.cloth.vertex_count, free, block=block)
        return self._patterns[key]
