"""Garment on a body: triangles, and per vertex the body vertex and skinning weights it borrows.

The T-pose shape of a garment is its rest shape, unless it has a UV chart: areas, Dm^-1, masses and hinges all
come from one of the two.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array

from reference_sim.cloth import Cloth
from reference_sim.geometry.topology import half_edges
from reference_sim.material import Material
from snug.body.parametric_body import Body

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SHAPE_SMOOTHING = 10  # rounds over a shape's displacement: nearest vertices jump from leg to leg
# Rounds over the weights at 1000 vertices of cloth that spans both thighs: between them it follows neither.
SKIRT_SMOOTHING = 60


class GarmentError(ValueError):
    """A garment that cannot be made or read as asked; the message names the cause and the remedy."""


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment on the unposed body. Arrays are not to be written to.

    Attributes:
        name: of the template or file.
        rest_positions: (V,3) [m].
        faces: (F,3), outward.
        body_vertices: (V,), the nearest body vertex among those it may follow.
        skinning_weights: (V,24), those of that vertex, smoothed where cloth hangs between the legs; rows sum
            to one.
        loops: name ("neck", "left_sleeve", "right_sleeve", "left_armhole", "right_armhole", "hem", "waist",
            "left_leg", "right_leg") -> boundary vertices in order along the faces' winding, front-most first.
        pins: (P,), ascending: vertices that the body carries, of a waistband, since contact without friction
            does not hold it.
        parameters: of the tailoring.
        material: of the cloth.
        rest_uv: (F,3,2) [m] of the faces' corners, the flat rest state of a garment that has one; else
            rest_positions is its rest shape too.
        authored_weights: whether somebody made the weights for this garment, so that no recipe smooths them.
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
        """Return the rest state of simulator, loss and metrics, with the garment's own material or another.

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

    def pin_positions(
        self, body: Body, poses: Array, translations: Array, betas: ArrayLike | None = None
    ) -> Array:
        """Return the positions (T,P,3) [m] of the pins on the posed body.

        Args:
            body: that wears the garment.
            poses: (T,24,3) [rad].
            translations: (T,3) [m].
            betas: shape coefficients of the body.
        """
        if not len(self.pins):
            return np.empty((len(poses), 0, 3))
        transforms = body.transforms(poses, translations, betas)
        blended = np.einsum("pj,tjab->tpab", self.skinning_weights[self.pins], transforms)
        rest = self.rest_for(body, betas)[self.pins]
        turned = np.einsum("tpab,pb->tpa", blended[..., :3], rest)
        return turned + blended[..., 3]

    def rest_for(self, body: Body, betas: ArrayLike | None) -> Array:
        """Return rest positions (V,3) [m] on the body of shape `betas`: vertices move as the skin below them.

        The displacement of the nearest body vertex, smoothed over the garment.
        """
        if betas is None:
            return self.rest_positions.copy()
        displacement = (body.shaped(betas) - body.template)[self.body_vertices]
        return self.rest_positions + _average(displacement, self.faces, SHAPE_SMOOTHING)


def smooth_weights(weights: ArrayLike, faces: Index, iterations: int) -> Array:
    """Average skinning weights (V,24) `iterations` times, each vertex with its neighbours' mean.

    Half the vertex, half the mean (uniform Laplacian): rows keep their sum and stay non-negative.

    Raises:
        GarmentError: fewer than 0 iterations.

    >>> smooth_weights([[1.0], [0.0], [0.0]], np.array([[0, 1, 2]]), 1).ravel().tolist()
    [0.5, 0.25, 0.25]
    """
    if iterations < 0:
        raise GarmentError(f"iterations={iterations}: smoothing needs 0 rounds or more")
    return _average(np.asarray(weights, dtype=np.float64), faces, iterations)


def _average(values: Array, faces: Index, rounds: int) -> Array:
    neighbours = _adjacency(faces, len(values))
    degree = np.asarray(neighbours.sum(axis=1)).reshape(-1, 1)
    for _ in range(rounds):
        values = 0.5 * values + 0.5 * (neighbours @ values) / degree
    return values


def _adjacency(faces: Index, count: int) -> csr_array:
    halves = half_edges(faces)
    both = np.unique(np.concatenate([halves, halves[:, ::-1]]), axis=0)
    return coo_array((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count)).tocsr()
