"""Scenes of a sheet without a body: hanging, on a sphere, flag, twisted strip, free fall.

Scene of a thrown sheet under its weight alone: backward Euler's own discrete answer is exact.

    x_n = x_0 + n dt v_0 + g dt^2 n (n+1)/2

The parabola of the continuous problem is not the answer: at 30 frames per second it is 0.16 m away after
one second. With weight alone every vertex moves alike, so that strain and bending have nothing to do and
are not declared.
"""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import in_space, rectangle, sheet, sphere, square_sheet
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy
from reference_sim.energies.gravity import Gravity
from reference_sim.material import GRAVITY, Material


def _cloth_energies(cloth: Cloth) -> tuple[Energy, ...]:
    """Return strain, bending and weight; a scene without them does not load them."""
    from reference_sim.energies.bend_hinge import BendHinge
    from reference_sim.energies.stretch_stvk import StretchStVK

    return StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)


VELOCITY = np.array([0.7, 2.0, -0.3])  # [m/s]


def build_free_fall(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int
) -> BuiltScene:
    """Build the scene with its exact answer; no assets are needed."""
    positions, faces = square_sheet(sheet_cells, 0.4)
    cloth = Cloth(positions, faces, Material())
    dt, frames = 1.0 / 30.0, sheet_frames
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(Gravity(cloth),),
        dt=dt,
        frames=frames,
        settle=lambda: np.stack([positions, np.broadcast_to(VELOCITY, positions.shape)]),
        exact=exact_fall(positions, VELOCITY, dt, frames),
    )


def exact_fall(start: np.ndarray, velocity: np.ndarray, dt: float, frames: int) -> np.ndarray:
    """Return the exact steps (T,V,3) [m] of backward Euler from start (V,3) [m] with one velocity (3,) [m/s].

    >>> import numpy as np
    >>> fall = exact_fall(np.zeros((1, 3)), np.zeros(3), 0.1, 3)[:, 0, 1]
    >>> [round(float(height), 4) for height in fall]
    [0.0, -0.0981, -0.2943]
    """
    n = np.arange(frames)[:, None, None]
    fall = np.array([0.0, -GRAVITY, 0.0]) * dt**2 * n * (n + 1) / 2
    return start + n * dt * velocity + fall


HANGING_SIZE = 0.4  # [m]


def build_hanging_sheet(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int
) -> BuiltScene:
    """Build the scene; no assets are needed."""
    positions, faces = square_sheet(sheet_cells, HANGING_SIZE)
    # Tilted by half a degree: a flat sheet hanging flat is a saddle, from which symmetry alone would choose.
    positions[:, 1] += 0.01 * positions[:, 0]
    cloth = Cloth(positions, faces, Material(), pins=(0, sheet_cells))
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=_cloth_energies(cloth),
        dt=1.0 / 30.0,
        frames=sheet_frames,
        settle=lambda: cloth.rest_positions,
    )


FLAG_SIZE = 0.4  # [m]
SWING = 0.15  # [m] to either side
PERIOD = 1.0  # [s]


def build_flag(scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int) -> BuiltScene:
    """Build the scene; no assets are needed."""
    flat, faces = square_sheet(sheet_cells, FLAG_SIZE)
    positions = np.stack([flat[:, 0], -flat[:, 2], flat[:, 1]], axis=1)  # upright, in the plane of x and y
    pole = np.arange(sheet_cells + 1)  # the edge at the smallest x
    cloth = Cloth(positions, faces, Material(), pins=pole)
    dt = 1.0 / 30.0

    def handles(frame: int) -> np.ndarray:
        """Return the pole in a frame, (P,3) [m]: it starts from rest, so that the first frame has no jolt."""
        phase = 2.0 * np.pi * frame * dt / PERIOD
        return positions[pole] + [0.0, 0.0, SWING * np.sin(phase) * (1.0 - np.cos(min(phase, np.pi))) / 2.0]

    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=_cloth_energies(cloth),
        dt=dt,
        frames=sheet_frames,
        settle=lambda: positions,
        pin_positions=handles,
    )


RADIUS = 0.12  # [m]
DRAPED_SIZE = 0.5  # [m]
GAP = 0.02  # [m] between sphere and sheet at the start


def build_sheet_on_sphere(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int, family: str = ""
) -> BuiltScene:
    """Build the scene; no assets are needed.

    family: of triangles, as `rectangle` has them; such a sheet lies on the sphere and is held at its middle,
    so that it drapes and does not slide off.
    """
    from reference_sim.energies.contact_penalty import ContactPenalty
    from reference_sim.obstacle import Obstacle

    if family:
        flat, faces = rectangle(family, sheet_cells, sheet_cells, DRAPED_SIZE, DRAPED_SIZE)
        positions = in_space(flat - DRAPED_SIZE / 2)[:, [1, 2, 0]]  # faces up
        gap, pins = 0.0, [int(np.argmin(np.linalg.norm(positions, axis=1)))]
    else:
        positions, faces = square_sheet(sheet_cells, DRAPED_SIZE)
        gap, pins = GAP, []
    # Off the sphere's axis by a little: centred, it would balance on a symmetry.
    positions += [0.004, RADIUS + gap, 0.002]
    cloth = Cloth(positions, faces, Material(), pins=pins)
    points, triangles = sphere(RADIUS, 24)
    frames = sheet_frames
    obstacle = Obstacle(points, triangles)
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(*_cloth_energies(cloth), ContactPenalty(cloth)),
        dt=1.0 / 30.0,
        frames=frames,
        settle=lambda: positions,
        obstacle=obstacle,
    )


LENGTH, WIDTH = 0.4, 0.12  # [m]
TURN = np.pi  # of each end, against the other
CLOSER = 0.1  # share of the length by which the ends approach, so that the strip may fold


def build_twisted_strip(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int
) -> BuiltScene:
    """Build the scene; no assets are needed."""
    across = max(2, sheet_cells // 2)
    positions, faces = sheet((round(across * LENGTH / WIDTH), across), (LENGTH, WIDTH))
    ends = np.flatnonzero(np.abs(np.abs(positions[:, 0]) - LENGTH / 2) < 1e-9)
    cloth = Cloth(positions, faces, Material(), pins=ends)
    side = np.sign(positions[ends, 0])
    frames = sheet_frames

    def handles(frame: int) -> np.ndarray:
        """Return both ends in a frame, turned about the strip's axis and moved together, smoothly."""
        share = 0.5 - 0.5 * np.cos(np.pi * frame / (frames - 1))
        angle = TURN * share * side
        rest = positions[ends]
        return np.stack(
            [
                rest[:, 0] * (1.0 - CLOSER * share),
                rest[:, 1] * np.cos(angle) - rest[:, 2] * np.sin(angle),
                rest[:, 1] * np.sin(angle) + rest[:, 2] * np.cos(angle),
            ],
            axis=1,
        )

    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=_cloth_energies(cloth),
        dt=1.0 / 30.0,
        frames=frames,
        settle=lambda: positions,
        pin_positions=handles,
    )
