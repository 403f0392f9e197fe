"""What is saved by leaving out what a scene does not need: the same frames with and without it.

The term that is put in changes nothing of the answer but round-off: a body 5 m away, hinges of a membrane
that stays flat, inertia of an infinite time step. Both sides run in turns: a busy machine slows both down.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

from benchmarks.meshes import square_sheet
from benchmarks.performance.microbenchmark import Settings
from reference_sim import Cloth, Material, Potential, simulate
from reference_sim.energies import Energy, Gravity, StretchStVK
from reference_sim.minimise.methods import minimise

CELLS, FRAMES = 14, 20
STATIC = 1e6  # [s]: inertia of such a step is below round-off

Run = Callable[[], object]


def measure(settings: Settings, *, what: str) -> dict[str, float]:
    """Seconds with and without, minima over repeats, and their ratio."""
    without, with_it = {"body": _body, "hinges": _hinges, "inertia": _inertia, "networks": _networks}[what]()
    without(), with_it()  # compile, load
    pairs = [[_timed(run) for run in (without, with_it)] for _ in range(settings.repeats)]
    seconds = np.array(pairs).min(axis=0)
    return {
        "without": 1e3 * float(seconds[0]),
        "with": 1e3 * float(seconds[1]),
        "saved": 100.0 * float(1.0 - seconds[0] / seconds[1]),
    }


def _timed(run: Run) -> float:
    clock = time.perf_counter()
    run()
    return time.perf_counter() - clock


def _sheet() -> Cloth:
    positions, faces = square_sheet(CELLS, 0.4)
    positions[:, 1] += 0.01 * positions[:, 0]
    return Cloth(positions, faces, Material(), pins=(0, CELLS))


def _body() -> tuple[Run, Run]:
    from benchmarks.meshes import sphere
    from reference_sim import Obstacle
    from reference_sim.energies import ContactPenalty

    cloth, (points, faces) = _sheet(), sphere(0.1, 24)
    far = Obstacle(points + np.array([5.0, 0.0, 0.0]), faces)
    terms: list[Energy] = [StretchStVK(cloth), Gravity(cloth)]
    return (
        lambda: simulate(cloth, terms, frames=FRAMES),
        lambda: simulate(
            cloth, [*terms, ContactPenalty(cloth)], frames=FRAMES, obstacle=far, guess="extrapolated"
        ),
    )


def _hinges() -> tuple[Run, Run]:
    from reference_sim.energies import BendHinge

    flat, faces = square_sheet(CELLS, 0.4)
    rim = np.flatnonzero(np.abs(flat[:, [0, 2]]).max(axis=1) > 0.2 - 1e-9)
    cloth = Cloth(flat, faces, Material(), pins=rim)
    start = 1.1 * flat  # a membrane stretched in its plane, set swinging in it
    velocity = np.where(cloth.free[:, None], 0.3 * np.sin(9.0 * flat[:, [2, 1, 0]]) * [1, 0, 1], 0.0)
    terms: list[Energy] = [StretchStVK(cloth)]
    return (
        lambda: simulate(cloth, terms, frames=FRAMES, start=start, velocity=velocity),
        lambda: simulate(cloth, [*terms, BendHinge(cloth)], frames=FRAMES, start=start, velocity=velocity),
    )


def _inertia() -> tuple[Run, Run]:
    from reference_sim.energies import Inertia

    cloth = _sheet()
    start = 1.02 * cloth.rest_positions
    terms: list[Energy] = [StretchStVK(cloth), Gravity(cloth)]
    return (
        lambda: minimise(Potential(terms), start),
        lambda: minimise(Potential([*terms, Inertia(cloth, STATIC)]), start),
    )


def _networks() -> tuple[Run, Run]:
    """A process that can simulate, and one that has loaded the networks' library too."""

    def process(imports: str) -> Run:
        return lambda: subprocess.run([sys.executable, "-c", imports], check=True)

    physics = "from reference_sim.energies import StretchStVK; from reference_sim import simulate"
    return process(physics), process(f"{physics}; import torch.nn")
