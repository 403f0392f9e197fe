"""Sheets for tests of the barrier, and whether edges cut faces, asked with determinants of its own."""

from __future__ import annotations

import numpy as np

from reference_sim import Cloth, Material, Obstacle, Trajectory
from reference_sim.energies import Step
from tests.reference_sim.meshes import grid

DT = 1 / 60


def cuts(x: np.ndarray, edges: np.ndarray, y: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(E, F): whether edge e of points x passes through face f of points y; shared vertices are no cut."""
    a, b = x[edges[:, 0]][:, None], x[edges[:, 1]][:, None]
    p, q, r = (y[faces[:, i]][None] for i in range(3))

    def volume(u, v, w, t):
        return np.einsum("efi,efi->ef", u - t, np.cross(v - t, w - t))

    sides = volume(a, p, q, r) * volume(b, p, q, r) < 0
    turns = np.sign([volume(a, p, q, b), volume(a, q, r, b), volume(a, r, p, b)])
    crossings = sides & (np.abs(turns.sum(axis=0)) == 3)
    if x is y:
        crossings &= ~(edges[:, None, :, None] == faces[None, :, None, :]).any(axis=(2, 3))
    return crossings


def mesh_edges(faces: np.ndarray) -> np.ndarray:
    return np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)


def assert_free(trajectory: Trajectory, cloth: Cloth, obstacle: Obstacle | None) -> None:
    """No edge cuts a face in any frame."""
    for frame, x in enumerate(trajectory.positions):
        assert not cuts(x, cloth.edges, x, cloth.faces).any(), f"frame {frame}: cloth through cloth"
        if obstacle is not None:
            y = obstacle.at(frame)
            assert not cuts(x, cloth.edges, y, obstacle.faces).any(), f"frame {frame}: cloth edge"
            assert not cuts(y, mesh_edges(obstacle.faces), x, cloth.faces).any(), f"frame {frame}: body edge"


def sheet(cells: int, size: float, place: tuple[float, float, float], *, pins=()) -> Cloth:
    """A horizontal sheet whose lowest corner is at place."""
    x, faces = grid(cells, cells, width=size, depth=size)
    return Cloth(x + place, faces, Material(), pins=pins)


def still(x: np.ndarray, obstacle: Obstacle | None = None, *, dt: float = DT) -> Step:
    return Step(x, np.zeros_like(x), x, dt, obstacle, 1)


def folded(cells: int) -> tuple[Cloth, np.ndarray]:
    """A strip whose right half lies 16 mm above its left half, bent round a cylinder between them."""
    x, faces = grid(2 * cells, cells, width=0.16, depth=0.08)
    s, radius = x[:, 0] - 0.08, 0.008
    phi = np.clip(s / radius, 0, np.pi)
    along = np.where(s < 0, s, radius * np.sin(phi) - np.maximum(s - np.pi * radius, 0))
    return Cloth(x, faces, Material()), np.stack([along, 3e-3 + radius * (1 - np.cos(phi)), x[:, 2]], 1)
