"""Long simulations and trainings take no more memory than the results that they keep."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reference_sim import Cloth, Obstacle, simulate
from reference_sim.energies import BendHinge, ContactFriction, ContactPenalty, Gravity, StretchStVK
from snug.training.checkpoint import Checkpoint
from tests.reference_sim.meshes import grid, sphere
from tests.snug.training.dressing import PLAIN, short, swaying

STATUS = Path("/proc/self/status")
needs_proc = pytest.mark.skipif(not STATUS.exists(), reason="memory is read from /proc")
pytestmark = [pytest.mark.slow, needs_proc]
FRAMES, STEPS = 5000, 20_000
LOOP = 120  # frames in which the ball goes round


def own_memory() -> int:
    """Its own memory [kB], files that are mapped left out."""
    (line,) = (line for line in STATUS.read_text().splitlines() if line.startswith("RssAnon"))
    return int(line.split()[1])


def growth(samples: list[tuple[int, int]]) -> tuple[float, float]:
    """Slope and its standard error [bytes] of what is left once everything is loaded and compiled."""
    number, kilobytes = np.array(samples[len(samples) // 10 :], float).T
    (rate, _), covariance = np.polyfit(number, 1024 * kilobytes, 1, cov=True)
    return float(rate), float(np.sqrt(covariance[0, 0]))  # samples taken as independent


def test_a_simulation_of_many_frames_keeps_the_frames_alone():
    """A sheet hung by two corners over a ball that goes round below it, with friction."""
    positions, faces = grid(9, 9, width=0.5, depth=0.5)
    cloth = Cloth(positions + np.array([-0.25, 0.21, -0.25]), faces, pins=[0, 9])
    ball, ball_faces = sphere(2, 0.2)
    angle = 2 * np.pi * np.arange(FRAMES) / LOOP
    way = 0.05 * np.stack([np.cos(angle) - 1, 0 * angle, np.sin(angle)], axis=1)
    contact = ContactPenalty(cloth)
    samples: list[tuple[int, int]] = []

    def handles(frame: int) -> np.ndarray:
        if frame % 100 == 0:
            samples.append((frame, own_memory()))
        return cloth.rest_positions[[0, 9]]

    made = simulate(
        cloth,
        [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), contact, ContactFriction(contact)],
        frames=FRAMES, obstacle=Obstacle(ball + way[:, None], ball_faces), pin_positions=handles,
    )  # fmt: skip
    assert made.frames == FRAMES and made.frame_fields["converged"].mean() > 0.99
    moved = np.abs(made.positions[-1] - made.positions[-1 - LOOP // 2]).max()
    assert moved > 0.01  # it was not at rest
    rate, error = growth(samples)
    kept = 24 * cloth.vertex_count + 3000  # positions; times, counts and energies by name
    assert rate < kept + 3 * error


def test_a_training_of_many_steps_keeps_its_history_alone(tmp_path):
    samples: list[tuple[int, int]] = []
    short(
        motions=[swaying(60)], steps=STEPS, every=400, recipe=replace(PLAIN, batch=4),
        checkpoint=Checkpoint(path=tmp_path / "checkpoint.safetensors", minutes=0.1),
        log=lambda row: samples.append((int(row["step"]), own_memory())),
    )  # fmt: skip
    rate, _ = growth(samples)
    assert rate < 1000  # positions of one frame, kept in each, would be 1800
