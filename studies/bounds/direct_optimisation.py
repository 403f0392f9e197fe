"""Direct optimisation: the vertices of a whole clip under the training loss, without a network.

    min over x_1 ... x_T of  sum_t [strain + bending + gravity + collision](x_t)
                             + sum_{t >= 3} inertia(x_t),
    inertia(x_t) = sum_v m_v / (2 dt^2) |x_t - 2 x_{t-1} + x_{t-2}|^2

which a network could reach whose output were not bound to its input. The sum is not convex: the bound is
found from skinning, by L-BFGS in rounds of frozen contact planes, and not proven to be the lowest.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks import BuiltScene, Method, MethodEntry
from benchmarks.scenes.dressed_body import declared_energies
from reference_sim import Cloth, Potential, Trajectory
from reference_sim.energies import ContactPenalty, Energy, Gravity, Inertia
from reference_sim.minimise.minimisers import make_minimiser

METHODS = (
    MethodEntry(
        name="direct-optimisation",
        label="Vertices optimised directly",
        description="no network: the vertices of a whole clip optimised directly, the least energy found",
        needs_body=True,
        gives_first_frame=True,
        role="bound",
    ),
)
ROUNDS, ITERATIONS, MEMORY = 40, 50, 20
FALL = 1e-4  # a round that lowers the sum by a smaller share is the last
TOLERANCE = 1e-4  # largest component of the gradient, in mean vertex weights


class ClipInertia(Inertia):
    """Inertia of a cloth that is `frames` copies of one: each vertex against its own two earlier frames."""

    def __init__(self, cloth: Cloth, dt: float, frames: int) -> None:
        super().__init__(cloth, dt)
        self.frames = frames

    def value_and_gradient(
        self, x: np.ndarray, x_hat: np.ndarray | None = None
    ) -> tuple[float, np.ndarray]:
        """Return the inertia of the whole clip [J] and its gradient at x (T V, 3)."""
        clip = x.reshape(self.frames, -1, 3)
        masses = self.masses.reshape(self.frames, -1, 1)[2:] / self.dt**2
        offset = clip[2:] - 2 * clip[1:-1] + clip[:-2]
        force = masses * offset
        gradient = np.zeros_like(clip)
        gradient[2:] += force
        gradient[1:-1] -= 2 * force
        gradient[:-2] += force
        return 0.5 * float(np.vdot(force, offset)), gradient.reshape(x.shape)

    def scalar_stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the diagonal alone: 1 + 4 + 1 of m/dt^2 where a frame has two neighbours on either side."""
        count = np.zeros(self.frames)
        for shift, weight in ((2, 1.0), (1, 4.0), (0, 1.0)):
            count[shift : self.frames - 2 + shift] += weight
        diagonal = np.repeat(count, len(self.masses) // self.frames) * self.masses / self.dt**2
        return np.arange(len(self.masses)), diagonal[:, None, None]


class DirectOptimisation(Method):
    """Direct optimisation of one clip. `sums`: minimised sum [J] at the end of each round."""

    def prepare(self, scene: BuiltScene) -> None:
        """Lay the frames out as one cloth and start from skinning.

        Raises ValueError for a scene with other terms than the paper's of a garment.
        """
        if _identity(scene.energies) != _identity(declared_energies(scene.cloth)):
            names = ", ".join(term.name for term in scene.energies)
            raise ValueError(
                f"direct optimisation minimises the paper's terms, scene {scene.name} has: {names}"
            )
        assert scene.skinned is not None
        self.scene, self.start = scene, scene.skinned
        one, frames = scene.cloth, scene.frames
        faces = one.faces + one.vertex_count * np.arange(frames)[:, None, None]
        # Side by side: a rest state is only sound where no two vertices coincide.
        apart = 2 * np.ptp(one.rest_positions[:, 0]) * np.arange(frames)[:, None, None] * [1.0, 0.0, 0.0]
        rest = (one.rest_positions + apart).reshape(-1, 3)
        pins = np.asarray(one.pins, dtype=np.int64) + one.vertex_count * np.arange(frames)[:, None]
        flat = None if one.rest_uv is None else np.concatenate([one.rest_uv] * frames)
        self.cloth = Cloth(rest, faces.reshape(-1, 3), one.material, pins=pins.ravel(), rest_uv=flat)
        self.terms = [*declared_energies(self.cloth), ClipInertia(self.cloth, scene.dt, frames)]
        # What the pelvis's own height adds to gravity: large, the same for all, and no measure of a fall.
        gravity = next(term for term in scene.energies if isinstance(term, Gravity))
        heights = np.zeros(frames) if scene.origin_heights is None else scene.origin_heights
        self.carried = float(gravity.weights.sum() * (heights - gravity.origin_height).sum())

    def run(self) -> Trajectory:
        """Minimise the clip in rounds, contact planes searched anew before each."""
        x = self.start.reshape(-1, 3)
        self.sums: list[float] = []
        potential = Potential(self.terms)
        descent = make_minimiser(
            potential,
            "lbfgs",
            finish=False,
            max_iterations=ITERATIONS,
            memory=MEMORY,
            tolerance=TOLERANCE,
        )
        status, reason = "stalled", f"the sum was still falling after {ROUNDS} rounds"
        for number in range(1, ROUNDS + 1):
            self.search(x)
            before = potential.value(x)
            result = descent.minimise(x)
            if result.status == "diverged" or not np.isfinite(result.positions).all():
                status, reason = "diverged", f"round {number}: {result.reason}"
                break
            x = result.positions
            self.sums.append(result.energy)
            if before - result.energy < FALL * abs(result.energy - self.carried):
                status, reason = "ok", ""
                break
        frames = self.scene.frames
        return Trajectory(
            positions=x.reshape(frames, -1, 3),
            faces=np.asarray(self.scene.cloth.faces),
            times=np.arange(frames) * self.scene.dt,
            status=status,
            reason=reason,
            provenance={"method": "direct-optimisation", "sums_J": [float(value) for value in self.sums]},
        )

    def search(self, x: np.ndarray) -> None:
        """Search the contact planes of all frames at x (T V, 3)."""
        obstacle, frames = self.scene.obstacle, self.scene.frames
        for single, whole in zip(self.scene.energies, self.terms):
            if not isinstance(single, ContactPenalty):
                continue
            assert obstacle is not None and isinstance(whole, ContactPenalty)
            clip = x.reshape(frames, -1, 3)
            planes = [
                obstacle.planes(single.sample_matrix @ clip[frame], frame, single.rest_samples)
                for frame in range(frames)
            ]
            whole.points = _by_kind(np.stack([p.points for p in planes]), single)
            whole.normals = _by_kind(np.stack([p.normals for p in planes]), single)


def _identity(terms: Sequence[Energy]) -> list[tuple[type[Energy], object]]:
    """Return type and parameters of each term, which tell two lists of terms apart."""
    return [(type(term), term.parameters()) for term in terms]


def _by_kind(values: np.ndarray, contact: ContactPenalty) -> np.ndarray:
    """Reorder (T, S, 3) of frames to (T S, 3) of the whole cloth: all vertices, all edges, all centroids."""
    vertices, edges = contact.cloth.vertex_count, len(contact.cloth.edges)
    kinds = [vertices, vertices + edges] if contact.samples == "all" else []
    parts = [part.reshape(-1, 3) for part in np.split(values, kinds, axis=1)]
    return np.ascontiguousarray(np.concatenate(parts))


def make(*, models: Path, seed: int) -> DirectOptimisation:
    """Make the bound; it has no seed and no model."""
    return DirectOptimisation()
