"""Scene that a stored roll-out brings itself: cloth at rest from a mesh, body, and start from the file.

So the pickles of HOOD and ContourCraft are measured, which name no motion and no garment.
"""

from __future__ import annotations

import numpy as np

from benchmarks.external.roll_out_files import RollOutFileError, RollOutOption, read_roll_out
from benchmarks.provenance import digest
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth, MeshError
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.files.mesh_files import METRES, read_mesh, to_metres_y_up
from reference_sim.material import Material
from reference_sim.obstacle import Obstacle

FPS = 30.0  # where neither the file nor the user says another rate
CLOTH, GARMENT = (0.02, 20.0), (0.2, 4.0)  # [m] across, from and to: of any cloth; of one that is worn
# Vertices are no neighbours whose edges are in the mean so many times as long as at rest.
LONGEST_STRETCH = 3.0
MIN_FRAMES = 4  # frames: two are not evaluated, and a mean is of more than one


def declare_scene(option: RollOutOption, rest_mesh: str) -> Scene:
    """Declare the scene of a roll-out. Raises RollOutFileError for an unreadable file or half a body."""
    stored = read_roll_out(option.path)
    halves = {"obstacle": stored.obstacle, "obstacle_faces": stored.obstacle_faces}
    gaps = [name for name, half in halves.items() if half is None]
    if len(gaps) == 1:
        raise RollOutFileError(
            f"{option.path}: holds half a body: {gaps[0]} is absent; give obstacle (T,B,3) and "
            "obstacle_faces (G,3), or neither"
        )
    return Scene(
        name=f"file/{option.name}",
        description=f"the cloth and the body of {option.name}'s own roll-out",
        module=__name__,
        options={
            "path": option.path, "rest_mesh": rest_mesh, "units": option.units, "up": option.up,
            "fps": option.fps, "digests": (digest(stored), digest(read_mesh(rest_mesh))),
        },
        obstacle=not gaps,
    )  # fmt: skip


def build(
    scene: Scene, assets: object = None, *, path: str, rest_mesh: str, units: str, up: str, fps: float | None,
    digests: tuple[str, str],
) -> BuiltScene:  # fmt: skip
    """Build the scene; it starts at rest in the file's first frame. Raises RollOutFileError."""
    stored = read_roll_out(path)
    positions = to_metres_y_up(stored.positions, units=units, up=up)
    if len(positions) < MIN_FRAMES:
        raise RollOutFileError(f"{path}: {len(positions)} frames; at least {MIN_FRAMES} are needed")
    if fps and stored.fps and fps != stored.fps:
        raise RollOutFileError(f"{path}: says {stored.fps:g} frames a second, fps={fps:g}: leave fps out")
    try:
        rest = read_mesh(rest_mesh)
        if len(rest.positions) != positions.shape[1]:
            raise RollOutFileError(
                f"{rest_mesh}: {len(rest.positions)} vertices, {path} has {positions.shape[1]}: give the "
                "mesh that the roll-out was made with"
            )
        cloth = Cloth(to_metres_y_up(rest.positions, units=units, up=up), rest.faces, Material())
        ends = positions[0][cloth.edges]
        stretch = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean() / cloth.edge_lengths.mean()
        if stretch > LONGEST_STRETCH or stretch < 1.0 / LONGEST_STRETCH:
            raise RollOutFileError(
                f"{rest_mesh}: in the first frame of {path} its edges have {stretch:.3g} times their length: "
                "write both in one unit and order of vertices"
            )
        _demand_a_size(cloth.rest_positions, rest_mesh, units)
        obstacle = None
        if stored.obstacle is not None and stored.obstacle_faces is not None:  # cloth may touch all of it
            obstacle = Obstacle(
                to_metres_y_up(stored.obstacle, units=units, up=up), stored.obstacle_faces
            )
    except MeshError as error:
        raise RollOutFileError(f"{path} with {rest_mesh}: {error}") from None
    contact = () if obstacle is None else (ContactPenalty(cloth),)
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), *contact),
        dt=1.0 / (fps or stored.fps or FPS),
        frames=len(positions),
        settle=lambda: np.ascontiguousarray(positions[0]),
        obstacle=obstacle,
    )


def _demand_a_size(rest_positions: np.ndarray, rest_mesh: str, units: str) -> None:
    """Raise RollOutFileError for a cloth (V,3) [m] that is a garment in another unit."""
    across = float(np.linalg.norm(np.ptp(rest_positions, axis=0)))
    low, high = GARMENT
    fit = [f"units={unit}" for unit, m in METRES.items() if low <= across / METRES[units] * m <= high]
    if fit and not CLOTH[0] <= across <= CLOTH[1]:
        raise RollOutFileError(
            f"{rest_mesh}: the cloth is {across:.3g} m across in units={units}: say {' or '.join(fit)}"
        )
