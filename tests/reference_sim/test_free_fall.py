"""Cloth that never comes within the margin of a moving body falls freely, whatever the rule of regions."""

from __future__ import annotations

import numpy as np
import pytest

from reference_sim import Cloth, Obstacle, simulate
from reference_sim.energies import ContactPenalty, Gravity, StretchStVK
from tests.reference_sim.meshes import sphere

FRAMES, MARGIN = 15, 0.004
BODY, BODY_FACES = sphere(3)
TIMES = np.linspace(0.0, 1.0, FRAMES)


def ring() -> tuple[np.ndarray, np.ndarray]:
    """Return a tube of radius 0.19 m, 8 cm high, of 20 x 4 vertices."""
    angle, k = 2 * np.pi * np.arange(20) / 20, np.arange(60)
    circle = 0.19 * np.column_stack([np.cos(angle), 0 * angle, np.sin(angle)])
    after = k // 20 * 20 + (k + 1) % 20
    faces = [np.column_stack([k, k + 20, after]), np.column_stack([after, k + 20, after + 20])]
    rows = [circle + np.array([0.0, height, 0.0]) for height in np.linspace(0.0, 0.08, 4)]
    return np.concatenate(rows), np.concatenate(faces)


def moved(x: np.ndarray, motion: str, t: float) -> np.ndarray:
    """Return the body x (B, 3), 0.3 long, at time t of a motion."""
    if motion == "stretch":
        return x * [1 + 0.3 * t, 1 - 0.4 * t, 1.0]
    if motion == "walk":
        return x + t * np.array([0.5, 0.2, -0.4])
    angle = {"bend": 1.5 * t * x[:, 1] / 0.3, "turn": 2.0 * t, "still": 0.0}[motion] + 0 * x[:, 1]
    c, s, half = np.cos(angle), np.sin(angle), 0.5 if motion == "bend" else 1.0
    upright = x[:, 1] * (0.5 + 0.5 * c if motion == "bend" else c)
    return np.column_stack([x[:, 0] * c - half * x[:, 1] * s, upright + x[:, 0] * s, x[:, 2]])


def case(seed: int) -> tuple[Obstacle, np.ndarray, np.ndarray, np.ndarray]:
    """Return body, rest positions, faces and exact fall (T, V, 3) [m] of a ring made around the body."""
    random = np.random.default_rng(seed)
    scale, region = random.choice([0.3, 1.0, 3.0]), random.choice([0.05, 0.2, 1.0])
    motion = random.choice(["bend", "turn", "walk", "still", "stretch"])
    body = BODY * [0.15, 0.3, 0.15]
    positions = scale * np.stack([moved(body, motion, t) for t in TIMES])
    x, faces = ring()
    rest = scale * (x + np.array([0.0, random.uniform(-0.3, 0.1), 0.0]))
    start = rest + scale * random.normal(size=3) * 0.5 * random.choice([0.0, 1.0])
    k = np.arange(FRAMES)
    fall = start + (k * (k + 1) / 2)[:, None, None] * np.array([0.0, -9.81 / 30**2, 0.0])
    obstacle = Obstacle(positions, BODY_FACES, rest_positions=scale * body, region=region)
    return obstacle, rest, faces, fall


def is_free(obstacle: Obstacle, faces: np.ndarray, fall: np.ndarray) -> bool:
    """Return whether no corner, side or middle of a face comes within the margin."""
    corners = fall[:, faces]
    middles = (corners + np.roll(corners, 1, axis=2)).reshape(FRAMES, -1, 3) / 2
    samples = np.concatenate([fall, middles, corners.mean(axis=2)], axis=1)
    return all(obstacle.signed_distance(samples[t], t).min() > 1.1 * MARGIN for t in range(FRAMES))


FREE = [seed for seed in range(45) if is_free(*(case(seed)[place] for place in (0, 2, 3)))]
assert len(FREE) >= 30


@pytest.mark.parametrize("seed", FREE)
def test_what_never_comes_within_the_margin_falls_freely(seed):
    obstacle, rest, faces, fall = case(seed)
    cloth = Cloth(rest, faces)
    terms = [StretchStVK(cloth), Gravity(cloth), ContactPenalty(cloth, margin=MARGIN)]
    result = simulate(
        cloth, terms, frames=FRAMES, obstacle=obstacle, start=fall[0], tolerance=1e-9
    ).positions
    assert np.abs(result - fall).max() < 1e-6
