"""Fit of a garment on the body that it was made for: depth below the skin, and the cause of a wrong place.

A unit or an axis mistaken, or a body that stands elsewhere, is found by trying remedies: the other units and
axes as they are, then with a shift. A shift is found from the distances s_i [m] of vertices to the skin
(negative below it) and the skin's normals n_i: one thickness of air, s_i + n_i.d = m for all i, by least
squares with the far ones held back (Huber), begun from many places. How high a wide skirt sits is a guess.
"""

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
# A wide dress has a cost of 0.2, a shirt around the knees of 0.5 and a tenth of that in its place.
DOUBTFUL, BETTER = 0.3, 0.4
SHIFT_SAMPLES = 250  # vertices that a shift is sought with
SHIFT_STEPS = 20
CLOSEST_SHARE = 0.2  # share of the vertices that are closer than the thickness m: what a garment hangs by
HUBER, MAX_UNEVENNESS = 0.01, 0.2  # [m] differences from it that count fully, and at most
MAX_STEP = 0.1  # [m] of a shift, in one of the SHIFT_STEPS
AIR_GAP = 0.003  # [m] between skin and garment after a shift


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

    @property
    def cost(self) -> float:
        """Unevenness of the air below it, and depth, over its size; less is more likely its place."""
        off = np.abs(self.distances - np.quantile(self.distances, CLOSEST_SHARE))
        uneven = np.minimum(off, MAX_UNEVENNESS).mean() + 5 * np.maximum(-self.distances, 0.0).mean()
        return float(uneven / self.size + self.at_ends)


class DressForm:
    """The unposed mean body, to measure distances to.

    Attributes:
        body: that is dressed.
        skin: its surface.
    """

    def __init__(self, body: Body) -> None:
        self.body, self.height = body, body.height
        self.low, self.high = body.template.min(axis=0), body.template.max(axis=0)
        self.skin = Obstacle(body.template, body.faces)
        at_ends = np.isin(body.faces, np.flatnonzero(skin_following(body, ENDS)))
        self.ends: NDArray[np.bool_] = at_ends.sum(axis=1) == 3  # faces (F,)

    def fit(self, positions: Array) -> Fit:
        """Return how positions (V,3) [m] lie on it."""
        size = float(np.ptp(positions, axis=0).max()) / self.height
        faces = self.skin.planes(positions, 0).faces
        return Fit(self.skin.signed_distance(positions, 0), size, float(self.ends[faces].mean()))

    def problem(self, positions: Array, fit: Fit) -> str:
        """Return why a garment that lies so cannot be simulated, or empty."""
        if fit.problem or fit.cost < DOUBTFUL or (shift := self.shift(positions)) is None:
            return fit.problem
        better = self.fit(positions + shift).cost < BETTER * fit.cost
        return f"it fits far better {np.linalg.norm(shift):.2f} m away" * better

    def shift(self, positions: Array) -> Array | None:
        """Return the translation (3,) [m] that brings a garment (V,3) [m] onto the body, or None."""
        samples = positions[:: max(1, len(positions) // SHIFT_SAMPLES)]
        shifts = [self._settle(samples, start) for start in self._starts(samples)]
        costs = [self.fit(samples + shift).cost for shift in shifts]
        # To the millimetre, as somebody will type it.
        shift = np.round(self._push_out(samples, shifts[int(np.argmin(costs))]), 3)
        return None if self.fit(positions + shift).problem else shift

    def _starts(self, points: Array) -> list[Array]:
        """Return shifts to begin from: none, and over the middle of the body at several heights."""
        centre = 0.5 * (self.low + self.high) - 0.5 * (points.min(axis=0) + points.max(axis=0))
        heights = np.linspace(-0.4, 0.4, 17) * self.height
        return [np.zeros(3), *(centre + np.array([0.0, height, 0.0]) for height in heights)]

    def _settle(self, points: Array, shift: Array) -> Array:
        """Return the shift (3,) [m] that least squares reach from `shift`."""
        for _ in range(SHIFT_STEPS):
            distance, normals = self._distances(points + shift)
            system = np.column_stack([normals, -np.ones(len(points))])
            off = distance - np.quantile(distance, CLOSEST_SHARE)
            weight = np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.abs(off), 1e-12)))
            step = np.linalg.lstsq(weight[:, None] * system, -weight * distance, rcond=None)[0][:3]
            shift = shift + step * min(1.0, MAX_STEP / max(float(np.linalg.norm(step)), 1e-12))
        return shift

    def _push_out(self, points: Array, shift: Array) -> Array:
        """Refine `shift` (3,) [m] until no vertex penetrates the body."""
        for _ in range(SHIFT_STEPS):
            distance, normals = self._distances(points + shift)
            inside = distance < AIR_GAP
            if not inside.any():
                break
            # Pulled back a little, so that vertices outside of the skin stay near.
            system = normals[inside].T @ normals[inside] + 0.02 * len(points) * np.eye(3)
            shift = shift + np.linalg.solve(system, normals[inside].T @ (AIR_GAP - distance[inside]))
        return shift

    def _distances(self, points: Array) -> tuple[Array, Array]:
        planes = self.skin.planes(points, 0)
        return np.einsum("vi,vi->v", planes.normals, points - planes.points), planes.normals


def find_placement(
    form: DressForm, raw: Array, units: str, up: str, shift: Array
) -> tuple[str, str, Array] | None:
    """Return units, up and shift (3,) [m] with which a file's vertices (V,3) lie on the body, or None.

    First other units and axes alone, then a shift, then both.
    """
    choices = sorted(
        ((u, a) for u in METRES for a in UP_AXES), key=lambda choice: (choice[0] != units) + (choice[1] != up)
    )
    placed = {choice: to_metres_y_up(raw, units=choice[0], up=choice[1]) for choice in choices}
    fits = {choice: form.fit(positions + shift) for choice, positions in placed.items()}
    if worn := [choice for choice, fit in fits.items() if not fit.problem and fit.cost < DOUBTFUL]:
        return (*min(worn, key=lambda choice: fits[choice].cost), shift)
    for (u, a), positions in placed.items():
        if SIZE_RANGE[0] < fits[u, a].size < SIZE_RANGE[1] and (moved := form.shift(positions)) is not None:
            return u, a, moved
    return None
