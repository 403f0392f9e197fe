"""Garments tailored to a body: triangles, and per vertex the body vertex and skinning weights it borrows.

The T-pose shape of a garment is its rest shape: areas, Dm^-1, masses and hinges all come from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from snug.remeshing import boundary_loops, corner_angles, remesh, triangle_areas
from snug.tailoring import TORSO_BONES, Cut, Form, build_form, cut_sheet, dominated_by, joint, outlines

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# What a shirt may borrow weights from: never hands, head or shins, even where they come near.
SHIRT_BONES = (*TORSO_BONES, "left_shoulder", "right_shoulder")
AREA_BOUNDS = (0.5, 2.0)  # every triangle's area over the mean
SMALLEST_ANGLE = 15.0  # [degrees]
SHAPE_SMOOTHING = 10  # rounds over a shape's displacement: nearest vertices jump from leg to leg


class GarmentError(ValueError):
    """A garment that cannot be tailored as asked; the message names the parameter and its range."""


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment on the unposed body. Arrays are not to be written to.

    rest_positions: (V,3) [m]. faces: (F,3), outward. body_vertices: (V,) nearest body vertex among those it
    may follow. skinning_weights: (V,24), that vertex's own, unsmoothed; rows sum to one. loops: name ("neck",
    "left_sleeve", "right_sleeve", "hem") -> boundary vertices in order along the faces' winding, from the
    front-most vertex on. parameters: what it was tailored with.
    """

    name: str
    rest_positions: Array
    faces: Index
    body_vertices: Index
    skinning_weights: Array
    loops: Mapping[str, Index] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def hem(self) -> Index:
        """Vertices (n,) of the hem, in order."""
        return self.loops["hem"]

    def rest_for(self, body, betas: ArrayLike | None) -> Array:
        """Rest positions (V,3) [m] on the body of shape `betas`: each vertex moves as the skin below it does.

        The displacement of the nearest body vertex, smoothed over the garment.
        """
        if betas is None:
            return self.rest_positions.copy()
        displacement = (body.shaped(betas) - body.template)[self.body_vertices]
        return self.rest_positions + _averaged(displacement, self.faces, SHAPE_SMOOTHING)


def smooth_weights(weights: ArrayLike, faces: Index, iterations: int) -> Array:
    """Skinning weights (V,24) after `iterations` rounds of averaging each vertex with its neighbours' mean.

    Half the vertex, half the mean (uniform Laplacian): rows keep their sum and stay non-negative.
    """
    if iterations < 0:
        raise GarmentError(f"iterations={iterations}: smoothing needs 0 rounds or more")
    return _averaged(np.asarray(weights, dtype=np.float64), faces, iterations)


def _averaged(values: Array, faces: Index, rounds: int) -> Array:
    neighbours = _adjacency(faces, len(values))
    degree = np.asarray(neighbours.sum(axis=1)).reshape(-1, 1)
    for _ in range(rounds):
        values = 0.5 * values + 0.5 * (neighbours @ values) / degree
    return values


def _adjacency(faces: Index, count: int) -> csr_array:
    halves = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    both = np.unique(np.concatenate([halves, halves[:, ::-1]]), axis=0)
    return coo_array((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count)).tocsr()


def nearest_body_vertices(body, positions: Array) -> Index:
    """Nearest vertex (V,) of the template's torso, upper arms and upper legs to each position (V,3) [m]."""
    allowed = np.flatnonzero(dominated_by(body, SHIRT_BONES))
    return allowed[cKDTree(np.asarray(body.template)[allowed]).query(positions)[1]]


def tailor_tshirt(
    body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.015,
    sleeve: float = 0.55,
    length: float = 0.09,
) -> Garment:
    """A T-shirt for the unposed body, mirror-symmetric, of `vertices` vertices within 1 %.

    ease: girth [m] at waist and cuffs beyond a shirt that lies at `clearance` around chest, hips or arm.
    clearance: least distance [m] from the skin, over vertices, edge midpoints and centroids.
    sleeve: share of the upper arm that the sleeve covers. length: hem below the hip joints [m].
    Raises GarmentError for a parameter out of range, or a body on which no sound mesh comes out.
    """
    _check("vertices", vertices, 100, 20_000, " vertices")
    _check("ease", ease, 0.0, 0.3, " m")
    _check("clearance", clearance, 0.005, 0.05, " m")
    _check("sleeve", sleeve, 0.3, 0.9, " of the upper arm")
    _check("length", length, -0.05, 0.25, " m")
    shoulder, elbow = joint(body, "left_shoulder"), joint(body, "left_elbow")
    hem = joint(body, "left_hip")[1] - length
    cuff = shoulder[0] + sleeve * (elbow[0] - shoulder[0])
    neck = joint(body, "neck")
    # A crew neck: at the neck's joint on the shoulders, bent down in front and a little behind.
    cuts = [
        Cut("seam", (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        Cut("hem", (0.0, -1.0, 0.0), (0.0, hem, 0.0)),
        Cut("left_sleeve", (1.0, 0.0, 0.0), (cuff, 0.0, 0.0)),
        Cut("neck", (0.0, 1.0, 0.3), (0.0, neck[1], neck[2]), reach=0.85 * shoulder[0], bend=3.0),
    ]
    form = build_form(body, hem=hem, cuff=cuff, top=neck[1] + 0.04, ease=ease, clearance=clearance)
    positions, faces = _sewn(body, form, cuts, vertices, clearance)
    nearest = nearest_body_vertices(body, positions)
    return Garment(
        name="tshirt",
        rest_positions=positions,
        faces=faces,
        body_vertices=nearest,
        skinning_weights=np.asarray(body.skinning_weights)[nearest],
        loops=_named_loops(positions, faces),
        parameters={"ease": ease, "clearance": clearance, "sleeve": sleeve, "length": length},
    )


def _check(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not (np.isfinite(value) and low <= value <= high):
        raise GarmentError(f"{name}={value}: a T-shirt can be tailored from {low:g} to {high:g}{unit}")


def _sewn(body, form: Form, cuts: list[Cut], vertices: int, clearance: float) -> tuple[Array, Index]:
    """The whole garment: one half remeshed, kept off the body, mirrored at the seam."""
    sheet, sheet_faces = cut_sheet(form, cuts)
    try:
        curves = outlines(sheet, sheet_faces, cuts)
    except ValueError as error:
        raise GarmentError(f"no T-shirt fits this body: {error}") from error
    found = sorted(name for loop in curves for name, _ in loop)
    if found != ["hem", "left_sleeve", "neck", "seam", "seam"]:
        raise GarmentError(f"no T-shirt fits this body: the cuts of its form are {', '.join(found)}")
    rims = [[curve for _, curve in loop] for loop in curves]
    # V = 2 half - seam, and only the mesh tells how many vertices its seam has; some sizes come out unsound.
    half, tried, problem = vertices // 2 + int(0.57 * np.sqrt(vertices)), set[int](), ""
    while len(tried) < 16:
        while half in tried:
            half += 1
        tried.add(half)
        try:
            points, faces = remesh(sheet, sheet_faces, rims, half, form.project)
            count = 2 * len(points) - int(np.count_nonzero(np.abs(points[:, 0]) < 1e-6))
            if abs(count - vertices) > max(1, vertices // 100):
                half += (vertices - count) // 2
                raise ValueError(f"{count} vertices instead of {vertices}")
            whole, whole_faces = _mirrored(_kept_off(body, points, faces, cuts, clearance), faces)
            _demand_even(whole, whole_faces)
            return whole, whole_faces
        except ValueError as error:
            problem = str(error)
    raise GarmentError(f"vertices={vertices}: no sound mesh of this size ({problem}); ask for more")


def _mirrored(points: Array, faces: Index) -> tuple[Array, Index]:
    """Both halves, welded at x = 0."""
    seam = points[:, 0] == 0
    twin = np.where(seam, np.arange(len(points)), len(points) + np.cumsum(~seam) - 1)
    whole = np.concatenate([points, points[~seam] * [-1.0, 1.0, 1.0]])
    return whole, np.concatenate([faces, twin[faces][:, ::-1]])


def _kept_off(body, points: Array, faces: Index, cuts: list[Cut], clearance: float) -> Array:
    """Points pushed outward, along their cuts, until no sample is nearer to the skin than `clearance`.

    Errors: ValueError if it cannot be met.
    """
    import igl

    skin, skin_faces = np.asarray(body.template, dtype=np.float64), np.asarray(body.faces, dtype=np.int64)
    # Of a body that is not quite symmetric, both of its sides.
    skin = np.concatenate([skin, skin * [-1.0, 1.0, 1.0]])
    skin_faces = np.concatenate([skin_faces, skin_faces[:, ::-1] + len(body.template)])
    a, b, c = (skin[skin_faces[:, k]] for k in range(3))
    outward = np.cross(b - a, c - a)
    tree = igl.AABB()
    tree.init(skin, skin_faces)
    points = points.copy()
    for _ in range(30):
        corners = points[faces]
        middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
        samples = np.concatenate([corners, middles, corners.mean(axis=1, keepdims=True)], axis=1)  # (F,7,3)
        squared, nearest, closest = tree.squared_distance(skin, skin_faces, samples.reshape(-1, 3))
        away = samples.reshape(-1, 3) - closest
        side = np.sign(np.sum(away * outward[nearest], axis=1))  # a chord may run inside of the body
        away *= (side / np.maximum(np.sqrt(squared), 1e-12))[:, None]
        distance = (side * np.sqrt(squared)).reshape(-1, 7)
        lack = clearance - distance.min(axis=1)
        if lack.max() <= 0:
            points[np.abs(points[:, 0]) < 1e-6, 0] = 0.0
            return points
        worst = np.arange(len(faces)), distance.argmin(axis=1)
        away = away.reshape(-1, 7, 3)[worst]
        short = np.flatnonzero(lack > 0)
        short = short[np.argsort(lack[short], kind="stable")]
        push = np.zeros_like(points)
        # A vertex of several such faces follows the worst one: the last to be written.
        push[faces[short].ravel()] = np.repeat(1.3 * (lack[short, None] + 1e-5) * away[short], 3, axis=0)
        for cut in cuts:
            on = np.abs(cut.beyond(points)) < 1e-6
            normal = cut.normals(points[on])
            # Along the cut, and longer: the distance must still grow by what is lacking.
            slanted = push[on] - np.sum(push[on] * normal, axis=1, keepdims=True) * normal
            length2 = np.sum(push[on] ** 2, axis=1), np.maximum(np.sum(slanted**2, axis=1), 1e-20)
            push[on] = slanted * np.minimum(length2[0] / length2[1], 4.0)[:, None]
        points += push
    raise ValueError(f"{1000 * lack.max():.2f} mm of clearance missing")


def _demand_even(points: Array, faces: Index) -> None:
    """Errors: ValueError for a triangle too small, large or sharp, and for other than four openings."""
    areas = triangle_areas(points, faces)
    ratio = areas / areas.mean()
    if ratio.min() < AREA_BOUNDS[0] or ratio.max() > AREA_BOUNDS[1]:
        raise ValueError(f"triangle areas from {ratio.min():.2f} to {ratio.max():.2f} of the mean")
    smallest = np.degrees(corner_angles(points, faces).min())
    if smallest < SMALLEST_ANGLE:
        raise ValueError(f"an angle of {smallest:.1f} degrees")
    openings = len(boundary_loops(faces))
    if openings != 4:
        raise ValueError(f"{openings} openings instead of 4")


def _named_loops(points: Array, faces: Index) -> dict[str, Index]:
    """The four openings by their place, each from its front-most vertex on."""
    loops = [np.roll(loop, -int(np.argmax(points[loop, 2]))) for loop in boundary_loops(faces)]
    centres = np.stack([points[loop].mean(axis=0) for loop in loops])
    found = {"left_sleeve": np.argmax(centres[:, 0]), "right_sleeve": np.argmin(centres[:, 0])}
    found |= {"neck": np.argmax(centres[:, 1]), "hem": np.argmin(centres[:, 1])}
    return {name: loops[int(found[name])] for name in ("neck", "left_sleeve", "right_sleeve", "hem")}
