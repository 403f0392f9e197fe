"""Place of a garment on the unposed body, and the unit or axis that mends a wrong one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_sim.files.mesh_files import METRES, UP_AXES, to_metres_y_up
from reference_sim.obstacle import Obstacle
from snug.body.parametric_body import Body
from snug.garments.implicit_surface import skin_following

Array = NDArray[np.float64]

TRAPPED_DEPTH = 0.02  # [m] below the skin, from which contact may not find the way out
TRAPPED_SHARE = 0.05  # of the vertices that may be so deep
MAX_DEPTH = 0.04  # [m], half the thickness of an arm
WORN_DISTANCE = 0.05  # [m] from the skin: whatever is worn has a tenth of its vertices there
WORN_SHARE = 0.1
SIZE_RANGE = 0.1, 1.2  # largest extent of a garment [heights of the body]
ENDS = ("head", "left_wrist", "right_wrist", "left_hand", "right_hand", "left_ankle", "right_ankle",
        "left_foot", "right_foot")  # fmt: skip


@dataclass(frozen=True)
class Fit:
    """Place of a garment on the unposed body.

    Attributes:
        distances: (V,) [m] of its vertices to the skin, negative below it.
        size: its largest extent [heights of the body].
        at_ends: share of the vertices whose nearest skin is of head, hands or feet.
    """

    distances: Array
    size: float
    at_ends: float

    @property
    def below(self) -> float:
        """Share of the vertices below the skin."""
        return float(np.mean(self.distances < 0))

    @property
    def depth(self) -> float:
        """Depth [m] of the deepest vertex, 0 where none is below the skin."""
        return max(0.0, -float(self.distances.min()))

    @property
    def problem(self) -> str:
        """Reason why nothing can be simulated from here, or empty."""
        if not SIZE_RANGE[0] < self.size < SIZE_RANGE[1]:
            return f"its largest extent is {self.size:.3g} times the body's height"
        if np.mean(np.abs(self.distances) < WORN_DISTANCE) < WORN_SHARE:
            return f"it lies {1e3 * np.median(np.abs(self.distances)):.0f} mm from the body"
        if self.depth > MAX_DEPTH or np.mean(self.distances < -TRAPPED_DEPTH) > TRAPPED_SHARE:
            return f"it lies up to {1e3 * self.depth:.0f} mm deep in the body, with {self.below:.0%} of it"
        if self.at_ends > 0.5:
            return f"{self.at_ends:.0%} of it lies around head, hands or feet"
        return ""


def measure_fit(body: Body, skin: Obstacle, positions: Array) -> Fit:
    """Return how a garment (V,3) [m] lies on the mean body, whose surface is `skin`."""
    size = float(np.ptp(positions, axis=0).max()) / body.height
    at_ends = np.asarray(skin_following(body, ENDS)[body.faces].all(axis=1))
    share = float(at_ends[skin.planes(positions, 0).faces].mean())
    return Fit(skin.signed_distance(positions, 0), size, share)


def find_units(body: Body, skin: Obstacle, raw: Array, shift: Array) -> tuple[str, str] | None:
    """Return units and up axis with which a file's vertices (V,3) lie on the body, or None.

    Of several the one with most vertices close to the skin and few below it.
    """
    fits = {
        (units, up): measure_fit(body, skin, to_metres_y_up(raw, units=units, up=up) + shift)
        for units in METRES
        for up in UP_AXES
    }
    worn = {choice: fit for choice, fit in fits.items() if not fit.problem}
    return min(worn, key=lambda choice: np.abs(worn[choice].distances).mean(), default=None)
