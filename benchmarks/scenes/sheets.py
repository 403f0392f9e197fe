"""Scenes of a sheet without a body: hanging, on a sphere, a flag, free fall. No assets are needed.

In free fall backward Euler's own discrete answer is exact,

    x_n = x_0 + n dt v_0 + g dt^2 n (n+1)/2

The parabola of the continuous problem is not the answer: at 30 frames per second it is 0.16 m away after
one second. With weight alone every vertex moves alike, so strain and bending are not declared.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.meshes import sphere, square_sheet
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.gravity import Gravity
from reference_sim.material import GRAVITY, Material

DT = 1.0 / 30.0  # [s]
SIZE = 0.4  # [m]
VELOCITY = np.array([0.7, 2.0, -0.3])  # [m/s] of the fall
SWING, PERIOD = 0.15, 1.0  # [m] to either side, [s] of the flag's pole
# [m] of the sphere, of the sheet on it, between both at the start.
RADIUS, DRAPED_SIZE, GAP = 0.12, 0.5, 0.02


def _built(scene: Scene, cloth: Cloth, frames: int, start: np.ndarray, **fields: Any) -> BuiltScene:
    """Return the scene of strain, bending and weight, without `energies`, with further fields."""
    if "energies" not in fields:
        from reference_sim.energies.bend_hinge import BendHinge  # a scene without it does not load it
        from reference_sim.energies.stretch_stvk import StretchStVK

        fields["energies"] = (StretchStVK(cloth), BendHinge(cloth), Gravity(cloth))
    return BuiltScene(name=scene.name, cloth=cloth, dt=DT, frames=frames, settle=lambda: start, **fields)


def build_free_fall(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int
) -> BuiltScene:
    """Build the scene of a thrown sheet, with its exact answer."""
    positions, faces = square_sheet(sheet_cells, SIZE)
    cloth = Cloth(positions, faces, Material())
    start = np.stack([positions, np.broadcast_to(VELOCITY, positions.shape)])
    exact = exact_fall(positions, VELOCITY, DT, sheet_frames)
    return _built(scene, cloth, sheet_frames, start, energies=(Gravity(cloth),), exact=exact)


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


def build_hanging_sheet(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int
) -> BuiltScene:
    """Build the scene of a square sheet pinned at two corners and let go from the horizontal."""
    positions, faces = square_sheet(sheet_cells, SIZE)
    # Tilted by half a degree: a flat sheet hanging flat is a saddle, where symmetry alone would choose.
    positions[:, 1] += 0.01 * positions[:, 0]
    cloth = Cloth(positions, faces, Material(), pins=(0, sheet_cells))
    return _built(scene, cloth, sheet_frames, cloth.rest_positions)


def build_flag(scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int) -> BuiltScene:
    """Build the scene of a flag whose pole is swung to and fro: its pinned edge alone moves it."""
    flat, faces = square_sheet(sheet_cells, SIZE)
    # Upright, in the plane of x and y.
    positions = np.stack([flat[:, 0], -flat[:, 2], flat[:, 1]], axis=1)
    pole = np.arange(sheet_cells + 1)  # the edge at the smallest x
    cloth = Cloth(positions, faces, Material(), pins=pole)

    def handles(frame: int) -> np.ndarray:
        """Return the pole in a frame, (P,3) [m]: it starts from rest, so that nothing jolts."""
        phase = 2.0 * np.pi * frame * DT / PERIOD
        swing = SWING * np.sin(phase) * (1.0 - np.cos(min(phase, np.pi))) / 2.0
        return positions[pole] + [0.0, 0.0, swing]

    return _built(scene, cloth, sheet_frames, positions, pin_positions=handles)


def build_sheet_on_sphere(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int
) -> BuiltScene:
    """Build the scene of a square sheet dropped onto a resting sphere: contact without a body."""
    from reference_sim.energies.contact_penalty import ContactPenalty
    from reference_sim.obstacle import Obstacle

    positions, faces = square_sheet(sheet_cells, DRAPED_SIZE)
    # Off the sphere's axis by a little: centred, it would balance on a symmetry.
    positions += [0.004, RADIUS + GAP, 0.002]
    cloth = Cloth(positions, faces, Material())
    built = _built(scene, cloth, sheet_frames, positions, obstacle=Obstacle(*sphere(RADIUS, 24)))
    return replace(built, energies=(*built.energies, ContactPenalty(cloth)))
