"""Scene of a square sheet dropped onto a resting sphere: contact without a body."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import in_space, rectangle, sphere, square_sheet
from benchmarks.scene import BuiltScene, Scene
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.material import Material
from reference_sim.obstacle import Obstacle

RADIUS = 0.12  # [m]
SIZE = 0.5  # [m]
GAP = 0.02  # [m] between sphere and sheet at the start


def build(
    scene: Scene, assets: object = None, *, sheet_cells: int, sheet_frames: int, family: str = ""
) -> BuiltScene:
    """Build the scene; no assets are needed.

    family: of triangles, as `rectangle` has them; such a sheet lies on the sphere and is held at its middle,
    so that it drapes and does not slide off.
    """
    if family:
        flat, faces = rectangle(family, sheet_cells, sheet_cells, SIZE, SIZE)
        positions = in_space(flat - SIZE / 2)[:, [1, 2, 0]]  # faces up
        gap, pins = 0.0, [int(np.argmin(np.linalg.norm(positions, axis=1)))]
    else:
        positions, faces = square_sheet(sheet_cells, SIZE)
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
        energies=(StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), ContactPenalty(cloth)),
        dt=1.0 / 30.0,
        frames=frames,
        settle=lambda: positions,
        obstacle=obstacle,
    )
