"""Cubic penalty that keeps cloth samples out of a body (SNUG, eq. 13).

    d = n . (x_s - c)                   distance to the sample's contact plane (point c, unit normal n)
    E = k a_s max(eps - d, 0)^3         k [J/m^5], a_s [m^2]

The exact distance to a moving body has jumps where a sample is pinched between two limbs. So each sample
gets one plane per step, taken at the initial guess and frozen (`Obstacle.planes`).

Samples sit on vertices, edge midpoints and face centroids. a_s makes k a density: each of the three kinds
of sample carries the whole area of the cloth once, so that a finer mesh does not get a stiffer contact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import scipy.sparse as sp

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, Step, demand_positive
from reference_sim.geometry.closest_point import arrange
from reference_sim.kernels.fast_kernels import Constraints, VertexBlocks
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import FAST, THREE, Float32Lanes, empty_state, lay_out, to_blocks
from reference_sim.kernels.lanes import LANES as L

if TYPE_CHECKING:
    from torch import Tensor

    from reference_sim.kernels.lanes import BlockPlaces
    from reference_sim.obstacle import Planes


def lanes(term: ContactPenalty) -> Float32Lanes:
    """Lay the samples of the term out, those of a block near each other; a step freezes planes and depths."""
    order = arrange(term.rest_samples)
    stencils = term.stencils[order]
    vertices, constants = lay_out(stencils, term.weights[order], term.stiffness[order])
    weights = to_blocks(term.weights[order])  # in float64: a third of metres is no third in float32
    planes = empty_state(vertices, 4)

    def freeze(x0: np.ndarray) -> tuple:
        deepest = _depths(
            x0.ravel(), order, vertices, weights, term.points, term.normals, term.margin, planes
        )
        return deepest, vertices, constants, planes

    return Float32Lanes(contact_gradient, freeze, contact_stiffness, stencils)


@njit(cache=True)
def _depths(x, order, vertices, constants, points, normals, margin, state):
    """Write normals and depths of the samples at x (3V,) into state, in blocks.

    Returns the largest depth (B,) [m] of each block, below zero where none of its samples touches.
    """
    deepest = np.full(len(state), np.float32(-np.inf))
    for place in range(len(order)):
        s, block, lane = order[place], place // L, place % L
        i, j, k = vertices[block, lane], vertices[block, L + lane], vertices[block, 2 * L + lane]
        u, v, w = constants[block, lane], constants[block, L + lane], constants[block, 2 * L + lane]
        depth = margin
        for a in range(3):
            sample = u * x[i + a] + v * x[j + a] + w * x[k + a]
            depth -= normals[s, a] * (sample - points[s, a])
            state[block, a * L + lane] = normals[s, a]
        state[block, 3 * L + lane] = depth
        deepest[block] = max(deepest[block], np.float32(depth))
    return deepest


@njit(cache=True, inline="always", fastmath=FAST, error_model="numpy")
def _longest(u):
    """Return a bound on the longest of the displacements u (3V,) [m], rounding included."""
    square = np.float32(0.0)
    for i in range(0, len(u) - 2, 3):
        square = max(square, u[i] * u[i] + u[i + 1] * u[i + 1] + u[i + 2] * u[i + 2])
    return np.float32(1.00001) * np.sqrt(square) + np.float32(1e-7)


@njit(cache=True, fastmath=FAST, error_model="numpy")
def contact_gradient(data, u, gradient, s):
    """Return the energy [J] of the contact penalty and add to gradient (3V,) [N].

    deepest (B,): largest depth of a block at x_0 [m]. With L for LANES: vertices (B, 3 L): 3
    times the vertex. constants (B, 4 L): weights, stiffness [J/m^3]. planes (B, 4 L): normal, and the
    depth of x_0 under the margin [m], below zero above it. No sample moves farther than the vertex that
    moves most, so a block that is higher than that is not visited.
    """
    deepest_at_start, vertices, constants, planes = data
    total, height = 0.0, -_longest(u)
    for b in range(len(planes)):
        if deepest_at_start[b] < height:
            continue
        at, c, n = vertices[b], constants[b], planes[b]
        for g in range(L):
            i, j, k = at[g], at[L + g], at[2 * L + g]
            for a in range(3):
                s[a * L + g] = u[i + a]
                s[(3 + a) * L + g] = u[j + a]
                s[(6 + a) * L + g] = u[k + a]
        deepest, energy = np.float32(0.0), np.float32(0.0)
        for g in range(L):
            w0, w1, w2 = c[g], c[L + g], c[2 * L + g]
            x = w0 * s[g] + w1 * s[3 * L + g] + w2 * s[6 * L + g]
            y = w0 * s[L + g] + w1 * s[4 * L + g] + w2 * s[7 * L + g]
            z = w0 * s[2 * L + g] + w1 * s[5 * L + g] + w2 * s[8 * L + g]
            depth = n[3 * L + g] - (n[g] * x + n[L + g] * y + n[2 * L + g] * z)
            depth = max(depth, np.float32(0.0))
            stiffness = c[3 * L + g] * depth * depth
            energy += stiffness * depth
            s[9 * L + g] = -THREE * stiffness
            deepest = max(deepest, depth)
        if deepest == np.float32(0.0):
            continue
        total += float(energy)
        for g in range(L):
            force = s[9 * L + g]
            if force == np.float32(0.0):
                continue
            for corner in range(3):
                part, i = force * c[corner * L + g], at[corner * L + g]
                for a in range(3):
                    gradient[i + a] += part * n[a * L + g]
    return total


@njit(cache=True, error_model="numpy")
def contact_stiffness(data, values):
    """Add the stiffness [N/m] of the samples that touch at x_0; returns 0."""
    deepest, _, constants, planes, places = data
    for b in range(len(deepest)):
        if not deepest[b] > 0.0:
            continue
        for g in range(L):
            depth = planes[b, 3 * L + g]
            if depth <= 0.0:
                continue
            curvature = 6.0 * constants[b, 3 * L + g] * depth
            for i in range(3):
                for j in range(3):
                    place = places[b, (3 * i + j) * L + g]
                    if place >= 0:
                        weights = constants[b, i * L + g] * constants[b, j * L + g]
                        values[place] += curvature * weights
    return 0.0


@njit(cache=True, inline="always")
def sample_depth(x, stencil, weight, margin, c, n):
    """Return max(eps - n.(x_s - c), 0) of one contact sample [m]."""
    distance = 0.0
    for i in range(3):
        sample = (
            weight[0] * x[stencil[0], i] + weight[1] * x[stencil[1], i] + weight[2] * x[stencil[2], i]
        )
        distance += n[i] * (sample - c[i])
    return max(margin - distance, 0.0)


def vertex_block(term: ContactPenalty) -> VertexBlocks:
    """Hand the samples of the term to vertex block descent."""
    return VertexBlocks(_add_block, term.stencils, term.weights > 0.0, lambda: _arrays(term))


def constraint(term: ContactPenalty) -> Constraints:
    """Hand the samples of the term to XPBD: C = depth^(3/2) of each."""
    return Constraints(_solve, lambda: (*_arrays(term), np.zeros(len(term.stencils))))


def _arrays(term: ContactPenalty) -> tuple:
    """Return stencils, weights, stiffness, margin, points and normals, as the step has frozen them."""
    planes = np.ascontiguousarray(term.points), np.ascontiguousarray(term.normals)
    return term.stencils, term.weights, term.stiffness, term.margin, *planes


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_block(data, x, v, g, H, scratch):
    """Add gradient and block of vertex v."""
    first, corners, stencils, shares, stiffness, margin, points, normals = data
    for at in range(first[v], first[v + 1]):
        e, corner = corners[at] // 3, corners[at] % 3
        d = sample_depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if d > 0.0:
            share = shares[e, corner]
            for i in range(3):
                g[i] -= 3.0 * stiffness[e] * d * d * share * normals[e, i]
                for j in range(3):
                    H[i, j] += 6.0 * stiffness[e] * d * share * share * normals[e, i] * normals[e, j]
    return 0.0


@njit(cache=True, error_model="numpy")
def _solve(data, x, w):
    """Solve one sample after the other."""
    stencils, shares, stiffness, margin, points, normals, force = data
    for e in range(len(stencils)):
        d = sample_depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if (d > 0.0 or force[e] != 0.0) and stiffness[e] > 0.0:
            compliance = 1.0 / (2.0 * stiffness[e])
            slope = -1.5 * np.sqrt(d)  # of C along the normal
            total = compliance
            for c in range(3):
                total += w[stencils[e, c]] * (slope * shares[e, c]) ** 2
            change = -(d * np.sqrt(d) + compliance * force[e]) / total
            force[e] += change
            for c in range(3):
                for i in range(3):
                    x[stencils[e, c], i] += (
                        w[stencils[e, c]] * slope * shares[e, c] * normals[e, i] * change
                    )
    return 0.0


DEFAULT_STIFFNESS = 3.4e6  # [J/m^5]: some 2800 J/m^3 on a vertex of a T-shirt with 1000 vertices
DEFAULT_MARGIN = 4e-3  # [m]


class ContactPenalty(Energy):
    """Penalty energy [J] of each contact sample of `cloth`.

    The stiffness is k [J/m^5], the margin eps [m]; samples are "all" (vertices, edge midpoints,
    centroids) or "vertices". per_sample_stiffness is k a_s [J/m^3], the same for every sample, instead;
    the paper's form: `ContactPenalty(cloth, samples="vertices", per_sample_stiffness=250, margin=2e-3)`.

    Raises ValueError for other samples, or a stiffness or margin that is negative or not finite.
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
        demand_positive("ContactPenalty", or_zero=True, stiffness=stiffness, margin=margin)
        demand_positive("ContactPenalty", or_zero=True, per_sample_stiffness=per_sample_stiffness or 0.0)
        self.cloth = cloth
        self.samples = samples
        self.margin = float(margin)
        self.stencils, self.weights, self.sample_areas = _samples(cloth, samples)
        self.stiffness = stiffness * self.sample_areas
        if per_sample_stiffness is not None:
            self.stiffness = np.full(len(self.stencils), float(per_sample_stiffness))
        rows = np.repeat(np.arange(len(self.stencils)), 3)
        self.sample_matrix = sp.csr_matrix(
            (self.weights.ravel(), (rows, self.stencils.ravel())),
            shape=(len(self.stencils), cloth.vertex_count),
        )
        self.rest_samples = self.sample_matrix @ cloth.rest_positions
        self.planes: Planes | None = None
        self.step: Step | None = None  # that the planes belong to
        # Until a step is prepared every plane lies far below its sample, finite also as float32: no contact.
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
        planes = step.obstacle.planes(samples, step.frame, self.rest_samples, margin=self.margin)
        self.planes, self.points, self.normals = planes, planes.points, planes.normals
        self.step = step

    def element_energy(
        self, u: Tensor, points: Tensor | None = None, normals: Tensor | None = None
    ) -> Tensor:
        """Return E [J] of each sample: u (..., N, 3, 3) [m] -> (..., N).

        points, normals: (..., N, 3) [m], of planes in place of the prepared ones.
        """
        import torch

        c = torch.as_tensor(self.points).to(u) if points is None else points
        n = torch.as_tensor(self.normals).to(u) if normals is None else normals
        sample = (torch.as_tensor(self.weights).to(u)[:, :, None] * u).sum(-2)
        depth = torch.clamp(self.margin - (n * (sample - c)).sum(-1), min=0.0)
        return torch.as_tensor(self.stiffness).to(u) * depth**self.power

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        x = self.check_positions(x)
        gradient = np.zeros_like(x)
        planes = self.points, self.normals
        value = _gradient(x, self.stencils, self.weights, self.stiffness, self.margin, *planes, gradient)
        return value, gradient

    def add_hessian(self, x: np.ndarray, convexity: float, places: BlockPlaces, data: np.ndarray) -> None:
        """Add the second derivatives at x (V, 3) [m] to the values `data` of a matrix."""
        _add_hessian(
            *self._curvatures(x),
            self.weights,
            self.normals,
            places.slots,
            places.base,
            places.stride,
            data,
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

    All stencils have three vertices; a vertex sample repeats itself with weight 0.
    """
    vertices = np.arange(cloth.vertex_count)
    stencils = [np.repeat(vertices[:, None], 3, axis=1)]
    weights = [np.tile([1.0, 0.0, 0.0], (len(vertices), 1))]
    areas = [cloth.vertex_areas]
    if kind == "all":
        edges, faces = cloth.edges, cloth.faces
        stencils += [edges[:, [0, 1, 1]], faces]
        weights += [np.tile([0.5, 0.5, 0.0], (len(edges), 1)), np.full((len(faces), 3), 1 / 3)]
        areas += [
            np.bincount(cloth.sides.ravel(), np.repeat(cloth.areas / 3, 3), len(edges)),
            cloth.areas,
        ]
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
