"""Implicit surface that a garment is cut from: a smooth solid around the body, as a signed field on a grid.

The solid is a union of three, each grown by its own distance:

- the body itself, by `clearance` (this shapes shoulders and neck);
- the torso, one convex section per height, which never narrows again below the armpits, for cloth hangs
  from its widest support; a flare widens it from the waist to the hem;
- the upper arm, one convex section per distance from the shoulder.

A skirt is the same without sleeves, hanging from its waistband and widening from the hips on. For
trousers the torso ends at the crotch and a leg begins, one convex section per height.

Convex sections grown by d have 2 pi d more girth (Steiner's formula), so ease of girth e is a growth of
e/(2 pi); it sets in between armpit and waist, and between shoulder and cuff. Only the half x >= 0 is
built, and mirrored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from reference_sim.cloth import edge_table
from reference_sim.geometry.topology import Array, Index
from snug.body.parametric_body import Body
from snug.body.skeleton import JOINT

TORSO_BONES = (
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "spine2",
    "spine3",
    "left_collar",
    "right_collar",
)
# Joints whose weights a shirt may borrow: never hands, head or shins, even where they come near.
SHIRT_BONES = (*TORSO_BONES, "left_shoulder", "right_shoulder")
ARM_BONES = ("left_shoulder", "left_elbow")
LEG_BONES = ("left_hip", "left_knee")
CROTCH_BONES = ("pelvis", "left_hip", "right_hip")


def skin_following(body: Body, names: Sequence[str]) -> NDArray[np.bool_]:
    """Return which body vertices (B,) have one of the joints `names` as their strongest weight."""
    joints = [JOINT[name] for name in names]
    return np.isin(np.argmax(body.skinning_weights, axis=1), joints)


def joint_position(body: Body, name: str) -> Array:
    """Return the rest position (3,) [m] of the joint called `name`."""
    return body.joint_template[JOINT[name]]


GRID_SPACING = 0.012  # [m] of the grid: finer than any cloth edge in the tests
SUPPORT_DIRECTIONS = 64  # support directions of a convex section: 0.1 % of girth
ARMPIT_FILLET = 0.08  # [m] range over which torso and sleeve melt into each other
CROTCH_FILLET = 0.03  # [m] the same between torso and leg
TAPER = 0.4  # how steeply trousers may narrow from the seat to the thighs


@dataclass(frozen=True)
class ImplicitSurface:
    """Signed field, negative inside, on a grid over x >= 0 (three more planes beyond, mirrored).

    Attributes:
        origin: (3,) [m] of the first node; they are GRID_SPACING apart.
        values: (nx, ny, nz) [m], close to a distance near zero.
        coefficients: of a cubic spline through `values`.
    """

    origin: Array
    values: Array
    coefficients: Array

    def field(self, points: Array) -> Array:
        """Return the field (N,) [m] at points (N,3) [m], cubic between the nodes."""
        nodes = ((points - self.origin) / GRID_SPACING).T
        return ndimage.map_coordinates(self.coefficients, nodes, order=3, prefilter=False, mode="nearest")

    def gradient(self, points: Array) -> Array:
        """Return the gradient (N,3) of the field at points (N,3), by central differences of half a cell."""
        step = 0.5 * GRID_SPACING
        shifts = step * np.eye(3)
        columns = [self.field(points + s) - self.field(points - s) for s in shifts]
        return np.stack(columns, axis=1) / (2 * step)

    def project(self, points: Array) -> Array:
        """Move points (N,3) onto the zero level along the gradient, in two steps."""
        for _ in range(2):
            slope = self.gradient(points)
            length2 = np.maximum(np.sum(slope * slope, axis=1), 0.05)
            points = points - (self.field(points) / length2)[:, None] * slope
        return points


def _smooth_minimum(a: Array, b: Array, reach: float) -> Array:
    """Return the minimum, blended where |a - b| < reach by a polynomial; never above the sharp one."""
    overlap = np.maximum(reach - np.abs(a - b), 0.0)
    return np.minimum(a, b) - overlap * overlap / (4.0 * reach)


def _section_support(points: Array, edges: Index, levels: Array, axis: int, normals: Array) -> Array:
    """Return the support function (L,K) of the body's sections at `levels` along `axis`; -inf without one."""
    plane = [i for i in range(3) if i != axis]
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    support = np.full((len(levels), len(normals)), -np.inf)
    for row, level in enumerate(levels):
        crossing = (start[:, axis] - level) * (end[:, axis] - level) <= 0
        a, b = start[crossing], end[crossing]
        rise = b[:, axis] - a[:, axis]
        share = np.where(rise == 0, 0.0, (level - a[:, axis]) / np.where(rise == 0, 1.0, rise))
        cut = (a + share[:, None] * (b - a))[:, plane]
        if len(cut):
            support[row] = (cut @ normals.T).max(axis=0)
    return support


def _fill_levels(support: Array) -> Array:
    """Give levels without a section the section of the nearest level that has one."""
    rows = np.flatnonzero(np.isfinite(support[:, 0]))
    nearest = rows[np.abs(np.arange(len(support))[:, None] - rows).argmin(axis=1)]
    return support[nearest]


def _ramp(value: Array, start: float, end: float) -> Array:
    """Return 0 at `start`, 1 at `end`, smooth between them (smoothstep)."""
    t = np.clip((value - start) / (end - start), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


class _Sections:
    """Convex sections of a body across the axes of a grid, nodes (nx,), (ny,), (nz,) [m]."""

    def __init__(self, body: Body, nodes: Sequence[Array]) -> None:
        self.body, self.nodes = body, nodes
        angle = 2 * np.pi * np.arange(SUPPORT_DIRECTIONS) / SUPPORT_DIRECTIONS
        self.normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def support(self, bones: Sequence[str], axis: int) -> Array:
        """Return the support function (L,K) of the sections of `bones` at each node of an axis."""
        points, edges = self.body.template, _edges(self.body, bones)
        return _fill_levels(_section_support(points, edges, self.nodes[axis], axis, self.normals))

    def field(self, support: Array, growth: Array, axis: int) -> Array:
        """Return the distance (nx,ny,nz) to sections `support` (L,K) grown by `growth` (L,)."""
        plane = [nodes for k, nodes in enumerate(self.nodes) if k != axis]
        height = np.stack(np.meshgrid(*plane, indexing="ij"), axis=-1).reshape(-1, 2) @ self.normals.T
        levels = zip(support, growth, strict=True)
        distance = np.stack([(height - row).max(axis=1) - grown for row, grown in levels])
        return np.moveaxis(distance.reshape(-1, *map(len, plane)), 0, axis)


def _torso(sections: _Sections, hang: float, growth: Array, narrowing: float) -> Array:
    """Return the field (nx,ny,nz) of sections that hang from height `hang` [m], grown by (ny,) [m].

    narrowing: how much [m/m] they may come nearer again on the way down.
    """
    y = sections.nodes[1]
    support = sections.support(TORSO_BONES, 1)
    mirrored = (SUPPORT_DIRECTIONS // 2 - np.arange(SUPPORT_DIRECTIONS)) % SUPPORT_DIRECTIONS
    # Both sides of a body that is not quite symmetric.
    support = np.maximum(support, support[:, mirrored])
    rows = np.flatnonzero(y <= hang)
    fall = narrowing * y[rows, None]
    support[rows] = np.maximum.accumulate((support[rows] - fall)[::-1], axis=0)[::-1] + fall
    smooth = ndimage.gaussian_filter1d(support, 0.03 / GRID_SPACING, axis=0, mode="nearest")
    support[rows] = np.maximum(smooth, support)[rows]
    shoulder = joint_position(sections.body, "left_shoulder")[1]
    return np.maximum(sections.field(support, growth, 1), (y - shoulder)[None, :, None])


def _sleeve(sections: _Sections, cuff: float, ease: float, clearance: float) -> Array:
    """Return the field (nx,ny,nz) of the left sleeve."""
    x = sections.nodes[0]
    shoulder = joint_position(sections.body, "left_shoulder")[0]
    support = ndimage.gaussian_filter1d(
        sections.support(ARM_BONES, 0), 0.02 / GRID_SPACING, axis=0, mode="nearest"
    )
    growth = clearance + ease / (2 * np.pi) * _ramp(x, shoulder, cuff)
    return np.maximum(sections.field(support, growth, 0), (shoulder - x)[:, None, None])


def _leg(sections: _Sections, crotch: float, ease: float, clearance: float) -> Array:
    """Return the field (nx,ny,nz) of the left leg of trousers."""
    y = sections.nodes[1]
    hip, knee = (joint_position(sections.body, name)[1] for name in ("left_hip", "left_knee"))
    support = ndimage.gaussian_filter1d(
        sections.support(LEG_BONES, 1), 0.03 / GRID_SPACING, axis=0, mode="nearest"
    )
    # Legs that part once do not meet again above: up from the knee the inner side only comes nearer.
    rows, inner = np.flatnonzero(y >= knee), sections.normals[:, 0] < 0
    support[np.ix_(rows, inner)] = np.maximum.accumulate(support[np.ix_(rows, inner)], axis=0)
    growth = clearance + ease / (2 * np.pi) * _ramp(-y, -crotch, -knee)
    return np.maximum(sections.field(support, growth, 1), (y - hip)[None, :, None])


def legs_part(body: Body, room: float) -> float:
    """Return the height [m] below which trousers have two legs: `room` [m] from the thigh's skin to x = 0."""
    points, edges = body.template, _edges(body, LEG_BONES)
    knee, hip = (joint_position(body, name)[1] for name in ("left_knee", "left_hip"))
    levels = np.arange(knee, hip, 0.5 * GRID_SPACING)
    inner = _fill_levels(_section_support(points, edges, levels, 1, np.array([[-1.0, 0.0]])))[:, 0]
    rows = np.flatnonzero(np.maximum.accumulate(inner) > -room)
    middle = skin_following(body, CROTCH_BONES) & (np.abs(points[:, 0]) < max(room, GRID_SPACING))
    crotch = points[middle, 1].min(initial=levels[-1]) - room  # of legs that are apart all the way up
    return float(min(levels[rows[0]], crotch) if len(rows) else crotch)


def _edges(body: Body, bones: Sequence[str]) -> Index:
    """Return the edges (E,2) of the body between vertices that follow `bones`."""
    edges = edge_table(body.faces, len(body.template))[0]
    return edges[skin_following(body, bones)[edges].all(axis=1)]


def build_surface(
    body: Body, *, hem: float, top: float, ease: float, clearance: float, cuff: float | None = None,
    flare: float = 0.0, waistband: bool = False, legs: bool = False,
) -> ImplicitSurface:  # fmt: skip
    """Build the surface of a garment between the heights hem and top [m].

    Ease, clearance and flare [m] are those of `GarmentTemplate.tailor`. Sleeves end at x = cuff [m]. With
    a waistband it hangs from the hips instead of the shoulders, with legs it is a pair of trousers.
    """
    import igl  # not loaded where garments are only named

    points = body.template
    torso, arm, leg = (skin_following(body, bones) for bones in (TORSO_BONES, ARM_BONES, LEG_BONES))
    hang = top if waistband else points[skin_following(body, ARM_BONES[:1]), 1].min()
    waist = joint_position(body, "pelvis" if waistband else "spine1")[1]
    margin = 0.04
    depth = points[torso | (leg if legs else arm), 2]
    reach = clearance + ease + flare + 2 * margin
    side = points[torso | leg if legs else torso, 0].max() + reach if cuff is None else cuff + margin
    low = np.array([0.0, hem - margin, depth.min() - reach])
    high = np.array([side, top + margin, depth.max() + reach])
    counts = np.ceil((high - low) / GRID_SPACING).astype(int) + 1
    nodes = [low[i] + GRID_SPACING * np.arange(counts[i]) for i in range(3)]
    grid = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    # The fast sign is a quarter of the time; it moves the distance by under a millimetre, and what is
    # promised about clearance is enforced on the finished mesh.
    sign = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    distance = igl.signed_distance(grid, points, body.faces, sign_type=sign)[0].reshape(counts)
    sections, y = _Sections(body, nodes), nodes[1]
    growth = clearance + ease / (2 * np.pi) * _ramp(y, hang, waist)
    growth += flare * np.clip((waist - y) / (waist - hem), 0.0, None)  # a cone: its sides are straight
    hanging = _torso(sections, hang, growth, TAPER * legs)
    if cuff is not None:
        sleeve = _sleeve(sections, cuff, ease, clearance)
        hanging = _smooth_minimum(hanging, sleeve, ARMPIT_FILLET)
    if legs:
        crotch = legs_part(body, clearance + ease / (2 * np.pi))
        leg_field = _leg(sections, crotch, ease, clearance)
        above_crotch = np.maximum(hanging, (crotch - y)[None, :, None])
        hanging = _smooth_minimum(above_crotch, leg_field, CROTCH_FILLET)
    values = np.minimum(hanging, distance - clearance)  # a blend would add girth wherever both agree
    ghost = 3
    values = np.pad(values, ((ghost, 0), (0, 0), (0, 0)), mode="reflect")
    # Rounds the creases where one solid meets another. Once alone would move a surface of radius r inward
    # by sigma^2/(2 r); twice minus twice over cancels that.
    soft = ndimage.gaussian_filter(values, 1.0)
    values = 2 * soft - ndimage.gaussian_filter(soft, 1.0)
    origin = low - [ghost * GRID_SPACING, 0, 0]
    return ImplicitSurface(origin, values, ndimage.spline_filter(values, order=3))
