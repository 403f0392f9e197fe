"""Cuts through a garment's surface, and the dense sheet with named outlines between them."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from reference_sim.geometry.topology import Array, Index, boundary_loops
from snug.body.parametric_body import Body
from snug.garments.implicit_surface import (
    GRID_SPACING,
    SHIRT_BONES,
    TORSO_BONES,
    ImplicitSurface,
    joint_position,
    skin_following,
)

SEAM = "seam"  # the cut at x = 0, where the half is mirrored
# [m] in z: a bent cut is a parabola so far and level from twice as far, or it would reach a heavy chest.
BEND_SPAN = 0.1
NECK_ROOM = 0.01  # [m] between a neck's cut and what it must not take
ARMPIT_ROOM = 0.02  # [m] of an armhole, below the arm, and along the shoulder
FLANK_ROOM = 0.005  # [m] between an armhole's cut and the flanks below it


@dataclass(frozen=True)
class CutPlane:
    """A plane that cuts the surface.

    Attributes:
        name: of the opening.
        normal: (3,), towards the side that is cut away.
        point: (3,) [m] of the plane.
        reach: only |x| < reach [m] is cut.
        bend: [1/m] curves it in z: bend (z - z0)^2 [m] beyond the plane, up to BEND_SPAN.
    """

    name: str
    normal: tuple[float, float, float]
    point: tuple[float, float, float]
    reach: float = np.inf
    bend: float = 0.0

    def height(self, points: Array) -> Array:
        """Return how far (N,) [m] points (N,3) are beyond the bent plane along its normal, at any x."""
        offset = points - self.point
        return offset @ self.normal + self.bend * _saturated_square(offset[:, 2])

    def depth(self, points: Array) -> Array:
        """Return how far (N,) [m] points (N,3) are on the side that is cut away, to first order."""
        return np.minimum(
            self.height(points) / np.linalg.norm(self._slope(points), axis=1),
            self.reach - np.abs(points[:, 0]),
        )

    def normals(self, points: Array) -> Array:
        """Return unit normals (N,3) at points (N,3) of the cut."""
        slope = self._slope(points)
        return slope / np.linalg.norm(slope, axis=1, keepdims=True)

    def _slope(self, points: Array) -> Array:
        """Return the gradient (N,3) of `height`."""
        slope = np.tile(self.normal, (len(points), 1))
        offset = points[:, 2] - self.point[2]
        rising = np.minimum(np.abs(offset), np.maximum(2 * BEND_SPAN - np.abs(offset), 0.0))
        slope[:, 2] += 2 * self.bend * np.copysign(rising, offset)
        return slope


def _saturated_square(x: Array) -> Array:
    """Return x^2 up to BEND_SPAN, constant from twice that on, with a continuous slope."""
    room = np.maximum(2 * BEND_SPAN - np.abs(x), 0.0)
    return np.where(np.abs(x) <= BEND_SPAN, x**2, 2 * BEND_SPAN**2 - room**2)


SEAM_CUT = CutPlane(SEAM, (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def level_cut(name: str, height: float, *, down: bool = False) -> CutPlane:
    """Return the cut of all above that height [m], or of all below it."""
    return CutPlane(name, (0.0, -1.0 if down else 1.0, 0.0), (0.0, height, 0.0))


def neck_cut(body: Body, clearance: float) -> CutPlane:
    """Return a crew neck: at the neck's joint on the shoulders, bent down in front and a little behind.

    Lifted where shoulders stand so high that the cut would take them with it.
    """
    neck, shoulder = joint_position(body, "neck"), joint_position(body, "left_shoulder")[0]
    cut = CutPlane("neck", (0.0, 1.0, 0.3), (0.0, neck[1], neck[2]), reach=0.85 * shoulder, bend=3.0)
    skin = body.template[skin_following(body, SHIRT_BONES)]
    over = skin[np.abs(np.abs(skin[:, 0]) - cut.reach) < 0.1 * shoulder]
    lift = max(0.0, cut.height(over).max(initial=-np.inf) + clearance + NECK_ROOM)
    return replace(cut, point=(0.0, neck[1] + lift, neck[2]))


def armhole_cut(
    body: Body, neck: CutPlane, *, strap: float, ease: float, clearance: float, hem: float, flare: float
) -> CutPlane:
    """Return a plane from a strap's width [m] beside the neck to under the arm.

    It leans outwards so far that the flanks stay, with the ease and flare that build_surface adds to
    them.
    """
    shoulder, skin = joint_position(body, "left_shoulder"), body.template
    arm = skin[skin_following(body, ("left_shoulder",))]
    under = arm[arm[:, 0] < shoulder[0] + ARMPIT_ROOM, 1].min(initial=shoulder[1]) - ARMPIT_ROOM
    shirt = skin[skin_following(body, SHIRT_BONES)]
    collar = skin[skin_following(body, (*SHIRT_BONES, "neck"))]
    edge = strap + clearance + collar[neck.depth(collar) > -clearance, 0].max(initial=0.0)
    over = shirt[np.abs(shirt[:, 0] - edge) < ARMPIT_ROOM]
    top = over[:, 1].max(initial=shoulder[1]) + clearance
    flank = skin[skin_following(body, TORSO_BONES) & (skin[:, 1] > hem) & (skin[:, 1] < under)]
    flank = flank[np.argsort(-flank[:, 1])]
    wide = np.append(np.maximum.accumulate(np.abs(flank[:, 0])), np.abs(flank[:, 0]).max(initial=edge))
    down = top - np.append(flank[:, 1], hem)
    grown = clearance + ease / (2 * np.pi) + flare * down / down[-1] + FLANK_ROOM
    lean = ((wide + grown - edge) / down).max()
    return CutPlane("left_armhole", (1.0, lean, 0.0), (edge, top, 0.0))


def cut_sheet(surface: ImplicitSurface, cuts: list[CutPlane]) -> tuple[Array, Index]:
    """Return the surface between the cuts as a dense mesh: points (N,3) [m], faces (M,3), outward."""
    import pyvista  # VTK takes a second to load, and garments are often only named

    grid = pyvista.ImageData(
        dimensions=surface.values.shape,
        spacing=(GRID_SPACING,) * 3,
        origin=tuple(map(float, surface.origin)),
    )
    grid["field"] = surface.values.ravel(order="F")
    sheet = grid.contour([0.0], scalars="field")
    for cut in cuts:
        sheet["cut"] = cut.depth(np.asarray(sheet.points, dtype=np.float64))
        sheet = sheet.clip_scalar(scalars="cut", value=0.0)
        # Clipping interpolates linearly along edges: onto a bent cut by one Newton step.
        points = np.asarray(sheet.points, dtype=np.float64)
        off = cut.depth(points)
        rim = np.abs(off) < 2e-4
        points[rim] -= off[rim, None] * cut.normals(points[rim])
        sheet.points = points
    sheet = sheet.triangulate().clean(tolerance=1e-6).connectivity("largest")
    points = np.asarray(sheet.points, dtype=np.float64)
    faces = np.asarray(sheet.regular_faces, dtype=np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    if np.sum(np.cross(b - a, c - a) * surface.gradient((a + b + c) / 3)) < 0:
        faces = faces[:, ::-1]
    return points, faces


def outlines(points: Array, faces: Index, cuts: list[CutPlane]) -> list[list[tuple[str, Array]]]:
    """Return the named curves (P,3) [m] of each boundary loop of a cut sheet, end to end along the winding.

    Raises:
        ValueError: the surface is open where no cut was made.
    """
    loops = []
    for loop in boundary_loops(faces):
        distance = np.abs(np.stack([cut.depth(points[loop]) for cut in cuts]))
        hits = distance < 1e-5
        corners = np.flatnonzero(hits.sum(axis=0) > 1)
        if len(corners) == 0:
            loops.append([(cuts[int(np.argmin(distance.sum(axis=1)))].name, points[loop])])
            continue
        loop, hits = np.roll(loop, -corners[0]), np.roll(hits, -corners[0], axis=1)
        # Clipping can leave a corner twice, some micrometres apart: the second of the two is dropped.
        corner = hits.sum(axis=0) > 1
        twin = corner & np.roll(corner, 1) & (hits == np.roll(hits, 1, axis=1)).all(axis=0)
        loop, hits = loop[~twin], hits[:, ~twin]
        stops = [*np.flatnonzero(hits.sum(axis=0) > 1), len(loop)]
        ring = np.append(loop, loop[0])
        curves = []
        for begin, end in pairwise(stops):
            middle = np.flatnonzero(hits[:, begin + 1 : end].all(axis=1))
            if len(middle) != 1 or end - begin < 2:
                raise ValueError("nothing fits this body: its surface is open where no cut is")
            curves.append((cuts[int(middle[0])].name, points[ring[begin : end + 1]]))
        loops.append(curves)
    return loops
