"""IPC's barrier: cloth never passes through itself (Li et al. 2020; in physical units Li et al. 2023).

    E = kappa dhat sum_k w_k m_k b(d_k^2 / dhat^2),   b(s) = -(s - 1)^2 ln s  for s < 1, else 0

over the pairs k of a vertex and a face, or of two edges, that are closer than dhat; d_k is their
distance. w_k [m^2] is a quarter of the rest area of the vertex, or of those of both edges; m_k fades out
edges that are nearly parallel. kappa [Pa] is a pressure: a pair pushes with -2 kappa w_k m_k b'(s) d_k /
dhat, which at half the distance dhat is 4.3 kappa w_k.

Distances, pairs, their derivatives and collision detection are those of the package ipctk (IPC Toolkit,
MIT licence), which *is* the definition: there is none in torch. Networks are trained with ContactPenalty.

Beyond a touch the energy means nothing: a distance has no sign. Hence `largest_step` bounds every line
search by continuous collision detection, and a step starts without an intersection, see `StepMinimiser`.
Contact with a body is another term's.
"""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, Step, demand_positive
from reference_sim.geometry.topology import corner_heights

if TYPE_CHECKING:
    import scipy.sparse as sp

DEFAULT_DISTANCE = 2e-3  # [m]
# Measured: a tenth of it saves nothing, a hundred times it doubles Newton.
DEFAULT_STIFFNESS = 1e2  # [Pa]
# Step of a vertex in a line search: one of a metre would meet nearly every pair.
LONGEST_STEP = 0.05  # [m]


class ContactBarrier(Energy):
    """Barrier energy [J] of `cloth` against itself; distance dhat [m], stiffness kappa [Pa].

    Raises ImportError without ipctk, ValueError for one that is not positive, and for a distance above a
    height of a rest triangle.
    """

    name = "barrier"
    dynamic = True

    def __init__(
        self, cloth: Cloth, *, distance: float = DEFAULT_DISTANCE, stiffness: float = DEFAULT_STIFFNESS
    ) -> None:
        demand_positive("ContactBarrier", distance=distance, stiffness=stiffness)
        _check_heights(cloth, distance)
        self.cloth = cloth
        self.stencils = np.zeros((0, 4), dtype=np.int64)
        self.distance, self.stiffness = float(distance), float(stiffness)
        self.package = ipctk = _load()
        self.potential = ipctk.BarrierPotential(self.distance, self.stiffness, use_physical_barrier=True)
        self._slack = self.distance / 4  # how far vertices may move before candidates are searched again
        self._ccd = ipctk.AdditiveCCD()
        triangles = np.asfortranarray(cloth.faces, dtype=np.int32)
        self.mesh = ipctk.CollisionMesh(
            np.asfortranarray(cloth.rest_positions), ipctk.edges(triangles), triangles
        )
        sides = self.mesh.faces_to_edges.ravel()
        self.mesh.vertex_areas = cloth.vertex_areas
        self.mesh.edge_areas = np.bincount(sides, np.repeat(cloth.areas / 3, 3), len(self.mesh.edges))
        self._hessians_of: Any = None
        self._hessians: dict[str, sp.csc_matrix] = {}
        self.search_again()

    def parameters(self) -> dict[str, Any]:
        """Return distance, stiffness and the version of the package."""
        return {
            "distance_m": self.distance,
            "stiffness_Pa": self.stiffness,
            "package": f"ipctk {self.package.__version__}",
        }

    def prepare(self, step: Step) -> None:
        """Keep nothing from the step before, so that sums over pairs have one order."""
        self.search_again()

    def search_again(self) -> None:
        """Search candidates and pairs anew when they are needed next."""
        self._way: tuple[np.ndarray, np.ndarray] | None = None  # what the candidates were searched for
        self._at: np.ndarray | None = None  # where the pairs were found

    def pairs(self, x: np.ndarray) -> tuple[Any, np.ndarray]:
        """Return the pairs closer than the distance at x (V, 3), and x as ipctk reads it."""
        if self._at is None or not np.array_equal(self._at, x):
            candidates, positions = self._candidates(x, x), np.asfortranarray(x)
            pairs = self.package.NormalCollisions()
            pairs.use_area_weighting = True
            pairs.build(candidates, self.mesh, positions, self.distance)
            self._pairs, self._at = (pairs, positions), x.copy()
        return self._pairs

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of E [J] and its gradient (V, 3) [N] at x (V, 3) [m]."""
        if not np.isfinite(x).all():
            return float("nan"), np.full(x.shape, np.nan)
        pairs, positions = self.pairs(x)
        gradient = self.potential.gradient(pairs, self.mesh, positions)
        return self.potential(pairs, self.mesh, positions), gradient.reshape(-1, 3)

    def sparse_hessian(self, x: np.ndarray, convexity: float = 0.0) -> sp.csc_matrix:
        """Return the second derivatives (3V, 3V) [N/m] at x (V, 3) [m]; see Energy."""
        if convexity in (0, 1):
            return self._hessian(x, "CLAMP" if convexity else "NONE")
        return (1 - convexity) * self._hessian(x, "NONE") + convexity * self._hessian(x, "CLAMP")

    def _hessian(self, x: np.ndarray, projection: str) -> sp.csc_matrix:
        """Return (3V, 3V), with the negative eigenvalues of each pair or without; kept while x stays."""
        neighbours = self.pairs(x)
        if self._hessians_of is not neighbours:
            self._hessians_of, self._hessians = neighbours, {}
        if projection not in self._hessians:
            pairs, positions = neighbours
            method = getattr(self.package.PSDProjectionMethod, projection)
            self._hessians[projection] = self.potential.hessian(pairs, self.mesh, positions, method)
        return self._hessians[projection]

    def largest_step(self, x: np.ndarray, direction: np.ndarray) -> float:
        """Return the share of `direction` that may be gone before anything meets; see Energy."""
        if not np.isfinite(direction).all():
            return 1.0
        pairs, positions = self.pairs(x)
        gap = min(self.distance, pairs.compute_minimum_distance(self.mesh, positions) ** 0.5)
        farthest = float(np.sqrt(np.einsum("vi,vi->v", direction, direction).max()))
        if 2 * farthest < gap:
            return 1.0  # nothing is close enough to be reached
        part = min(1.0, LONGEST_STEP / farthest)
        goal = x + part * direction
        return part * self._free_share(self._candidates(x, goal), x, goal)

    def ccd_fraction(self, x: np.ndarray, goal: np.ndarray) -> float:
        """Return the share of the way to goal (V, 3) [m] that is free of collisions; see Energy."""
        candidates = self.package.Candidates()
        candidates.build(self.mesh, np.asfortranarray(x), np.asfortranarray(goal), 0.0)
        return self._free_share(candidates, x, goal)

    def infeasibility(self, x: np.ndarray) -> str:
        """Name an edge that cuts a face; "" if there is none."""
        mesh, ipctk, positions = self.mesh, self.package, np.asfortranarray(x)
        if not np.isfinite(x).all() or not ipctk.has_intersections(mesh, positions):
            return ""
        search = ipctk.LBVH()
        search.can_vertices_collide = mesh.can_collide
        search.build(positions, mesh.edges, mesh.faces, 1e-6 * float(np.ptp(positions, axis=0).max()))
        for pair in search.detect_edge_face_candidates():
            edge, face = mesh.edges[pair.edge_id], mesh.faces[pair.face_id]
            if ipctk.is_edge_intersecting_triangle(*positions[edge], *positions[face]):
                return (
                    f"edge ({min(edge)}, {max(edge)}) of the cloth cuts face {pair.face_id} of the cloth"
                )
        return "an edge cuts a face"

    def _candidates(self, a: np.ndarray, b: np.ndarray) -> Any:
        """Return pairs that may come within the distance near the way from a to b, within the slack.

        They serve as long as nothing has moved farther than they were searched for.
        """
        if not (self._covers(a) and (b is a or self._covers(b))):
            candidates = self.package.Candidates()
            start, end = np.asfortranarray(a), np.asfortranarray(b)
            candidates.build(self.mesh, start, end, self.distance / 2 + self._slack)
            self._candidate_pairs, self._way = candidates, (a.copy(), b.copy())
        return self._candidate_pairs

    def _covers(self, x: np.ndarray) -> bool:
        if self._way is None:
            return False
        a, b = self._way
        way, off = b - a, x - a
        if way.any():
            t = np.einsum("vi,vi->v", off, way) / np.maximum(np.einsum("vi,vi->v", way, way), 1e-300)
            off -= np.clip(t, 0.0, 1.0)[:, None] * way
        return bool(np.einsum("vi,vi->v", off, off).max() <= self._slack**2)

    def _free_share(self, candidates: Any, x: np.ndarray, goal: np.ndarray) -> float:
        start, end = np.asfortranarray(x), np.asfortranarray(goal)
        return candidates.compute_collision_free_stepsize(self.mesh, start, end, 0.0, self._ccd)


def _check_heights(cloth: Cloth, distance: float) -> None:
    """Raise ValueError where a barrier reaches across a triangle and pushes the cloth apart."""
    heights = corner_heights(cloth.rest_corners)
    face = int(np.argmin(heights))
    if heights[face] <= distance:
        raise ValueError(
            f"ContactBarrier distance = {distance:g} m: face {face} is only {heights[face]:.3g} m high at "
            "rest; choose a distance below that, or a mesh without slivers"
        )


def _load() -> ModuleType:
    import ipctk

    ipctk.set_logger_level(ipctk.error)  # its warnings go to standard output
    ipctk.set_num_threads(1)  # sums of several threads differ in the last digit from run to run
    return ipctk
