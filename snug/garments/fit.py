"""Does a garment lie on the body it was made for? Depth below the skin, and what a wrong place comes from.

A unit or an axis mistaken, or a body that stands elsewhere, is found by trying what mends it: the other units
and axes as they are, then with a shift. A shift is found from the distances s_i [m] of vertices to the skin
(negative below it) and the skin's normals n_i: one thickness of air, s_i + n_i.d = m for all i, by least
squares with the far ones held back (Huber), begun from many places. How high a wide skirt sits is a guess.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reference_sim.files.mesh_files import METRES, UP_AXES, to_metres_y_up
from reference_sim.obstacle import Obstacle
from snug.body.parametric_body import Body
from snug.garments.landmarks import skin_of

Array = NDArray[np.float64]

DEEP = 0.02  # [m] below the skin, from which contact may not find the way out
DEEP_SHARE = 0.05  # of the vertices that may be so deep
DEEPEST = 0.04  # [m], half the thickness of an arm
NEAR = 0.05  # [m] from the skin: whatever is worn has a tenth of its vertices there
NEAR_SHARE = 0.1
SIZES = 0.1, 1.2  # largest extent of a garment [heights of the body]
ENDS = ("head", "left_wrist", "right_wrist", "left_hand", "right_hand", "left_ankle", "right_ankle",
        "left_foot", "right_foot")  # fmt: skip
# A wide dress has a cost of .2, a shirt around the knees of .5 and a tenth of that in its place.
DOUBTFUL, BETTER = 0.3, 0.4
SAMPLES = 250  # vertices that a shift is sought with
STEPS = 20
CLOSE = 0.2  # share of the vertices that are closer than the thickness m: what a garment hangs by
HUBER, FAR = 0.01, 0.2  # [m] differences from it that count fully, and at most
LONGEST = 0.1  # [m] step
AIR = 0.003  # [m] between skin and garment after a shift


@dataclass(frozen=True)
class Fit:
    """How a garment lies on the unposed body.

    distances: (V,) [m] of its vertices to the skin, negative below it. size: its largest extent [heights of
    the body]. at_ends: share of the vertices whose nearest skin is of head, hands or feet.
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
        """[m] of the deepest vertex, 0 where none is below the skin."""
        return max(0.0, -float(self.distances.min()))

    @property
    def problem(self) -> str:
        """Why nothing can be simulated from here, or empty."""
        if not SIZES[0] < self.size < SIZES[1]:
            return f"its largest extent is {self.size:.3g} times the body's height"
        if np.mean(np.abs(self.distances) < NEAR) < NEAR_SHARE:
            return f"it lies {1e3 * np.median(np.abs(self.distances)):.0f} mm from the body"
        if self.depth > DEEPEST or np.mean(self.distances < -DEEP) > DEEP_SHARE:
            return f"it lies up to {1e3 * self.depth:.0f} mm deep in the body, with {self.below:.0%} of it"
        if self.at_ends > 0.5:
            return f"{self.at_ends:.0%} of it lies around head, hands or feet"
        return ""

    @property
    def cost(self) -> float:
        """Unevenness of the air below it, and depth, over its size; less is more likely its place."""
        off = np.abs(self.distances - np.quantile(self.distances, CLOSE))
        uneven = np.minimum(off, FAR).mean() + 5 * np.maximum(-self.distances, 0.0).mean()
        return float(uneven / self.size + self.at_ends)


def pose_in_file(body: Body) -> Array:
    """The pose (24,3) [rad] that a body has in its file, in which garments were made for it."""
    pose = np.zeros((len(body.joint_names), 3))
    if body.arms_lowered is None:
        return pose
    pose[body.joint_names.index("left_shoulder"), 2] = -body.arms_lowered[0]
    pose[body.joint_names.index("right_shoulder"), 2] = body.arms_lowered[1]
    return pose


def body_as_in_file(body: Body) -> Body:
    """The mean body with template and joints as its file has them."""
    if body.arms_lowered is None:
        return body
    pose, here = pose_in_file(body)[None], np.zeros((1, 3))
    moved = body.transforms(pose, here)[0]
    joints = np.einsum("jab,jb->ja", moved[..., :3], body.joint_template) + moved[..., 3]
    return replace(body, template=body.vertices(pose, here)[0], joint_template=joints)


class DressForm:
    """The mean body, as its file has it, as something to measure distances to. body: that one."""

    def __init__(self, body: Body) -> None:
        self.body = body = body_as_in_file(body)
        self.height = body.height
        self.low, self.high = body.template.min(axis=0), body.template.max(axis=0)
        self.skin = Obstacle(body.template, body.faces)
        at_ends = np.isin(body.faces, np.flatnonzero(skin_of(body, ENDS)))
        self.ends: NDArray[np.bool_] = at_ends.sum(axis=1) == 3  # faces (F,)

    def fit(self, positions: Array) -> Fit:
        """How positions (V,3) [m] lie on it."""
        return self._fit(positions, self.skin.signed_distance(positions, 0))

    def _fit(self, positions: Array, distances: Array) -> Fit:
        size = float(np.ptp(positions, axis=0).max()) / self.height
        faces = self.skin.planes(positions, 0).faces
        return Fit(distances, size, float(self.ends[faces].mean()))

    def problem(self, positions: Array, fit: Fit) -> str:
        """Why a garment that lies so cannot be simulated, or empty."""
        if fit.problem or fit.cost < DOUBTFUL or (found := self.shift(positions)) is None:
            return fit.problem
        way = float(np.linalg.norm(found))
        return f"it fits far better {way:.2f} m away" * (self.fit(positions + found).cost < BETTER * fit.cost)

    def shift(self, positions: Array) -> Array | None:
        """The translation (3,) [m] that brings a garment (V,3) [m] onto the body, or None."""
        samples = positions[:: max(1, len(positions) // SAMPLES)]
        settled = [self._settled(samples, start) for start in self._starts(samples)]
        costs = [self.fit(samples + shift).cost for shift in settled]
        # To the millimetre, as somebody will type it.
        found = np.round(self._pushed_out(samples, settled[int(np.argmin(costs))]), 3)
        return None if self.fit(positions + found).problem else found

    def _starts(self, points: Array) -> list[Array]:
        """As it lies, and over the body's middle at several heights."""
        centre = 0.5 * (self.low + self.high) - 0.5 * (points.min(axis=0) + points.max(axis=0))
        heights = np.linspace(-0.4, 0.4, 17) * self.height
        return [np.zeros(3), *(centre + np.array([0.0, height, 0.0]) for height in heights)]

    def _settled(self, points: Array, shift: Array) -> Array:
        """Where the least squares end from there."""
        for _ in range(STEPS):
            distance, normals = self._distances(points + shift)
            system = np.column_stack([normals, -np.ones(len(points))])
            off = distance - np.quantile(distance, CLOSE)
            weight = np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.abs(off), 1e-12)))
            step = np.linalg.lstsq(weight[:, None] * system, -weight * distance, rcond=None)[0][:3]
            shift = shift + step * min(1.0, LONGEST / max(float(np.linalg.norm(step)), 1e-12))
        return shift

    def _pushed_out(self, points: Array, shift: Array) -> Array:
        """From there the shift by which what is below the skin comes out of it."""
        for _ in range(STEPS):
            distance, normals = self._distances(points + shift)
            inside = distance < AIR
            if not inside.any():
                break
            # Pulled back a little, so that what is free stays near.
            system = normals[inside].T @ normals[inside] + 0.02 * len(points) * np.eye(3)
            shift = shift + np.linalg.solve(system, normals[inside].T @ (AIR - distance[inside]))
        return shift

    def _distances(self, points: Array) -> tuple[Array, Array]:
        planes = self.skin.planes(points, 0)
        return np.einsum("vi,vi->v", planes.normals, points - planes.points), planes.normals


@dataclass(frozen=True)
class Placement:
    """What would bring a garment onto the body: units and axis of its file, and a shift (3,) [m]."""

    units: str
    up: str
    shift: tuple[float, float, float]


def find_placement(wearer: DressForm, raw: Array, units: str, up: str, shift: Array) -> Placement | None:
    """What to say instead of units, up and shift of a file's vertices (V,3), so that they lie on the body.

    First other units and axes alone, then a shift, then both. None where nothing of it helps.
    """
    choices = sorted(
        ((u, a) for u in METRES for a in UP_AXES), key=lambda choice: (choice[0] != units) + (choice[1] != up)
    )
    placed = {choice: to_metres_y_up(raw, units=choice[0], up=choice[1]) for choice in choices}
    fits = {choice: wearer.fit(positions + shift) for choice, positions in placed.items()}
    if worn := [choice for choice, fit in fits.items() if not fit.problem and fit.cost < DOUBTFUL]:
        return Placement(*min(worn, key=lambda choice: fits[choice].cost), _three(shift))
    for (u, a), positions in placed.items():
        if SIZES[0] < fits[u, a].size < SIZES[1] and (found := wearer.shift(positions)) is not None:
            return Placement(u, a, _three(found))
    return None


def _three(shift: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) + 0.0 for value in shift)
    return x, y, z
