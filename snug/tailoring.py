"""The implicit surface a garment is cut from: a smooth solid around the body, as a signed field on a grid.

A shirt that followed the skin would be pressed into the waist and between the legs, where cloth never goes.
So the solid is a union of three solids, each grown by its own distance:

- the body itself, by `clearance` (this shapes shoulders and neck);
- the torso, one convex section per height, which below the armpits never narrows again on the way down:
  cloth hangs from its widest support; a flare widens it further, from the waist to the hem;
- the upper arm, one convex section per distance from the shoulder.

A skirt is the same without sleeves, hanging from its waistband and widening from the hips on.

Convex sections grown by d have 2 pi d more girth (Steiner's formula), so ease of girth e is a growth of
e/(2 pi); it sets in between armpit and waist, and between shoulder and cuff. Only the half x >= 0 is built;
the other half is its mirror image, so the garment is exactly symmetric.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from snug.body import Body
from snug.remeshing import boundary_loops

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SPACING = 0.012  # [m] grid of the surface: finer than any cloth edge that the tests ask for
DIRECTIONS = 64  # support directions of a convex section: 0.1 % of girth
ARMPIT_FILLET = 0.08  # [m] range over which torso and sleeve melt into each other
TORSO_BONES = ("pelvis", "left_hip", "right_hip", "spine1", "spine2", "spine3", "left_collar", "right_collar")
ARM_BONES = ("left_shoulder", "left_elbow")


def dominated_by(body: Body, names: Sequence[str]) -> NDArray[np.bool_]:
    """Which body vertices (B,) have one of the joints `names` as their strongest skinning weight."""
    wanted = [body.joint_names.index(name) for name in names]
    return np.isin(np.argmax(body.skinning_weights, axis=1), wanted)


def joint(body: Body, name: str) -> Array:
    """Rest position (3,) [m] of the joint called `name`."""
    return np.asarray(body.joint_template, dtype=np.float64)[body.joint_names.index(name)]


@dataclass(frozen=True)
class ImplicitSurface:
    """Signed field, negative inside, on a grid over x >= 0 (three more planes beyond, mirrored).

    origin: (3,) [m] of the first node; spacing [m]; values: (nx, ny, nz) [m], close to a distance near zero.
    """

    origin: Array
    spacing: float
    values: Array
    coefficients: Array  # cubic spline coefficients of `values`

    def field(self, points: Array) -> Array:
        """Field (N,) [m] at points (N,3) [m], cubic in between the nodes."""
        nodes = ((points - self.origin) / self.spacing).T
        return ndimage.map_coordinates(self.coefficients, nodes, order=3, prefilter=False, mode="nearest")

    def gradient(self, points: Array) -> Array:
        """Gradient (N,3) of the field at points (N,3), by central differences of half a cell."""
        step = 0.5 * self.spacing
        shifts = step * np.eye(3)
        columns = [self.field(points + s) - self.field(points - s) for s in shifts]
        return np.stack(columns, axis=1) / (2 * step)

    def project(self, points: Array, steps: int = 2) -> Array:
        """Points (N,3) moved onto the zero level along the gradient."""
        for _ in range(steps):
            slope = self.gradient(points)
            length2 = np.maximum(np.sum(slope * slope, axis=1), 0.05)
            points = points - (self.field(points) / length2)[:, None] * slope
        return points


def _smooth_minimum(a: Array, b: Array, reach: float) -> Array:
    """Minimum with a polynomial blend where |a - b| < reach; never above the sharp minimum."""
    overlap = np.maximum(reach - np.abs(a - b), 0.0)
    return np.minimum(a, b) - overlap * overlap / (4.0 * reach)


def _section_support(points: Array, edges: Index, levels: Array, axis: int, normals: Array) -> Array:
    """Support function (L,K) of the body's sections at `levels` along `axis`; -inf where there is none."""
    others = [i for i in range(3) if i != axis]
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    support = np.full((len(levels), len(normals)), -np.inf)
    for row, level in enumerate(levels):
        crossing = (start[:, axis] - level) * (end[:, axis] - level) <= 0
        a, b = start[crossing], end[crossing]
        rise = b[:, axis] - a[:, axis]
        share = np.where(rise == 0, 0.0, (level - a[:, axis]) / np.where(rise == 0, 1.0, rise))
        cut = (a + share[:, None] * (b - a))[:, others]
        if len(cut):
            support[row] = (cut @ normals.T).max(axis=0)
    return support


def _filled(support: Array) -> Array:
    """Levels without a section take the nearest level's that has one."""
    known = np.flatnonzero(np.isfinite(support[:, 0]))
    nearest = known[np.abs(np.arange(len(support))[:, None] - known).argmin(axis=1)]
    return support[nearest]


def _ramp(value: Array, start: float, end: float) -> Array:
    """0 at `start`, 1 at `end`, smooth in between (smoothstep)."""
    t = np.clip((value - start) / (end - start), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _tube(support: Array, growth: Array, plane: Array, normals: Array) -> Array:
    """Distance (L,P) to convex sections `support` (L,K) grown by `growth` (L,), at in-plane points (P,2)."""
    height = plane @ normals.T  # (P,K)
    return np.stack([(height - row).max(axis=1) - grown for row, grown in zip(support, growth, strict=True)])


def _torso(
    body: Body, edges: Index, points: Array, nodes: Sequence[Array], levels: tuple[float, float, float],
    ease: float, flare: float, clearance: float, normals: Array,
) -> Array:  # fmt: skip
    """Field (nx,ny,nz) of hanging sections; levels: where they hang from, have their ease, and end [m]."""
    x, y, z = nodes
    support = _filled(_section_support(points, edges, y, 1, normals))
    mirrored = (DIRECTIONS // 2 - np.arange(DIRECTIONS)) % DIRECTIONS
    support = np.maximum(
        support, support[:, mirrored]
    )  # a body that is not quite symmetric: both of its sides
    hang, waist, hem = levels
    below = np.flatnonzero(y <= hang)
    support[below] = np.maximum.accumulate(support[below][::-1], axis=0)[::-1]
    smooth = ndimage.gaussian_filter1d(support, 0.03 / SPACING, axis=0, mode="nearest")
    support[below] = np.maximum(smooth, support)[below]
    growth = clearance + ease / (2 * np.pi) * _ramp(y, hang, waist)
    growth += flare * np.clip((waist - y) / (waist - hem), 0.0, None)  # a cone: its sides are straight
    plane = np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1).reshape(-1, 2)
    field = _tube(support, growth, plane, normals).reshape(len(y), len(x), len(z)).transpose(1, 0, 2)
    return np.maximum(field, (y - joint(body, "left_shoulder")[1])[None, :, None])


def _sleeve(
    body: Body, edges: Index, points: Array, nodes: Sequence[Array], cuff: float, ease: float,
    clearance: float, normals: Array,
) -> Array:  # fmt: skip
    """Field (nx,ny,nz) of the left sleeve."""
    x, y, z = nodes
    shoulder = joint(body, "left_shoulder")[0]
    support = _filled(_section_support(points, edges, x, 0, normals))
    support = ndimage.gaussian_filter1d(support, 0.02 / SPACING, axis=0, mode="nearest")
    growth = clearance + ease / (2 * np.pi) * _ramp(x, shoulder, cuff)
    plane = np.stack(np.meshgrid(y, z, indexing="ij"), axis=-1).reshape(-1, 2)
    field = _tube(support, growth, plane, normals).reshape(len(x), len(y), len(z))
    return np.maximum(field, (shoulder - x)[:, None, None])


def build_surface(
    body: Body, *, hem: float, top: float, ease: float, clearance: float, cuff: float | None = None,
    flare: float = 0.0,
) -> ImplicitSurface:  # fmt: skip
    """The surface between heights `hem` and `top`, of a shirt out to x = `cuff`, else of a skirt (all [m]).

    `ease` [m] is girth added to waist and sleeves beyond a shirt that lies `clearance` [m] off the skin, or
    to the hips of a skirt; `flare` [m] is how much further the hem stands off than that place, all around.
    """
    import igl

    points = np.asarray(body.template, dtype=np.float64)
    faces = np.asarray(body.faces, dtype=np.int64)
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    torso = dominated_by(body, TORSO_BONES)
    arm = dominated_by(body, ARM_BONES)
    torso_edges, arm_edges = edges[torso[edges].all(axis=1)], edges[arm[edges].all(axis=1)]
    skirt = cuff is None
    hang = top if skirt else points[dominated_by(body, ARM_BONES[:1]), 1].min()
    levels = hang, joint(body, "pelvis" if skirt else "spine1")[1], hem
    margin = 0.04
    depth = points[torso | arm, 2]
    reach = clearance + ease + flare + 2 * margin
    side = points[torso, 0].max() + reach if cuff is None else cuff + margin
    low = np.array([0.0, hem - margin, depth.min() - reach])
    high = np.array([side, top + margin, depth.max() + reach])
    counts = np.ceil((high - low) / SPACING).astype(int) + 1
    nodes = [low[i] + SPACING * np.arange(counts[i]) for i in range(3)]
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    grid = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    # The fast sign is a quarter of the time; it moves the distance by under a millimetre, and what is
    # promised about clearance is enforced on the finished mesh.
    sign = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    distance = igl.signed_distance(grid, points, faces, sign_type=sign)[0].reshape(counts)
    hanging = _torso(body, torso_edges, points, nodes, levels, ease, flare, clearance, normals)
    if cuff is not None:
        sleeve = _sleeve(body, arm_edges, points, nodes, cuff, ease, clearance, normals)
        hanging = _smooth_minimum(hanging, sleeve, ARMPIT_FILLET)
    values = np.minimum(hanging, distance - clearance)  # a blend would add girth wherever both agree
    ghost = 3
    values = np.pad(values, ((ghost, 0), (0, 0), (0, 0)), mode="reflect")
    # Rounds the creases where one solid meets another. Once alone would move a surface of radius r inward by
    # sigma^2/(2 r); twice minus twice over cancels that.
    soft = ndimage.gaussian_filter(values, 1.0)
    values = 2 * soft - ndimage.gaussian_filter(soft, 1.0)
    origin = low - [ghost * SPACING, 0, 0]
    return ImplicitSurface(origin, SPACING, values, ndimage.spline_filter(values, order=3))


@dataclass(frozen=True)
class CutPlane:
    """A plane through `point` (3,) [m]: on the side of its `normal` (3,), what has |x| < reach [m] is cut.

    bend [1/m] curves it in z: bend (z - z0)^2 [m] beyond the plane.
    """

    name: str
    normal: tuple[float, float, float]
    point: tuple[float, float, float]
    reach: float = np.inf
    bend: float = 0.0

    def beyond(self, points: Array) -> Array:
        """How far (N,) [m] points (N,3) are on the side that is cut away; a distance to first order."""
        offset = points - self.point
        height = offset @ np.asarray(self.normal) + self.bend * offset[:, 2] ** 2
        return np.minimum(
            height / np.linalg.norm(self._slope(points), axis=1), self.reach - np.abs(points[:, 0])
        )

    def normals(self, points: Array) -> Array:
        """Unit normals (N,3) at points (N,3) of the cut."""
        slope = self._slope(points)
        return slope / np.linalg.norm(slope, axis=1, keepdims=True)

    def _slope(self, points: Array) -> Array:
        slope = np.tile(np.asarray(self.normal), (len(points), 1))
        slope[:, 2] += 2 * self.bend * (points[:, 2] - self.point[2])
        return slope


def cut_sheet(surface: ImplicitSurface, cuts: list[CutPlane]) -> tuple[Array, Index]:
    """The surface as a dense mesh between the cuts: points (N,3) [m], faces (M,3), wound outward."""
    import pyvista

    grid = pyvista.ImageData(
        dimensions=surface.values.shape,
        spacing=(surface.spacing,) * 3,
        origin=tuple(map(float, surface.origin)),
    )
    grid["field"] = surface.values.ravel(order="F")
    sheet = grid.contour([0.0], scalars="field")
    for cut in cuts:
        sheet["cut"] = cut.beyond(np.asarray(sheet.points, dtype=np.float64))
        sheet = sheet.clip_scalar(scalars="cut", value=0.0)
        # Clipping interpolates linearly along edges: onto a bent cut by one Newton step.
        points = np.asarray(sheet.points, dtype=np.float64)
        off = cut.beyond(points)
        near = np.abs(off) < 2e-4
        points[near] -= off[near, None] * cut.normals(points[near])
        sheet.points = points
    sheet = sheet.triangulate().clean(tolerance=1e-6).connectivity("largest")
    points = np.asarray(sheet.points, dtype=np.float64)
    faces = np.asarray(sheet.regular_faces, dtype=np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    if np.sum(np.cross(b - a, c - a) * surface.gradient((a + b + c) / 3)) < 0:
        faces = faces[:, ::-1]
    return points, faces


def outlines(points: Array, faces: Index, cuts: list[CutPlane]) -> list[list[tuple[str, Array]]]:
    """Per boundary loop of a cut sheet its named curves (P,3) [m], end to end along the winding.

    Errors: ValueError where the surface is open but no cut was made.
    """
    found = []
    for loop in boundary_loops(faces):
        distance = np.abs(np.stack([cut.beyond(points[loop]) for cut in cuts]))
        on = distance < 1e-5
        corners = np.flatnonzero(on.sum(axis=0) > 1)
        if len(corners) == 0:
            found.append([(cuts[int(np.argmin(distance.sum(axis=1)))].name, points[loop])])
            continue
        loop, on = np.roll(loop, -corners[0]), np.roll(on, -corners[0], axis=1)
        stops = [*np.flatnonzero(on.sum(axis=0) > 1), len(loop)]
        ring = np.append(loop, loop[0])
        curves = []
        for begin, end in pairwise(stops):
            middle = np.flatnonzero(on[:, begin + 1 : end].all(axis=1))
            if len(middle) != 1 or end - begin < 2:
                raise ValueError("the surface has an opening that no cut made")
            curves.append((cuts[int(middle[0])].name, points[ring[begin : end + 1]]))
        found.append(curves)
    return found
