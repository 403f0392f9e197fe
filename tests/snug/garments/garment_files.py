"""Garments as other programs write them: OBJ files with seams, other units and axes, faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reference_sim.trajectory import write_obj


def z_up(positions):
    """From y up to z up, facing -y, as Blender has it."""
    x, y, z = np.asarray(positions).T
    return np.stack([x, -z, y], axis=1)


def own_chart(positions, faces):
    """Every triangle flattened by itself, at a place, turn and side of its own: (F, 3, 2), isometric."""
    corners = np.asarray(positions)[np.asarray(faces)]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(first, axis=1)
    along = (first * second).sum(1) / length
    across = np.sqrt(np.maximum((second**2).sum(1) - along**2, 0.0))
    across[::2] *= -1  # mirrored, as half of a pattern often is
    plane = np.stack([0j * length, length, along + 1j * across], axis=1)
    angle, u, v = np.random.default_rng(0).uniform(size=(3, len(corners), 1))
    plane = plane * np.exp(2j * np.pi * angle) + u + 1j * v
    return np.stack([plane.real, plane.imag], axis=-1)


def doubled_along(positions, faces, cut):
    """The mesh with the vertices `cut` twice, as a program writes a seam whose vertices have one UV each.

    Faces whose centre lies at x < 0 take the copies.
    """
    positions, faces = np.asarray(positions), np.asarray(faces).copy()
    copy = np.arange(len(positions))
    copy[cut] = len(positions) + np.arange(len(cut))
    left = positions[faces].mean(axis=1)[:, 0] < 0
    faces[left] = copy[faces[left]]
    return np.concatenate([positions, positions[cut]]), faces


def saved(tmp_path, garment, *, positions=None, faces=None, uv=None, name="mine.obj") -> Path:
    positions = garment.rest_positions if positions is None else positions
    write_obj(tmp_path / name, positions, garment.faces if faces is None else faces, uv)
    return tmp_path / name
