"""Garments as other programs write them: OBJ files with seams, other units and axes, faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def write_obj(path: Path, positions, faces, uv=None) -> Path:
    """uv: (F, 3, 2) of corners; equal ones are written once, as programs do."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(positions).tolist()]
    names = [[f"{v + 1}" for v in face] for face in np.asarray(faces).tolist()]
    if uv is not None:
        known: dict[tuple[float, float], int] = {}
        for name, corners in zip(names, np.asarray(uv).tolist()):
            for k, corner in enumerate(corners):
                name[k] += f"/{known.setdefault(tuple(corner), len(known) + 1)}"
        lines += [f"vt {u!r} {v!r}" for u, v in known]
    path.write_text("\n".join([*lines, *("f " + " ".join(name) for name in names)]) + "\n")
    return path


def z_up(positions):
    """From y up to z up, facing -y, as Blender has it."""
    x, y, z = np.asarray(positions).T
    return np.stack([x, -z, y], axis=1)


def own_chart(positions, faces, gap: float = 1.0):
    """Every triangle flattened by itself, at a place, turn and side of its own: (F, 3, 2), isometric."""
    corners = np.asarray(positions)[np.asarray(faces)]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(first, axis=1)
    along = (first * second).sum(1) / length
    across = np.sqrt(np.maximum((second**2).sum(1) - along**2, 0.0))
    chart = np.zeros((len(corners), 3, 2))
    chart[:, 1, 0], chart[:, 2, 0], chart[:, 2, 1] = length, along, across
    random = np.random.default_rng(0)
    chart[::2, :, 1] *= -1  # mirrored, as half of a pattern often is
    angle = random.uniform(0, 2 * np.pi, len(corners))
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1).reshape(
        -1, 2, 2
    )
    return chart @ turn.transpose(0, 2, 1) + gap * random.uniform(0, 1, (len(corners), 1, 2))


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


def saved(tmp_path, garment, *, positions=None, faces=None, uv=None, name="mine.obj"):
    positions = garment.rest_positions if positions is None else positions
    return write_obj(tmp_path / name, positions, garment.faces if faces is None else faces, uv)
