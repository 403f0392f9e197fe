"""Cubic penalty that keeps cloth samples out of a body (SNUG, eq. 13).

    d = n . (x_s - c)                   distance to the sample's contact plane (point c, unit normal n)
    E = k a_s max(eps - d, 0)^3         k [J/m^5], a_s [m^2]

The exact distance to a moving body has jumps where a sample is pinched between two limbs, and Newton's
method does not survive them; so each sample gets one plane per step, taken at the initial guess and frozen
(`Obstacle.planes`), and this energy is the distance to that plane. The true signed distance is a metric.

Samples sit on vertices, edge midpoints and face centroids, because a coarse mesh whose vertices are outside
still cuts through a shoulder with its edges. a_s makes k a density: each of the three kinds of sample
carries the whole area of the cloth once, so that a finer mesh does not get a stiffer contact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import scipy.sparse as sp

from reference_sim.cloth import Cloth
from reference_sim.energies.contact_penalty_kernels import constraint, lanes, sample_depth, vertex_block
from reference_sim.energies.energy import Energy, Step, demand_not_negative
from reference_sim.kernels.kernel_cache import njit

if TYPE_CHECKING:
    from torch import Tensor

    from reference_sim.kernels.float64_lanes import BlockPlaces
    from reference_sim.obstacle import Planes

DEFAULT_STIFFNESS = 3.4e6  # [J/m^5]: some 2800 J/m^3 on a vertex of a T-shirt with 1000 vertices
DEFAULT_MARGIN = 4e-3  # [m]


class ContactPenalty(Energy):
    """Penalty energy [J] of each contact sample of `cloth`.

    Args:
        stiffness: k [J/m^5], per area of sample.
        margin: eps [m].
        samples: "all" (vertices, edge midpoints, centroids) or "vertices".
        per_sample_stiffness: k a_s [J/m^3], the same for every sample, instead of `stiffness`; the paper's
            form: `ContactPenalty(cloth, samples="vertices", per_sample_stiffness=250, margin=2e-3)`.

    Raises:
        ValueError: unknown kind of samples, or a stiffness or margin that is negative or not finite.
    """

    name = "collision"
    power = 3  # of the depth
    kernels: ClassVar = {
        "float32_lanes": lanes,
        "vertex_block": vertex_block,
        "constraint": constraint,
    }

    def __init__(
        self,
        cloth: Cloth,
        *,
        stiffness: float = DEFAULT_STIFFNESS,
        margin: float = DEFAULT_MARGIN,
        samples: str = "all",
        per_sample_stiffness: float | None = None,
    ) -> None:
        if samples not in ("all", "vertices"):
            raise ValueError(f"ContactPenalty samples {samples!r}: choose 'all' or 'vertices'")
        demand_not_negative("ContactPenalty", stiffness=stiffness, margin=margin)
        demand_not_negative("ContactPenalty", per_sample_stiffness=per_sample_stiffness or 0.0)
        self.cloth = cloth
        self.samples = samples
        self.margin = float(margin)
        self.stencils, self.weights, self.sample_areas = _samples(cloth, samples)
        self.stiffness = (
            stiffness * self.sample_areas
            if per_sample_stiffness is None
            else np.full(len(self.stencils), float(per_sample_stiffness))
        )
        rows = np.repeat(np.arange(len(self.stencils)), 3)
        self.sample_matrix = sp.csr_matrix(
            (self.weights.ravel(), (rows, self.stencils.ravel())),
            shape=(len(self.stencils), cloth.vertex_count),
        )
        self.rest_samples = self.sample_matrix @ cloth.rest_positions
        self.planes: Planes | None = None
        self.step: Step | None = None  # that the planes belong to
        # Until a step is prepared every plane lies far below its sample: no contact. Finite also as float32.
        self.points = np.tile([0.0, -1e30, 0.0], (len(self.stencils), 1))
        self.normals = np.tile([0.0, 1.0, 0.0], (len(self.stencils), 1))

    def parameters(self) -> dict[str, Any]:
        """Return the kind of samples, margin and mean stiffness."""
        return {
            "samples": self.samples,
            "margin_m": self.margin,
            "mean_stiffness_J_per_m3": float(self.stiffness.mean()),
        }

    def arrays(self) -> dict[str, np.ndarray]:
        """Return vertices and weights (S, 3), stiffness (S,) [J/m^3], rest places (S, 3) [m] of samples."""
        return {
            "vertices": self.stencils, "weights": self.weights, "stiffness_J_per_m3": self.stiffness,
            "rest_positions_m": self.rest_samples,
        }  # fmt: skip

    def prepare(self, step: Step) -> None:
        """Freeze one contact plane for each sample, at the guess. Raises ValueError without an obstacle."""
        if step.obstacle is None:
            raise ValueError("ContactPenalty needs an obstacle: pass one to simulate() or drop the term")
        samples = self.sample_matrix @ step.guess
        planes = step.obstacle.planes(samples, step.frame, self.rest_samples)
        self.planes, self.points, self.normals = planes, planes.points, planes.normals
        self.step = step

    def energy(self, x: Tensor, points: Tensor | None = None, normals: Tensor | None = None) -> Tensor:
        """Return E [J] of each sample: x (..., V, 3), points and normals (..., S, 3) [m] -> (..., S).

        Planes default to the prepared ones.
        """
        import torch

        index = torch.as_tensor(self.stencils, device=x.device)
        return self.element_energy(x[..., index, :], points, normals)

    def element_energy(
        self, u: Tensor, points: Tensor | None = None, normals: Tensor | None = None
    ) -> Tensor:
        """Return E [J] of each sample: u (..., N, 3, 3) [m] -> (..., N)."""
        import torch

        c = torch.as_tensor(self.points).to(u) if points is None else points
        n = torch.as_tensor(self.normals).to(u) if normals is None else normals
        sample = (torch.as_tensor(self.weights).to(u)[:, :, None] * u).sum(-2)
        depth = torch.clamp(self.margin - (n * (sample - c)).sum(-1), min=0.0)
        return torch.as_tensor(self.stiffness).to(u) * depth**self.power

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        gradient = np.zeros_like(x)
        planes = self.points, self.normals
        value = _gradient(x, self.stencils, self.weights, self.stiffness, self.margin, *planes, gradient)
        return value, gradient

    def add_hessian(self, x: np.ndarray, convexity: float, places: BlockPlaces, data: np.ndarray) -> None:
        """Add the second derivatives at x (V, 3) [m] to the values `data` of a matrix."""
        _add_hessian(
            *self._curvatures(x), self.weights, self.normals, places.slots, places.base, places.stride, data
        )

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the curvature along the normal, in all directions, of samples in contact; see Energy."""
        elements, curvatures = self._curvatures(x)
        w = self.weights[elements]
        return elements, curvatures[:, None, None] * w[:, :, None] * w[:, None, :]

    def _curvatures(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return samples in contact at x (n,) and their curvatures along the normal (n,) [N/m]."""
        return _curvatures(
            x, self.stencils, self.weights, self.stiffness, self.margin, self.points, self.normals
        )


def _samples(cloth: Cloth, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stencils (S, 3), weights (S, 3) and areas (S,) of the contact samples.

    All stencils have three vertices so that one kernel serves them; a vertex sample repeats itself with
    weight 0.
    """
    vertices = np.arange(cloth.vertex_count)
    stencils = [np.repeat(vertices[:, None], 3, axis=1)]
    weights = [np.tile([1.0, 0.0, 0.0], (len(vertices), 1))]
    areas = [cloth.vertex_areas]
    if kind == "all":
        edges, faces = cloth.edges, cloth.faces
        stencils += [edges[:, [0, 1, 1]], faces]
        weights += [np.tile([0.5, 0.5, 0.0], (len(edges), 1)), np.full((len(faces), 3), 1 / 3)]
        areas += [np.bincount(cloth.sides.ravel(), np.repeat(cloth.areas / 3, 3), len(edges)), cloth.areas]
    return np.concatenate(stencils), np.concatenate(weights), np.concatenate(areas)


@njit(cache=True)
def _gradient(x, stencils, weights, stiffness, margin, points, normals, gradient):
    total = 0.0
    for s in range(len(stencils)):
        depth = sample_depth(x, stencils[s], weights[s], margin, points[s], normals[s])
        if depth > 0.0:
            total += stiffness[s] * depth * depth * depth
            force = -3.0 * stiffness[s] * depth * depth
            for a in range(3):
                for i in range(3):
                    gradient[stencils[s, a], i] += force * weights[s, a] * normals[s, i]
    return total


@njit(cache=True)
def _curvatures(x, stencils, weights, stiffness, margin, points, normals):
    """Return the samples in contact and their curvatures 6 k a_s depth."""
    elements, curvatures, count = np.empty(len(stencils), np.int64), np.empty(len(stencils)), 0
    for s in range(len(stencils)):
        depth = sample_depth(x, stencils[s], weights[s], margin, points[s], normals[s])
        if depth > 0.0:
            elements[count], curvatures[count] = s, 6.0 * stiffness[s] * depth
            count += 1
    return elements[:count], curvatures[:count]


@njit(cache=True)
def _add_hessian(elements, curvatures, weights, normals, slots, base, stride, data):
    """Add each curvature times n n^T, spread by the sample's weights."""
    for k in range(len(elements)):
        s = elements[k]
        for a in range(3):
            for b in range(3):
                w, slot = curvatures[k] * weights[s, a] * weights[s, b], slots[s, 3 * a + b]
                if slot < 0 or w == 0.0:
                    continue
                for j in range(3):
                    for i in range(3):
                        at = base[slot] + j * stride[slot] + i
                        data[at] += w * normals[s, i] * normals[s, j]
