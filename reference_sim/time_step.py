"""One frame of backward Euler: first guess, frozen terms, minimisation, and the state left to the next."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reference_sim.cloth import Cloth
from reference_sim.energies.energy import Energy, Step
from reference_sim.energies.inertia import Inertia
from reference_sim.fingerprint import fingerprint
from reference_sim.minimise.minimisers import Minimiser, Restartable, make_minimiser
from reference_sim.minimise.result import Result, severity
from reference_sim.potential import Potential
from reference_sim.trajectory.resume import PartialRun
from reference_sim.trajectory.trajectory import TrajectoryError

if TYPE_CHECKING:
    from reference_sim.obstacle import Obstacle

LEAST_DT, MOST_DT = 1e-7, 1e4  # [s] of a step: beyond, one of its terms is lost in the round-off of the other
GUESSES = ("previous", "extrapolated", "body_transported")
# First guess (V, 3) [m] of the end of a step, from its number, 1 for the first, and its start (V, 3) [m]. The
# first step is asked for again where a start is checked, and the last one when a run is resumed.
FirstGuess = Callable[[int, np.ndarray], np.ndarray]
MAX_APPROACHES = 100  # minimisations on the way of an obstacle within one step
LEAST_APPROACH = 2e-3  # of that way, by three of them together; less is no way
# Minimiser of a step whose terms join late, as L-BFGS ends by it too, and options that it shares.
ENDING = {"method": "newton", "reuse": True, "start_projected": True}
LIMITS = ("tolerance", "max_iterations", "timeout")
APPROACH_SHARE = 0.8  # of the way to the next touch: closer, a barrier grows stiff


@dataclass(frozen=True, eq=False)
class State:
    """Positions and velocity between two frames.

    Attributes:
        x: (V, 3) [m].
        v: (V, 3) [m/s].
        before: (2, V, 3) both one step earlier, where a resumed run needs them stored.
    """

    x: np.ndarray
    v: np.ndarray
    before: np.ndarray | None = None


class TimeStepper:
    """Backward Euler from frame to frame: the potential, its minimiser, the rule for a first guess.

    All that many runs of one scene can share is set up here; `start_again` stands between two of them.

    Args:
        cloth: the rest state.
        energies: the terms of Phi; inertia is added.
        dt: time between frames [s].
        substeps: steps per frame.
        obstacle: the moving body, one mesh per frame.
        guess: one of GUESSES or a function, see `simulate`.
        quasi_static: whether the velocity is set to zero after every step, sub-steps included.
        refreeze: times that what a step freezes is searched again at its end, and the step solved again. A
            step in which a barrier stopped the obstacle is not.
        options: of the minimiser, see `simulate`.

    Raises:
        ValueError: unknown guess, fewer than 1 sub-step, a step of no size, a negative refreeze, a tolerance
            that is no number above 0, or a function as method beside a term that joins late.
    """

    def __init__(
        self,
        cloth: Cloth,
        energies: Sequence[Energy],
        *,
        dt: float,
        substeps: int = 1,
        obstacle: Obstacle | None = None,
        guess: str | FirstGuess | None = None,
        quasi_static: bool = False,
        refreeze: int = 0,
        **options: Any,
    ) -> None:
        if substeps < 1:
            raise ValueError(f"simulate: substeps = {substeps}: must be at least 1")
        if 0 < (step := dt / substeps) < LEAST_DT or MOST_DT < step < float("inf"):
            raise ValueError(f"simulate: dt / substeps = {step:.3g} s: give {LEAST_DT:g} to {MOST_DT:g} s")
        if guess is None:
            guess = "extrapolated" if obstacle is None else "body_transported"
        if not callable(guess) and (
            guess not in GUESSES or (guess == "body_transported" and obstacle is None)
        ):
            raise ValueError(
                f"simulate: guess {guess!r}: choose one of {', '.join(GUESSES)}, or give a function;"
                " body_transported needs an obstacle"
            )
        if refreeze < 0:
            raise ValueError(f"simulate: refreeze = {refreeze}: must not be negative")
        self.cloth, self.guess, self.substeps, self.refreeze = cloth, guess, substeps, refreeze
        self.frame_dt, self.dt = dt, dt / substeps  # between frames, and of one step
        self.obstacle = obstacle if obstacle is None or substeps == 1 else obstacle.refined(substeps)
        self.potential = Potential([*energies, Inertia(cloth, self.dt)])
        # The preconditioner of L-BFGS knows nothing of pairs that come and go.
        method = "newton" if any(energy.dynamic for energy in energies) else "lbfgs"
        self.quasi_static, self.options = quasi_static, {"method": method} | options
        self.late = [energy for energy in energies if energy.joins_late]
        early = Potential([energy for energy in self.potential.energies if not energy.joins_late])
        self.body_may_stop, self.obstacle_stopped = obstacle is not None and early.impassable, False
        self.opening: Minimiser | None = None
        self.ending = self.options
        if self.late and not early.impassable:
            if callable(self.options["method"]):
                raise ValueError(
                    f"simulate: Newton's method, not a function, ends steps that {self.late[0].name!r} joins:"
                    " choose method 'lbfgs' or 'newton', or leave the term out"
                )
            self.opening_method: str = options.get("method", "lbfgs")
            self.opening = make_minimiser(early, **options | {"method": self.opening_method})
            self.ending = ENDING | {name: options[name] for name in LIMITS if name in options}
        self.minimiser = make_minimiser(self.potential, **self.ending)

    def start_again(self) -> None:
        """Let the next run give the bits of a first one: minimisers forget what they have learned.

        A minimiser without `start_again` is made anew.
        """
        self.__dict__.pop("rough_minimiser", None)
        if isinstance(self.opening, Restartable):
            self.opening.start_again()
        if isinstance(self.minimiser, Restartable):
            self.minimiser.start_again()
        else:
            self.minimiser = make_minimiser(self.potential, **self.ending)

    def check_start(self, x: np.ndarray, v: np.ndarray) -> None:
        """Raise ValueError where x (V, 3) [m] at frame 0 is impossible for a term that nothing may pass."""
        if self.potential.impassable:
            self.prepare(1, x, v, x[self.cloth.pins])
            self.potential.set_progress(0.0)
            if infeasibility := self.potential.infeasibility(x):
                raise ValueError(f"simulate: the start is not free of intersections: {infeasibility}")

    def advance(self, frame: int, state: State, pins: np.ndarray | None) -> tuple[State | None, list[Result]]:
        """Take the sub-steps to `frame`, with pins (P, 3) [m] at its end.

        Returns:
            The state at the frame, None if a sub-step diverged, and the result of each minimisation, without
            those that only bring a barrier nearer.

        Raises:
            ValueError: pins of another shape, or not finite.
        """
        x, v, results = state.x, state.v, []
        if pins is not None:
            pins, shape = np.asarray(pins, dtype=np.float64), (len(self.cloth.pins), 3)
            if pins.shape != shape or not np.isfinite(pins).all():
                what = f"simulate: pin_positions({frame}) gives {pins.shape}"
                raise ValueError(f"{what}: finite positions {shape} [m] are due")
        for j in range(1, self.substeps + 1):
            share = j / self.substeps
            handles = state.x[self.cloth.pins]
            if pins is not None:
                handles = (1 - share) * handles + share * pins
            step = (frame - 1) * self.substeps + j
            guess = self.prepare(step, x, v, handles)
            self.obstacle_stopped = False
            if not np.isfinite(guess).all():
                results.append(self.minimiser.minimise(guess))  # it reports the divergence
            else:
                results.append(self.open(x, guess) if self.opening else self.reach(x, guess))
            for _ in range(self.refreeze):
                # To freeze the step again would put an obstacle that stopped on its way at the end of it.
                if self.obstacle_stopped or not np.isfinite(results[-1].positions).all():
                    break
                self.freeze(step, x, v, results[-1].positions)
                results.append(self.minimiser.minimise(results[-1].positions))
            y = results[-1].positions
            if results[-1].status == "diverged" or not np.isfinite(y).all():
                return None, results
            before = np.stack([x, v])
            x, v = y, self.velocity(y, x)
        return State(x, v, before if self.substeps > 1 else None), results

    def velocity(self, x: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the velocity (V, 3) [m/s] that a step from `before` to x (V, 3) [m] ends with."""
        return np.zeros_like(x) if self.quasi_static else (x - before) / self.dt

    def prepare(self, step: int, x: np.ndarray, v: np.ndarray, handles: np.ndarray) -> np.ndarray:
        """Freeze every term for the step from x with velocity v (V, 3); return its first guess (V, 3) [m].

        handles: (P, 3) [m] where the pins are at the end of the step.

        Raises:
            ValueError: a function as guess gives another shape.
        """
        if callable(self.guess):
            first = np.array(self.guess(step, x.copy()), dtype=np.float64)
            if first.shape != x.shape:
                raise ValueError(f"simulate: guess of step {step} is {first.shape}: {x.shape} [m] is due")
        elif self.guess == "body_transported":
            assert self.obstacle is not None
            first = self.obstacle.transported(x, step, self.cloth.rest_positions)
        else:
            first = x + self.dt * v if self.guess == "extrapolated" else x.copy()
        first[self.cloth.pins] = handles
        self.freeze(step, x, v, first)
        return first

    def freeze(self, step: int, x: np.ndarray, v: np.ndarray, guess: np.ndarray) -> None:
        """Freeze every term for the step from x with velocity v (V, 3), as it is at the guess (V, 3)."""
        self.potential.prepare(Step(x, v, guess, self.dt, self.obstacle, step))

    def resumed(
        self, earlier: PartialRun, v0: np.ndarray, pin_positions: Callable[[int], np.ndarray] | None
    ) -> State:
        """Return the state at the last frame of an earlier run that began with velocity v0 (V, 3).

        Raises:
            TrajectoryError: the pins are elsewhere, or what the next step needs is not in the file.
        """
        positions, before = earlier.trajectory.positions, earlier.before
        last = len(positions) - 1
        x = positions[last]
        if last == 0:
            return State(x, v0)
        if self.substeps == 1:
            v = v0 if last == 1 else self.velocity(positions[last - 1], positions[last - 2])
            before = np.stack([positions[last - 1], v])
        pins = self.cloth.pins
        if pin_positions is not None and not np.array_equal(pin_positions(last), x[pins]):
            raise TrajectoryError(f"simulate: pins at frame {last} are not where the earlier run had them")
        if self.potential.impassable and not earlier.trajectory.frame_fields["converged"][last]:
            raise TrajectoryError(
                f"simulate: at frame {last} the obstacle may have stopped on its way, no file says where: "
                "start again"
            )
        if before is None:
            raise TrajectoryError(f"simulate: the sub-step before frame {last} is lost: start again")
        # Terms may remember the step before, and an obstacle what it was asked about.
        self.prepare(last * self.substeps, before[0], before[1], x[pins])
        return State(x, self.velocity(x, before[0]), before if self.substeps > 1 else None)

    def open(self, x: np.ndarray, guess: np.ndarray) -> Result:
        """Minimise without the terms that join late, and with them only where they have something to say.

        The minimum without them is the answer if the way there is free and they are zero around it. If not,
        the minimisation with them starts on the way there: from `guess` on if that can be reached, else from
        x on. Cloth meets itself late on such a way, for a guess moves it with the body.
        """
        assert self.opening is not None
        potential, opened = self.potential, self.opening.minimise(guess)
        y = opened.positions if np.isfinite(opened.positions).all() else guess
        free = potential.ccd_fraction(x, y, 0.0) == 1
        terms = potential.terms(y)
        if free and opened.status == "converged" and not any(terms[term.name] for term in self.late):
            return replace(opened, terms=terms)
        if not free and potential.ccd_fraction(x, guess, 0.0) == 1:
            x = guess
        return self.reach(x, y)

    def reach(self, x: np.ndarray, guess: np.ndarray) -> Result:
        """Minimise from `guess`, or from as near to it as terms that nothing may pass through let x come.

        With such a term (a barrier) x, pins and obstacle move together from the start of the step to the
        guess until something would touch. From there pins and obstacle go on alone; if they cannot, a rough
        minimisation gains distance, and all move on. So the last minimisation starts without an intersection,
        pins and obstacle at the end of their way. Without such a term it starts at the guess.

        The rough minimisations share one timeout, and the last one has its own.
        """
        potential, pins = self.potential, self.cloth.pins
        motion, goal, progress = guess - x, guess, 0.0
        reached, begun, late = [0.0], time.perf_counter(), False
        while len(reached) <= MAX_APPROACHES and not late:
            shares: list[float] = []
            for free_too in (True, False):
                if not free_too:
                    goal = x.copy()
                    goal[pins] = guess[pins]
                share = potential.ccd_fraction(x, goal, progress)
                if share == 1:
                    potential.set_progress(1.0)
                    return self.minimiser.minimise(goal)
                if share >= max(shares, default=0.0):
                    part = APPROACH_SHARE * share
                    x, progress = x + part * (goal - x), progress + part * (1 - progress)
                shares.append(share)
            potential.set_progress(progress)
            x = self.rough_minimiser.minimise(x).positions
            goal = x + (1 - progress) * motion
            goal[pins] = guess[pins]
            reached.append(progress)
            late = time.perf_counter() - begun > self.options.get("timeout", float("inf"))
            if progress - reached[max(len(reached) - 4, 0)] < LEAST_APPROACH and len(reached) > 3:
                break
        self.obstacle_stopped = self.body_may_stop
        result = self.minimiser.minimise(x)
        if result.status == "diverged":
            return result
        status = max("stalled", "timeout" if late else result.status, key=severity)
        problem = "no way without intersection" if status == "stalled" else "gave up after the timeout"
        reason = f"{problem}: pins and obstacle came {progress:.1%} of theirs"
        return replace(result, status=status, reason=reason)

    @cached_property
    def rough_minimiser(self) -> Minimiser:
        """Minimiser of few iterations, which gains distance half-way."""
        options: dict[str, Any] = self.ending | {"max_iterations": 8, "tolerance": 1e-2}
        return make_minimiser(self.potential, **options)

    def provenance(self) -> dict[str, Any]:
        """Return JSON values of everything that decides the result: a resumed run must have the same."""
        cloth, obstacle = self.cloth, self.obstacle
        # The options have "newton" by default as well as by request, but L-BFGS opens a step by default. Runs
        # without an opening have no such key: they can go on with the files of earlier versions.
        opening = {"opening": self.opening_method} if self.opening else {}
        return {
            "method": "backward Euler",
            "dt_s": self.frame_dt,
            "substeps": self.substeps,
            "guess": _as_json(self.guess),
            "quasi_static": self.quasi_static,
            "refreeze": self.refreeze,
            "options": {name: _as_json(value) for name, value in self.options.items()},
            **opening,
            "terms": {energy.name: energy.parameters() for energy in self.potential.energies},
            "material": asdict(cloth.material),
            "cloth": fingerprint(cloth.rest_positions, cloth.faces, np.asarray(cloth.pins), cloth.rest_uv),
            "obstacle": None if obstacle is None else f"{type(obstacle).__name__} {obstacle.fingerprint}",
        }


def _as_json(option: Any) -> Any:
    """Return a value of JSON for an option: of a function its name, of a partial one its arguments too."""
    if isinstance(option, partial):
        named = {name: _as_json(value) for name, value in option.keywords.items()}
        return [_as_json(option.func), *map(_as_json, option.args), named]
    return getattr(option, "__name__", type(option).__name__) if callable(option) else option
