"""Floors: the simulation whose cloth can only do what a network can express, each step minimised over that.

A floor has its own past and its own contact planes. Its subspace is that of handles, or all that the last
layer of a network can give,

    x_v(q) = M_v (r_v + m_v + sum_k U_vk q_k)

with skinning M, the unposed garment r and its offsets m + U q.
No training removes the excess of this floor over the reference.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import BuiltScene, MethodEntry
from benchmarks.method import Reporting
from benchmarks.methods.simulation import Simulation
from benchmarks.results.run_folder import model_path
from reference_sim import Potential
from snug import DressedBody, TrainedModel
from snug.networks.handles import shape_functions, span
from snug.recipe import DEFAULT
from subspace import Placement, SubspaceNewton, nearest_offsets, orthonormal

COUNTS = (20, 40, 80)  # handles


def _floor(name: str, label: str, space: str, **fields: Any) -> MethodEntry:
    """Declare the simulation within what a network can express. Its time is not that of a network."""
    return MethodEntry(
        name=f"{name}-floor", label=label,
        description=f"no network: each time step minimised over {space}",
        needs_body=True, gives_first_frame=True, static_known=False, timed=False, role="solver",
        **{"reporting": Reporting(base=name, pairing_group=name)} | fields,
    )  # fmt: skip


METHODS = (
    *(
        _floor(
            f"handles-{count}", f"Floor of {count} handles", f"the transforms of {count} handles",
            options={"handles": count},
            reporting=Reporting(
                family="handles-floor", level=count, base=f"handles-{count}", pairing_group="handles"
            ),
        )
        for count in COUNTS
    ),
    *(
        _floor(
            name, f"Floor of {label}", f"all that {space} can give", options={"network": name},
            trained=name, seeded=seeded,
        )
        for name, label, space, seeded in (
            ("snug", "SNUG", "SNUG's last layer", True),
            ("pbns", "PBNS", "PBNS's last layer", True),
            ("pose-regression", "principal components", "64 principal components of the offsets", False),
        )
    ),
)  # fmt: skip

Space = tuple[np.ndarray, np.ndarray, int]  # U (3 V, K), m (3 V,) [m], sweeps over the skinning weights


@dataclass(kw_only=True)
class SubspaceFloor(Simulation):
    """Simulation within the subspace of offsets that `space` makes for a dressed body."""

    space: Callable[[DressedBody], Space]

    def prepare(self, scene: BuiltScene) -> None:
        """Pose the subspace in each frame, start from its point nearest to the scene's start, compile.

        Raises ValueError for a scene of several steps a frame: there is a pose for its last alone.
        """
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

        # No `partial`: a trajectory's provenance would hold its arrays.
        def in_subspace(potential: Potential, **options: Any) -> SubspaceNewton:
            further: dict[str, Any] = {"offsets": offsets, **options}
            return SubspaceNewton(potential, basis=basis, placements=placements[1:], **further)

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


def _handle_space(dressed: DressedBody, *, count: int) -> Space:
    functions = shape_functions(dressed.garment, count)
    return span(functions), np.zeros(3 * dressed.vertices), DEFAULT.smoothing


def _last_layer(dressed: DressedBody, *, path: Path) -> Space:
    model = TrainedModel.load(path)
    basis, centre = (part.double().numpy().copy() for part in model.network.offset_space())
    rows = (3 * np.asarray(model.network.pins, dtype=np.int64)[:, None] + np.arange(3)).ravel()
    basis[rows], centre[rows] = 0.0, 0.0
    return basis, centre, model.recipe.smoothing


def make(*, models: Path, seed: int, handles: int = 0, network: str = "") -> SubspaceFloor:
    """Make the floor of so many handles, or that of the last layer of a network."""
    if not network:
        return SubspaceFloor(space=partial(_handle_space, count=handles))
    return SubspaceFloor(space=partial(_last_layer, path=model_path(models, network, seed)))
