"""Garments tailored to a body: triangles, and per vertex the body vertex and skinning weights it borrows.

The T-pose shape of a garment is its rest shape, unless it has a UV chart: areas, Dm^-1, masses and hinges all
come from one of the two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from reference_sim.cloth import Cloth
from reference_sim.material import Material
from snug.body import Body
from snug.garment_cuts import SEAM, CutPlane
from snug.garment_mesh import mesh_garment
from snug.remeshing import boundary_loops
from snug.tailoring import SHIRT_BONES, build_surface, dominated_by, joint

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SMOOTHED_OVER = 0.1  # [m] about the hip joints: from a shirt's own weights to smoothed ones
SHAPE_SMOOTHING = 10  # rounds over a shape's displacement: nearest vertices jump from leg to leg


class GarmentError(ValueError):
    """A garment that cannot be tailored as asked; the message names the parameter and its range."""


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment on the unposed body. Arrays are not to be written to.

    rest_positions: (V,3) [m]. faces: (F,3), outward. body_vertices: (V,) nearest body vertex among those it
    may follow. skinning_weights: (V,24), that vertex's own, smoothed where it hangs between the legs; rows
    sum to one. authored_weights: whether somebody made those weights for this garment, so that no recipe
    smooths them. rest_uv: (F,3,2) [m] of the faces' corners, the flat rest state of a garment that has one;
    else rest_positions is its rest shape too.
    loops: name ("neck", "left_sleeve", "right_sleeve", "left_armhole", "right_armhole", "hem", "waist",
    "left_leg", "right_leg") -> boundary vertices in order along the faces' winding, from the front-most
    vertex on. pins: (P,), ascending, what the body carries: a waistband, since contact without friction does
    not hold it. parameters: what it was tailored with.
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
        """Vertices (n,) of the hem, in order; of trousers those of both legs."""
        if "hem" in self.loops:
            return self.loops["hem"]
        return np.concatenate([self.loops["left_leg"], self.loops["right_leg"]])

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


def sewn(
    name: str, body: Body, vertices: int, cut: Mapping[str, float], surface: Mapping[str, Any],
    cuts: list[CutPlane], bones: Sequence[str], smoothing: int = 0,
) -> Garment:  # fmt: skip
    """The garment of a surface, which build_surface makes, and its cuts; its weights come from those bones.

    smoothing: rounds over them at 1000 vertices, below the hip joints or, with a waistband, everywhere.
    Raises GarmentError where no sound mesh comes out.
    """
    try:
        sheet = build_surface(body, **surface, clearance=cut["clearance"])
        positions, faces = mesh_garment(body, sheet, cuts, vertices, cut["clearance"])
    except ValueError as error:
        raise GarmentError(f"{name}: {error}") from error
    loops = _named_loops(positions, faces, cuts)
    nearest = nearest_body_vertices(body, positions, bones)
    own = np.asarray(body.skinning_weights)[nearest]
    weights = smooth_weights(own, faces, round(smoothing * vertices / 1000))
    if smoothing and "waist" not in loops:
        above = positions[:, 1] - joint(body, "left_hip")[1]
        share = np.clip(above / SMOOTHED_OVER + 0.5, 0.0, 1.0)[:, None]
        weights = share * own + (1 - share) * weights
    return Garment(
        name=name,
        rest_positions=positions,
        faces=faces,
        body_vertices=nearest,
        skinning_weights=weights,
        loops=loops,
        pins=np.sort(loops.get("waist", np.empty(0, dtype=np.int64))),
        parameters=dict(cut),
    )


def _named_loops(points: Array, faces: Index, cuts: Sequence[CutPlane]) -> dict[str, Index]:
    """The openings by the cuts that they lie on, each from its front-most vertex on."""
    openings = [cut for cut in cuts if cut.name != SEAM]
    found = {}
    for loop in boundary_loops(faces):
        left = points[loop] * [np.sign(points[loop, 0].mean()) or 1.0, 1.0, 1.0]
        off = [np.abs(cut.beyond(left)).mean() for cut in openings]
        cut = openings[int(np.argmin(off))]
        mirrored = cut.twin and points[loop, 0].mean() < 0
        found[cut.twin if mirrored else cut.name] = np.roll(loop, -int(np.argmax(points[loop, 2])))
    return {name: found[name] for cut in reversed(openings) for name in (cut.name, cut.twin) if name}
