"""Shipped references: a scene of the T-shirt's test motions is scored without being simulated.

A file has the simulation to four micrometres, its quasi-static solution at the hem, and the metrics of
simulation, skinning, SNUG and PBNS, but for the excess of PBNS in its own energies: these have no inertia.
It serves a scene whose declaration, sizes and protocol are those that it was made with.
`benchmarks.publish references` makes them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.plan.cell import flat
from benchmarks.plan.plan import Plan, protocol_of
from benchmarks.provenance import digest
from benchmarks.results.protocol import DIGESTS, OWN
from benchmarks.runner.schedule import read_entry
from benchmarks.scene import Scene
from reference_sim.files.array_file import read_arrays
from reference_sim.files.atomic_files import replacing
from reference_sim.geometry.topology import half_edges
from snug.garments.garment import Garment
from snug.trained import FOLDER as NETWORKS
from snug.trained import SUFFIX, network_name

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.metric import Faces, Floats, Positions
    from benchmarks.scene import BuiltScene

FOLDER = Path(__file__).parent / "reference_data"
GARMENT, LOOP = FOLDER / "garment.npz", "loop_"
TSHIRT, VERTICES = "tshirt", 1000  # the garment of the scenes, and about how many vertices it has
METHODS = ("simulation", "skinning", "snug", "pbns")  # whose metrics are shipped
TRAINED = METHODS[2:]
STEP = 2.0**-18  # [m] to which positions are rounded
# Of the protocol: what a scene's numbers depend on.
PARTS = ("scenes", "materials", "metrics", "reference")
SAME = 1e-4  # [rad], [m] by which one motion may differ from another processor's


@dataclass(frozen=True, eq=False)
class Reference:
    """A simulation that is shipped in place of one of a scene, and what was measured beside it.

    Attributes:
        positions: (T,V,3) [m] of the simulation, its start included.
        hem: (T,H,3) [m], its quasi-static solution at the garment's hem.
        status, reason: how the simulation ended.
        metrics: method -> metric -> number.
        origin: commit, preset and hardware of the numbers.
        networks: method -> digest of the measured network.
    """

    positions: Positions
    hem: Positions
    status: str = "ok"
    reason: str = ""
    metrics: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    origin: Mapping[str, str] = field(default_factory=dict)
    networks: Mapping[str, str] = field(default_factory=dict)


def find_in_package(method: str) -> Path:
    """Return the file of the package's network for the T-shirt."""
    return NETWORKS / f"{network_name(method, TSHIRT, 0)}{SUFFIX}"


def load_garment(plan: Plan) -> dict[str, Garment]:
    """Return the T-shirt by its name, as it is tailored to the package's body; empty for another one."""
    if plan.inputs.body or plan.study.sizes.garment_vertices != VERTICES or not GARMENT.is_file():
        return {}
    arrays: dict[str, Any] = read_arrays(GARMENT)
    loops = {name.removeprefix(LOOP): arrays.pop(name) for name in list(arrays) if name.startswith(LOOP)}
    return {TSHIRT: Garment(TSHIRT, **arrays, loops=loops)}


def write_garment(garment: Garment) -> None:
    """Write the file that `load_garment` reads."""
    names = ("rest_positions", "faces", "body_vertices", "skinning_weights")
    arrays: dict[str, Any] = {name: getattr(garment, name) for name in names}
    loops = {f"{LOOP}{name}": loop for name, loop in garment.loops.items()}
    with replacing(GARMENT) as temporary:
        np.savez_compressed(temporary, **arrays | loops)


def key_of(scene: Scene, plan: Plan, built: BuiltScene) -> str:
    """Return the digest of what the numbers of a scene depend on, but for code and motion."""
    sizes, declaration = plan.study.sizes, read_entry(scene) | {"faces": digest(built.cloth.faces)}
    del declaration["metrics"]
    parts = [DIGESTS[name] for name in PARTS]
    return digest([declaration, sizes.garment_vertices, sizes.frames, sizes.gap_samples, parts])


def motion_of(built: BuiltScene) -> Floats:
    """Return poses [rad] and translations [m] of a scene's frames, (T,N)."""
    assert built.dressed is not None
    motion = built.dressed.motion
    return np.column_stack([motion.poses.reshape(motion.frames, -1), motion.translations])


def find_reference(scene: Scene, plan: Plan, built: BuiltScene) -> Reference | str:
    """Return the reference of a scene of a plan, or why none is shipped."""
    path = FOLDER / f"{flat(scene.name)}.npz"
    is_own = any(protocol_of(cell, plan) == OWN for cell in plan.cells if cell.scene == scene)
    if is_own or not path.is_file():
        return "none is shipped for this scene, garment, body, motion and sizes"
    arrays = read_arrays(path)
    facts = json.loads(str(arrays.pop("facts")))
    moved, motion = arrays["motion"], motion_of(built)
    same = moved.shape == motion.shape and np.allclose(moved, motion, rtol=0.0, atol=SAME)
    if facts.pop("key") != key_of(scene, plan, built) or not same:
        return f"{path.name} is of another scene, motion or protocol"
    moves, hem_moves = (_unpack(arrays[name]) for name in ("positions", "hem"))
    order, parents = _tree(built.cloth.faces)
    for vertex in order[1:]:
        moves[:, vertex] += moves[:, parents[vertex]]
    positions, hem = (STEP * x.cumsum(axis=0).cumsum(axis=0) for x in (moves, hem_moves))
    return Reference(positions, hem, **facts)


def write_reference(scene: Scene, plan: Plan, reference: Reference, built: BuiltScene) -> Path:
    """Write the file of a scene; return its path."""
    rounded = (np.rint(x / STEP).astype(np.int64) for x in (reference.positions, reference.hem))
    positions, hem = (np.diff(x, n=2, axis=0, prepend=0 * x[:2]) for x in rounded)
    order, parents = _tree(built.cloth.faces)
    deltas = positions.copy()
    deltas[:, order[1:]] -= positions[:, parents[order[1:]]]
    names = ("status", "reason", "metrics", "origin", "networks")
    facts = {"key": key_of(scene, plan, built)} | {name: getattr(reference, name) for name in names}
    path = FOLDER / f"{flat(scene.name)}.npz"
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(
            stream, positions=_pack(deltas), hem=_pack(hem), facts=np.array(json.dumps(facts)),
            motion=motion_of(built).astype(np.float32),
        )  # fmt: skip
    return path


def _tree(faces: Faces) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return all vertices, each behind a neighbour, and this neighbour: both move nearly alike."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    halves = half_edges(faces)
    graph = coo_array((np.ones(len(halves)), tuple(halves.T))).tocsr()
    return breadth_first_order(graph, 0, directed=False)


def _pack(numbers: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return whole numbers as bytes (4,...), signs in the lowest bit: the upper bytes are mostly 0."""
    moved = ((numbers << 1) ^ (numbers >> 63)).astype("<u4")
    return np.moveaxis(moved[..., None].view(np.uint8), -1, 0)


def _unpack(packed: NDArray[np.uint8]) -> NDArray[np.int64]:
    codes = np.ascontiguousarray(np.moveaxis(packed, 0, -1)).view("<u4")[..., 0].astype(np.int64)
    return (codes >> 1) ^ -(codes & 1)
