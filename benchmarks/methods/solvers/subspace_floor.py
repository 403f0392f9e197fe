"""Floor of a subspace: each time step minimised over the few numbers a frame that a network would predict.

    x_v(q) = M_v (r_v + m_v + sum_k U_vk q_k)       M: skinning, r: the unposed garment, m + U q: its offsets

It is the simulation, from its own past and with its own contact planes, whose cloth can only do what the
subspace expresses: handles, or all that the last layer of a network can give (for ridge on principal
components these components, for SNUG the span of its last 256 numbers). So the excess of a network over the
reference splits into the floor's, which no training removes, and the rest, which its training has not
learned. Both are roll-outs with a past of their own, so that the rest may be negative where cloth is chaotic.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.results.run_folder import model_path
from benchmarks.scene import BuiltScene
from reference_sim.minimise.subspace import Placement, SubspaceNewton, nearest_offsets, orthonormal
from reference_sim.potential import Potential
from snug.networks.dressed_body import DressedBody
from snug.networks.handles import shape_functions, span
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT

Space = tuple[np.ndarray, np.ndarray, int]  # U (3 V, K), m (3 V,) [m], sweeps over the skinning weights


@dataclass(kw_only=True)
class SubspaceFloor(Simulation):
    """Simulation within a subspace of offsets.

    space: makes the subspace for a dressed body.
    Raises ValueError for a scene of several steps a frame: there is a pose for its last alone.
    """

    space: Callable[[DressedBody], Space]

    def prepare(self, scene: BuiltScene) -> None:
        """Pose the subspace in each frame, start from its point nearest to the scene's start, compile."""
        if scene.substeps > 1:
            raise ValueError(f"scene {scene.name} has {scene.substeps} steps a frame, poses are of one")
        assert scene.dressed is not None
        dressed = DressedBody(scene.dressed.body, scene.dressed.garment)
        columns, centre, smoothing = self.space(dressed)
        vertices = dressed.vertices
        basis = orthonormal(columns).reshape(vertices, 3, -1)
        placements = _placements(dressed, scene, centre.reshape(vertices, 3), smoothing)
        offsets = nearest_offsets(basis, placements[0].unposed(scene.start))
        start = placements[0].posed(offsets)
        start[scene.cloth.pins] = scene.start[scene.cloth.pins]

        def in_subspace(potential: Potential, **options: Any) -> SubspaceNewton:
            return SubspaceNewton(
                potential, basis=basis, placements=placements[1:], offsets=offsets, **options
            )

        self.options = {"method": in_subspace}
        state = np.stack([start, scene.start_velocity])
        super().prepare(dataclasses.replace(scene, settle=lambda: state))


def _placements(
    dressed: DressedBody, scene: BuiltScene, centre: np.ndarray, smoothing: int
) -> list[Placement]:
    """Return turns and places of the vertices in each frame, with offsets `centre` (V, 3) [m]."""
    assert scene.dressed is not None
    motion, betas = scene.dressed.motion, scene.dressed.betas
    weights = dressed.weights(smoothing).double().numpy()
    transforms = dressed.transforms(motion.poses, betas).double().numpy()
    unposed = dressed.rest(betas).double().numpy() + centre
    placements = []
    for joints, pelvis in zip(transforms, dressed.pelvis(motion, betas)):
        blended = np.einsum("vj,jik->vik", weights, joints)
        turns = np.ascontiguousarray(blended[..., :3])
        placements.append(
            Placement(turns, np.einsum("vij,vj->vi", turns, unposed) + blended[..., 3] + pelvis)
        )
    return placements


def _handle_space(count: int) -> Callable[[DressedBody], Space]:
    def space(dressed: DressedBody) -> Space:
        functions = shape_functions(dressed.garment, count)
        return span(functions), np.zeros(3 * dressed.vertices), DEFAULT.smoothing

    return space


def _last_layer(path: Path) -> Callable[[DressedBody], Space]:
    def space(dressed: DressedBody) -> Space:
        model = TrainedModel.load(path)
        basis, centre = (part.double().numpy().copy() for part in model.network.offset_space())
        rows = (3 * np.asarray(model.network.pins, dtype=np.int64)[:, None] + np.arange(3)).ravel()
        basis[rows], centre[rows] = 0.0, 0.0
        return basis, centre, model.recipe.smoothing

    return space


def make(*, models: Path, seed: int, handles: int = 0, network: str = "") -> SubspaceFloor:
    """Make the floor of so many handles, or that of the last layer of a network."""
    space = _last_layer(model_path(models, network, seed)) if network else _handle_space(handles)
    return SubspaceFloor(options={}, space=space)
