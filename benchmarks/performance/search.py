"""Microbenchmark search/*: closest faces of a moving body, as every frame of every solver searches them.

The samples are those of a T-shirt in frames of early-stopped L-BFGS, each searched from the answers of the
frame before. Every search is done anew in each repeat, the body's pose included.
"""

from __future__ import annotations

import time

import numpy as np

from benchmarks.performance.garment import dressed
from benchmarks.performance.microbenchmark import Settings
from reference_sim.contact.closest_point import FaceSearch
from reference_sim.contact.closest_point_lanes import Listed
from reference_sim.energies.contact_penalty.definition import ContactPenalty
from reference_sim.minimise.compiled.minimiser import CompiledLBFGS
from reference_sim.time_loop import simulate

ITERATIONS = 10  # of L-BFGS a frame


def measure(settings: Settings, *, motion: str, vertices: int, frames: int) -> dict[str, float]:
    """Return the time of a search, median and worst over frames, each the least of the repeats."""
    scene = dressed(motion, vertices)
    body = scene.obstacle
    assert body is not None and body.rest_centroids is not None
    contact = next(term for term in scene.energies if isinstance(term, ContactPenalty))
    roll_out = simulate(
        scene.cloth, scene.energies, dt=scene.dt, frames=frames, obstacle=body, start=scene.start,
        method=CompiledLBFGS, max_iterations=ITERATIONS,
    )  # fmt: skip
    samples = [contact.sample_matrix @ x for x in roll_out.positions]
    search = FaceSearch(body.faces, body.rest_centroids)
    listed = search.listed(contact.rest_samples, body.region)
    seconds = np.array([_searched(search, listed, body.positions, samples) for _ in range(settings.repeats)])
    least = 1e3 * seconds.min(axis=0)
    return {
        "vertices": scene.cloth.vertex_count,
        "samples": len(samples[0]),
        "search": float(np.median(least)),
        "search_worst": float(least.max()),
    }


def _searched(search: FaceSearch, listed: Listed, body: np.ndarray, samples: list[np.ndarray]) -> list[float]:
    """Return the seconds of each search but the first, of samples (S, 3) [m] over a body (T, B, 3) [m]."""
    hints, seconds = None, []
    for positions, points in zip(body, samples):
        clock = time.perf_counter()
        search.refit(positions)
        hints = search.nearest(points, hints=hints, samples=listed).faces
        seconds.append(time.perf_counter() - clock)
    return seconds[1:]
