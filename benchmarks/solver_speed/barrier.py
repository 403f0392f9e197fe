"""What it costs that nothing passes: a sheet on a ball with the penalty and with IPC's barrier."""

from __future__ import annotations

import dataclasses

import numpy as np

from reference_sim import Obstacle, simulate
from reference_sim.energies import ContactBarrier, Energy

from ..parts import Row
from ..presets import find_preset
from ..scene import BuiltScene

CASES = ("sheet on ball, 20 x 20", "sheet on ball, 40 x 40")
FRAMES = 30
DISTANCE = 1e-3  # [m] of the barrier: below the flattest triangle of both sheets, which is 1.6 mm high
CONTACTS = ("penalty", "barrier", "barrier, self-contact")


def sheet_on_ball(case: str) -> BuiltScene:
    """The scene sheet_on_sphere with as many cells as the case says."""
    from ..scenes.sheet_on_sphere import build

    cells = int(case.split()[-1])
    return build(case, dataclasses.replace(find_preset("quick"), sheet_cells=cells, sheet_frames=FRAMES))


def with_contact(scene: BuiltScene, contact: str) -> tuple[Energy, ...]:
    """The scene's terms with one of CONTACTS for its penalty. Raises ImportError without ipctk."""
    if contact == "penalty":
        return scene.energies
    barrier = ContactBarrier(scene.cloth, distance=DISTANCE, self_contact="self" in contact)
    return (*(energy for energy in scene.energies if energy.name != "collision"), barrier)


def crossings(positions: np.ndarray, faces: np.ndarray, obstacle: Obstacle, *, itself: bool) -> int:
    """Frames of a cloth (T, V, 3) in which an edge cuts a face: the cloth's own, or one of the other side.

    Asked of ipctk over all frames and the whole meshes, not of what the simulation kept.
    """
    import ipctk

    ipctk.set_logger_level(ipctk.error)
    count = positions.shape[1]
    faces = faces if itself else np.concatenate([faces, obstacle.faces + count])
    faces = np.asfortranarray(faces, dtype=np.int32)
    cut = 0
    for frame, x in enumerate(positions):
        points = np.asfortranarray(x if itself else np.concatenate([x, obstacle.at(frame)]))
        mesh = ipctk.CollisionMesh(points, ipctk.edges(faces), faces)
        if not itself:
            sides = (np.arange(len(points)) >= count).astype(np.int32)
            mesh.can_collide = ipctk.make_vertex_patches_filter(sides)
        cut += bool(ipctk.has_intersections(mesh, points))
    return cut


def measure(case: str, repeats: int) -> list[Row]:
    """ms a frame of each contact, their ratio to the penalty's, and frames with an intersection."""
    scene = sheet_on_ball(case)
    assert scene.obstacle is not None
    rows: list[Row] = []
    penalty = None
    for contact in CONTACTS:
        medians = []
        for _ in range(min(repeats, 3) + 1):  # the first one compiles
            trajectory = simulate(
                scene.cloth,
                with_contact(scene, contact),
                dt=scene.dt,
                frames=scene.frames,
                obstacle=scene.obstacle,
                start=scene.start,
            )
            medians.append(float(np.median(trajectory.frame_seconds[1:])))
        median, fields = float(np.median(medians[1:])), trajectory.frame_fields
        penalty = penalty or median
        converged = f"{int(fields['converged'].sum())} of {scene.frames}"
        cuts = [
            crossings(trajectory.positions, trajectory.faces, scene.obstacle, itself=itself)
            for itself in (False, True)
        ]
        rows += [
            (f"{contact}: frame, median", 1e3 * median, "ms"),
            (f"{contact}: over the penalty", median / penalty, "1"),
            (f"{contact}: iterations, mean", float(fields["iterations"][1:].mean()), ""),
            (f"{contact}: factorisations, mean", float(fields["factorisations"][1:].mean()), ""),
            (f"{contact}: converged frames", converged, ""),
            (f"{contact}: frames cut by the ball", cuts[0], ""),
            (f"{contact}: frames cut by itself", cuts[1], ""),
        ]
    return rows
