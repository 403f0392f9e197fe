"""Garments tailored to a body: triangles, and per vertex the body vertex and skinning weights it borrows.

The T-pose shape of a garment is its rest shape, unless it has a UV chart: areas, Dm^-1, masses and hinges all
come from one of the two.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from reference_sim.cloth import Cloth
from reference_sim.material import Material
from snug.body import Body
from snug.garment_mesh import mesh_garment
from snug.remeshing import boundary_loops
from snug.tailoring import TORSO_BONES, CutPlane, ImplicitSurface, build_surface, dominated_by, joint

Array = NDArray[np.float64]
Index = NDArray[np.int64]

TSHIRT = "tshirt"  # the garment that a command takes where none is named

# What a shirt may borrow weights from: never hands, head or shins, even where they come near.
SHIRT_BONES = (*TORSO_BONES, "left_shoulder", "right_shoulder")
SKIRT_BONES = ("pelvis", "spine1", "left_hip", "right_hip")
# Rounds over a skirt's weights at 1000 vertices: it spans both thighs, so between them it follows neither.
SKIRT_SMOOTHING = 60
SHAPE_SMOOTHING = 10  # rounds over a shape's displacement: nearest vertices jump from leg to leg


class GarmentError(ValueError):
    """A garment that cannot be tailored as asked; the message names the parameter and its range."""


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment on the unposed body. Arrays are not to be written to.

    rest_positions: (V,3) [m]. faces: (F,3), outward. body_vertices: (V,) nearest body vertex among those it
    may follow. skinning_weights: (V,24), that vertex's own, of a skirt alone smoothed; rows sum to one.
    authored_weights: whether somebody made those weights for this garment, so that no recipe smooths them.
    rest_uv: (F,3,2) [m] of the faces' corners, the flat rest state of a garment that has one; else
    rest_positions is its rest shape too.
    loops: name ("neck", "left_sleeve", "right_sleeve", "hem"; of a skirt "waist", "hem") -> boundary vertices
    in order along the faces' winding, from the front-most vertex on. pins: (P,), ascending, what the body
    carries: a skirt's waistband, since contact without friction does not hold it. parameters: what it was
    tailored with.
    """

    name: str
    rest_positions: Array
    faces: Index
    body_vertices: Index
    skinning_weights: Array
    loops: Mapping[str, Index] = field(default_factory=dict)
    pins: Index = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    parameters: Mapping[str, float] = field(default_factory=dict)
    material: Material = field(default_factory=Material)
    rest_uv: Array | None = None
    authored_weights: bool = False

    def cloth(self, material: Material | None = None) -> Cloth:
        """The one rest state of simulator, loss and metrics, with the garment's own material or another.

        Raises MeshError for a mesh that cannot be simulated.
        """
        return Cloth(
            self.rest_positions, self.faces, material or self.material, pins=self.pins, rest_uv=self.rest_uv
        )

    @property
    def hem(self) -> Index:
        """Vertices (n,) of the hem, in order."""
        return self.loops["hem"]

    def body_transported(
        self, body: Body, poses: Array, translations: Array, betas: ArrayLike | None = None
    ) -> Array:
        """Where the pins are (T,P,3) [m] on the body of that shape in poses (T,24,3) [rad] at translations
        (T,3) [m].
        """
        if not len(self.pins):
            return np.empty((len(poses), 0, 3))  # and torch, which poses the joints, is not loaded
        transforms = body.transforms(poses, translations, betas)
        blended = np.einsum("pj,tjab->tpab", self.skinning_weights[self.pins], transforms)
        rest = self.rest_for(body, betas)[self.pins]
        turned = np.einsum("tpab,pb->tpa", blended[..., :3], rest)
        return turned + blended[..., 3]

    def rest_for(self, body: Body, betas: ArrayLike | None) -> Array:
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


def nearest_body_vertices(body: Body, positions: Array, bones: Sequence[str] = SHIRT_BONES) -> Index:
    """Nearest template vertex (V,), of those that follow one of `bones`, to each position (V,3) [m]."""
    allowed = np.flatnonzero(dominated_by(body, bones))
    return allowed[cKDTree(np.asarray(body.template)[allowed]).query(positions)[1]]


def tailor_tshirt(
    body: Body,
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
    cut = {"ease": ease, "clearance": clearance, "sleeve": sleeve, "length": length}
    return _shirt(TSHIRT, body, vertices, cut)


def tailor_tunic(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.06,
    clearance: float = 0.015,
    sleeve: float = 0.55,
    length: float = 0.17,
    flare: float = 0.045,
) -> Garment:
    """A tunic: a longer T-shirt that widens from the waist on, so that its hem swings clear of the body.

    flare: how much further [m] the hem stands off than the waist, all around. The rest: see tailor_tshirt.
    """
    cut = {"ease": ease, "clearance": clearance, "sleeve": sleeve, "length": length, "flare": flare}
    return _shirt("tunic", body, vertices, cut)


def tailor_skirt(
    body: Body,
    *,
    vertices: int = 1000,
    ease: float = 0.04,
    clearance: float = 0.006,
    rise: float = 0.17,
    length: float = 0.3,
    flare: float = 0.1,
) -> Garment:
    """A flared skirt, mirror-symmetric, of `vertices` vertices within 1 %, whose waistband the body carries.

    ease: girth [m] at the hips beyond a skirt that lies at `clearance` [m]. rise: waistband above the hip
    joints [m]; length: hem below them [m]. flare: how much further [m] the hem stands off than the hips.
    Raises GarmentError as tailor_tshirt does.
    """
    cut = {"ease": ease, "clearance": clearance, "rise": rise, "length": length, "flare": flare}
    _demand_in_range("skirt", {"vertices": vertices, **cut})
    hip = joint(body, "left_hip")[1]
    hem, top = hip - length, hip + rise
    cuts = [
        CutPlane("seam", (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        CutPlane("hem", (0.0, -1.0, 0.0), (0.0, hem, 0.0)),
        CutPlane("waist", (0.0, 1.0, 0.0), (0.0, top, 0.0)),
    ]
    surface = build_surface(body, hem=hem, top=top, ease=ease, clearance=clearance, flare=flare)
    smoothing = round(SKIRT_SMOOTHING * vertices / 1000)
    return _tailored("skirt", body, vertices, cut, surface, cuts, SKIRT_BONES, smoothing)


@dataclass(frozen=True)
class GarmentTemplate:
    """A sort of garment: its name, what it is in words, and who tailors it for (body, vertices=...)."""

    name: str
    description: str
    tailor: Callable[..., Garment]


GARMENT_TEMPLATES = (
    GarmentTemplate(TSHIRT, "T-shirt", tailor_tshirt),
    GarmentTemplate("tunic", "flared tunic", tailor_tunic),
    GarmentTemplate("skirt", "flared skirt", tailor_skirt),
)


def find_template(name: str) -> GarmentTemplate:
    """The template of that name. Raises GarmentError naming the known ones."""
    for template in GARMENT_TEMPLATES:
        if template.name == name:
            return template
    raise GarmentError(f"unknown garment {name!r}: use one of {', '.join(p.name for p in GARMENT_TEMPLATES)}")


# Parameter: least and largest value, unit.
RANGES = {
    "vertices": (100, 20_000, " vertices"),
    "ease": (0.0, 0.3, " m"),
    "clearance": (0.005, 0.05, " m"),
    "sleeve": (0.3, 0.9, " of the upper arm"),
    "rise": (0.14, 0.2, " m"),
    "length": (-0.05, 0.25, " m"),
    "skirt length": (0.1, 0.35, " m"),  # above, its hem would come to where its flare begins
    "flare": (0.0, 0.15, " m"),
}


def _demand_in_range(name: str, parameters: Mapping[str, float]) -> None:
    for parameter, value in parameters.items():
        low, high, unit = RANGES.get(f"{name} {parameter}") or RANGES[parameter]
        if not (np.isfinite(value) and low <= value <= high):
            raise GarmentError(
                f"{parameter}={value}: a {name} can be tailored from {low:g} to {high:g}{unit}"
            )


def _shirt(name: str, body: Body, vertices: int, cut: Mapping[str, float]) -> Garment:
    """A garment with two sleeves, a neck and a hem."""
    _demand_in_range(name, {"vertices": vertices, **cut})
    shoulder, elbow = joint(body, "left_shoulder"), joint(body, "left_elbow")
    hem = joint(body, "left_hip")[1] - cut["length"]
    cuff = shoulder[0] + cut["sleeve"] * (elbow[0] - shoulder[0])
    neck = joint(body, "neck")
    # A crew neck: at the neck's joint on the shoulders, bent down in front and a little behind.
    cuts = [
        CutPlane("seam", (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        CutPlane("hem", (0.0, -1.0, 0.0), (0.0, hem, 0.0)),
        CutPlane("left_sleeve", (1.0, 0.0, 0.0), (cuff, 0.0, 0.0)),
        CutPlane("neck", (0.0, 1.0, 0.3), (0.0, neck[1], neck[2]), reach=0.85 * shoulder[0], bend=3.0),
    ]
    surface = build_surface(
        body, hem=hem, cuff=cuff, top=neck[1] + 0.04, ease=cut["ease"], clearance=cut["clearance"],
        flare=cut.get("flare", 0.0),
    )  # fmt: skip
    return _tailored(name, body, vertices, cut, surface, cuts, SHIRT_BONES)


def _tailored(
    name: str, body: Body, vertices: int, cut: Mapping[str, float], surface: ImplicitSurface,
    cuts: list[CutPlane], bones: Sequence[str], smoothing: int = 0,
) -> Garment:  # fmt: skip
    """The garment sewn from a surface and its cuts, whose weights come from those bones, smoothed."""
    try:
        positions, faces = mesh_garment(body, surface, cuts, vertices, cut["clearance"])
    except ValueError as error:
        raise GarmentError(f"{name}: {error}") from error
    loops = _named_loops(positions, faces)
    nearest = nearest_body_vertices(body, positions, bones)
    return Garment(
        name=name,
        rest_positions=positions,
        faces=faces,
        body_vertices=nearest,
        skinning_weights=smooth_weights(np.asarray(body.skinning_weights)[nearest], faces, smoothing),
        loops=loops,
        pins=np.sort(loops.get("waist", np.empty(0, dtype=np.int64))),
        parameters=dict(cut),
    )


def _named_loops(points: Array, faces: Index) -> dict[str, Index]:
    """A shirt's four openings or a skirt's two by their place, each from its front-most vertex on."""
    loops = [np.roll(loop, -int(np.argmax(points[loop, 2]))) for loop in boundary_loops(faces)]
    centres = np.stack([points[loop].mean(axis=0) for loop in loops])
    found = {"waist": np.argmax(centres[:, 1]), "hem": np.argmin(centres[:, 1])}
    if len(loops) == 4:
        found = {"neck": found["waist"], "left_sleeve": np.argmax(centres[:, 0]),
                 "right_sleeve": np.argmin(centres[:, 0]), "hem": found["hem"]}  # fmt: skip
    return {name: loops[int(index)] for name, index in found.items()}
