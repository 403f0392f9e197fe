"""Cost of a Newton iteration, and memory, against the size of the sheet."""

from __future__ import annotations

import numpy as np

from ..parts import Row
from .sheet import Fall, regular_sheet

CASES = ("32 x 32", "64 x 64", "128 x 128", "256 x 256")
FRAMES = 4


def measure(case: str, repeats: int) -> list[Row]:
    """Seconds an iteration over the first frames of the fall, in all and per vertex."""
    cloth = regular_sheet(int(case.split()[0]))
    Fall(regular_sheet(4)).step()  # compiles
    costs = []
    for _ in range(min(repeats, 3) if cloth.vertex_count > 20_000 else repeats):
        fall = Fall(cloth)
        frames = [fall.step() for _ in range(FRAMES)]
        costs.append(sum(s for _, s in frames) / sum(r.iterations for r, _ in frames))
    per_iteration = float(np.median(costs))
    return [
        ("vertices", cloth.vertex_count, ""),
        ("iteration", 1e3 * per_iteration, "ms"),
        ("iteration per vertex", 1e6 * per_iteration / cloth.vertex_count, "us"),
    ]
