"""Backward Euler as a sequence of minimisations.

    x_{t+1} = argmin  1/(2 dt^2) (x - x_hat)^T M (x - x_hat) + Phi(x),   x_hat = x_t + dt v_t

(SNUG, eq. 4; Martin et al. 2011; Gast et al. 2015). The velocity of the next step is (x_{t+1} - x_t) / dt.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .cloth import Cloth
from .energies.energy import Energy, Step
from .minimise import Newton, Result
from .potential import Potential
from .trajectory import Trajectory, TrajectoryWriter

if TYPE_CHECKING:
    from .obstacle import Obstacle

GUESSES = ("previous", "extrapolated", "carried")
MAX_APPROACHES = 30  # minimisations on the way of an obstacle within one step


def simulate(
    cloth: Cloth,
    energies: Sequence[Energy],
    *,
    dt: float = 1 / 30,
    frames: int = 60,
    obstacle: Obstacle | None = None,
    start: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    pin_positions: Callable[[int], np.ndarray] | None = None,
    guess: str | None = None,
    quasi_static: bool = False,
    path: str | Path | None = None,
    progress: str | None = None,
    **options: float,
) -> Trajectory:
    """Simulate `frames` frames, the start included.

    Args:
        cloth: the rest state; its pins stay where `start` has them unless pin_positions moves them.
        energies: the terms of Phi. Inertia is added here; no other term is.
        dt: time step [s].
        frames: number of frames T in the result.
        obstacle: the moving body, one mesh per frame; terms of contact read it.
        start: (V, 3) [m] at frame 0; default the rest positions.
        velocity: (V, 3) [m/s] at frame 0; default zero.
        pin_positions: frame -> (P, 3) [m], for handles that move.
        guess: initial guess of a step: "previous", "extrapolated" (x + dt v), or "carried" by the obstacle's
            nearest faces (default where there is an obstacle; else "extrapolated").
        quasi_static: forget the velocity at every frame; for settling.
        path: write the VTKHDF file there, frame by frame.
        progress: label of a progress bar with time left; None for silence.
        options: of the minimiser (tolerance, max_iterations, timeout).

    Returns:
        A Trajectory whose status is "converged" if every frame converged, else the first other status; a
        frame that is not finite ends it. frame_fields: iterations, factorisations, gradient_norm (mean vertex
        weights), converged (0/1), energy/<term> [J].

    Raises:
        ValueError: unknown guess, wrong shapes, fewer than 1 frame.
    """
    loop = _Loop(cloth, energies, dt, obstacle, guess, quasi_static, options)
    x = _checked(start, cloth.rest_positions, "start")
    v = _checked(velocity, np.zeros_like(cloth.rest_positions), "velocity")
    if frames < 1:
        raise ValueError(f"simulate: frames = {frames}: must be at least 1")
    provenance = loop.provenance()
    recorded: dict[str, list[Any]] = {"x": [x], "t": [0.0], "s": [0.0], "fields": [loop.first_fields(x)]}
    status, reason = "converged", ""
    writer = (
        TrajectoryWriter(path, cloth.faces, provenance, vertex_count=cloth.vertex_count)
        if path
        else nullcontext()
    )
    with writer as file:
        if file:
            file.append(x, 0.0, 0.0, recorded["fields"][0])
        for frame in _bar(range(1, frames), progress):
            clock = time.perf_counter()
            result = loop.step(frame, x, v, None if pin_positions is None else pin_positions(frame))
            seconds = time.perf_counter() - clock
            if result.status != "converged" and status == "converged":
                status, reason = result.status, f"frame {frame}: {result.reason}"
            if not np.isfinite(result.positions).all() or result.status == "diverged":
                break
            v = np.zeros_like(x) if quasi_static else (result.positions - x) / dt
            x = result.positions
            fields = _fields(result)
            for key, value in (("x", x), ("t", frame * dt), ("s", seconds), ("fields", fields)):
                recorded[key].append(value)
            if file:
                file.append(x, frame * dt, seconds, fields)
        if file:
            file.finish(status, reason)
    return Trajectory(
        positions=np.array(recorded["x"]),
        faces=cloth.faces,
        times=np.array(recorded["t"]),
        frame_seconds=np.array(recorded["s"]),
        status=status,
        reason=reason,
        provenance=provenance,
        frame_fields={k: np.array([f[k] for f in recorded["fields"]]) for k in recorded["fields"][0]},
    )


class _Loop:
    """What stays the same from frame to frame: the potential, its minimiser, the rule for a first guess."""

    def __init__(
        self,
        cloth: Cloth,
        energies: Sequence[Energy],
        dt: float,
        obstacle: Obstacle | None,
        guess: str | None,
        quasi_static: bool,
        options: dict[str, float],
    ) -> None:
        from .energies.inertia import Inertia

        if guess is None:
            guess = "extrapolated" if obstacle is None else "carried"
        if guess not in GUESSES or (guess == "carried" and obstacle is None):
            raise ValueError(f"simulate: guess {guess!r}: choose one of {', '.join(GUESSES)}; carried needs a body")
        self.cloth, self.dt, self.obstacle, self.guess = cloth, dt, obstacle, guess
        self.quasi_static, self.options = quasi_static, options
        self.potential = Potential([*energies, Inertia(cloth, dt)])
        self.newton = Newton(self.potential, **options)
        self._started = False

    def step(self, frame: int, x: np.ndarray, v: np.ndarray, pins: np.ndarray | None) -> Result:
        """One backward-Euler step from x (V, 3) with velocity v (V, 3)."""
        if self.guess == "carried":
            assert self.obstacle is not None
            first = self.obstacle.carried(x, frame, self.cloth.rest_positions)
        else:
            first = x + self.dt * v if self.guess == "extrapolated" else x.copy()
        first[self.cloth.pins] = x[self.cloth.pins] if pins is None else pins
        self.potential.prepare(Step(x, v, first, self.dt, self.obstacle, frame))
        return self._reach(x, first)

    def _reach(self, x: np.ndarray, guess: np.ndarray) -> Result:
        """Minimise from `guess`, or from as near to it as terms that nothing may pass through let x come.

        With such a term (a barrier) x, pins and obstacle walk together from the start of the step to the
        guess until something would touch; a rough minimisation there makes room, and they walk on. Where
        standing still takes the obstacle further, free vertices do that. So the last minimisation starts
        without an intersection, pins and obstacle at the end of their way. Without such a term it starts at
        the guess.

        Raises:
            ValueError: the very first x is impossible already.
        """
        potential, pins = self.potential, self.cloth.pins
        if not self._started:
            potential.set_progress(0.0)
            if objection := potential.objection(x):
                raise ValueError(f"simulate: the start is not free of intersections: {objection}")
            self._started = True
        motion, goal, progress = guess - x, guess, 0.0
        for _ in range(MAX_APPROACHES):
            share = potential.clear_way(x, goal, progress)
            if share < 1:
                held = x.copy()
                held[pins] = guess[pins]
                held_share = potential.clear_way(x, held, progress)
                share, goal = max((share, goal), (held_share, held), key=lambda pair: pair[0])
            progress = 1.0 if share == 1 else progress + share * (1 - progress)
            potential.set_progress(progress)
            if share == 1:
                return self.newton.minimise(goal)
            x = self.rough.minimise(x + share * (goal - x)).positions
            goal = x + (1 - progress) * motion
            goal[pins] = guess[pins]
        result = self.newton.minimise(x)
        if result.status == "diverged":
            return result
        reason = f"no way without intersection: pins and obstacle came {progress:.1%} of theirs"
        return replace(result, status="stalled", reason=reason)

    @cached_property
    def rough(self) -> Newton:
        """What makes room half-way: a few iterations."""
        options: dict[str, Any] = self.options | {"max_iterations": 8, "tolerance": 1e-2}
        return Newton(self.potential, **options)

    def first_fields(self, x: np.ndarray) -> dict[str, float]:
        """The fields of frame 0, which nobody minimised."""
        names = [energy.name for energy in self.potential.energies]
        fields = dict.fromkeys([f"energy/{name}" for name in names], float("nan"))
        return {"iterations": 0.0, "factorisations": 0.0, "gradient_norm": float("nan"), "converged": 1.0} | fields

    def provenance(self) -> dict[str, Any]:
        return {
            "method": "backward Euler, Newton",
            "dt_s": self.dt,
            "guess": self.guess,
            "quasi_static": self.quasi_static,
            "options": self.options,
            "terms": {energy.name: energy.parameters() for energy in self.potential.energies},
        }


def _fields(result: Result) -> dict[str, float]:
    return {
        "iterations": float(result.iterations),
        "factorisations": float(result.factorisations),
        "gradient_norm": result.gradient_norm,
        "converged": float(result.status == "converged"),
    } | {f"energy/{name}": value for name, value in result.terms.items()}


def _checked(value: np.ndarray | None, default: np.ndarray, name: str) -> np.ndarray:
    if value is None:
        return default.copy()
    value = np.array(value, dtype=np.float64)
    if value.shape != default.shape or not np.isfinite(value).all():
        raise ValueError(f"simulate: {name} has shape {value.shape}: expected finite {default.shape}")
    return value


def _bar(frames: range, label: str | None) -> Iterator[int] | range:
    if label is None:
        return frames
    from tqdm import tqdm

    return tqdm(frames, desc=label, unit="frame")
