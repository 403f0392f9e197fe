"""A square sheet dropped onto a resting sphere: contact without a body."""

from __future__ import annotations

import numpy as np

from benchmarks.scene import BuiltScene, Scene
from benchmarks.scenes.sheet import square_sheet
from benchmarks.validation.meshes import in_space, rectangle
from reference_sim import Cloth, Material, Obstacle
from reference_sim.energies import BendHinge, ContactPenalty, Gravity, StretchStVK

RADIUS = 0.12  # [m]
SIZE = 0.5  # [m]
GAP = 0.02  # [m] between sphere and sheet at the start


def build(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int, family: str = ""
) -> BuiltScene:
    """The built scene; no assets are needed.

    family: of triangles, as `rectangle` has them; such a sheet lies on the sphere and is held at its middle,
    so that it drapes and does not slide off.
    """
    positions, faces = square_sheet(sheet_cells, SIZE)
    gap, pins = GAP, []
    if family:
        flat, faces = rectangle(family, sheet_cells, sheet_cells, SIZE, SIZE)
        positions = in_space(flat - SIZE / 2)[:, [1, 2, 0]]  # faces up
        gap, pins = 0.0, [int(np.argmin(np.linalg.norm(positions, axis=1)))]
    # Off the sphere's axis by a little: centred, it would balance on a symmetry.
    positions += [0.004, RADIUS + gap, 0.002]
    cloth = Cloth(positions, faces, Material(), pins=pins)
    points, triangles = sphere(RADIUS, 24)
    frames = sheet_frames
    obstacle = Obstacle(points, triangles)
    return BuiltScene(
        name=scene.name,
        cloth=cloth,
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactPenalty(cloth)),
        dt=1.0 / 30.0,
        frames=frames,
        settle=lambda: positions,
        obstacle=obstacle,
    )


def sphere(radius: float, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed sphere about the origin: positions (B,3) [m], outward faces (Fb,3).

    A cube of `cells` x `cells` squares a side, pushed out to the radius; tan evens the squares out.
    """
    ticks = np.tan(np.linspace(-np.pi / 4, np.pi / 4, cells + 1))
    u, v = np.meshgrid(ticks, ticks, indexing="ij")
    one = np.ones_like(u)
    sides = [np.roll(np.stack([one * s, u, v * s], -1), k, axis=-1) for k in range(3) for s in (-1.0, 1.0)]
    points = np.concatenate([side.reshape(-1, 3) for side in sides])
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    b, c, d = a + cells + 1, a + cells + 2, a + 1
    square = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    faces = np.concatenate([square + k * (cells + 1) ** 2 for k in range(6)])
    # Points on the cube's edges were made once for each side: keep one of each.
    _, first, inverse = np.unique(np.round(points, 12) + 0.0, axis=0, return_index=True, return_inverse=True)
    points, faces = points[first], inverse.ravel()[faces]
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True), faces
