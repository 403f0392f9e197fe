"""newton's VBD and XPBD beside our minimisers: the same sheet, masses, pins, step and starting state.

Every result is judged in float64, first by our potential (StVK + hinges + weight + inertia from that method's
own previous two frames), then by the potential that its own solver descends (peer_energies.py). A gap is the
energy above the best minimum that our Newton finds of that potential, from the extrapolated start and from
the results themselves. newton_peer.py says how the material is translated.

What is comparable and what is not:
- Time of a step: yes. Compilation and loading of kernels, colouring and symbolic analysis, copies in and out
  are off the clock on all sides. newton's kernels run on one thread of the processor, which is not what they
  are written for; a GPU would be faster.
- VBD by its own potential, beside our Newton on that same potential: yes. Ours takes derivatives of it by
  torch there, several times dearer than the closed forms that our own terms have.
- VBD by our potential: only as a difference of materials. Stable Neo-Hookean and StVK agree at small strain;
  at the pins they do not (stretch 5 in VBD's minimum, and there StVK grows with its fourth power): all of
  the gap that is left, and grows, as VBD converges is in the four triangles within 2 cm of a pin.
- XPBD by our potential: as a difference of materials too, springs against a membrane, and of time steps: with
  springs this stiff its Jacobi sweeps diverge unless the frame is cut into many sub-steps, and a sub-stepped
  frame does not minimise the potential of the whole frame (it is the better integrator: less damped).
- XPBD, and VBD with sub-steps, by their own potential: of the last sub-step alone, whose energies are other
  ones than those of a frame; for XPBD not exactly, as its bending has no energy.
- newton computes in float32: what is left of VBD's gap after many iterations may be round-off.

Seen with newton 1.8.0, processor time of one thread: on VBD's own potential our Newton is done after 8
iterations and 0.83 s; VBD has closed 25 % of its gap after 0.05 s (10 iterations), 66 % after 0.52 s (100)
and 98.5 % after 5.1 s (1000). On ours, Newton closes 98 % in 0.04 s and ends in 0.35 s. Left to fall by
itself with 10 or 100 iterations a frame, VBD is so far from converged that the sheet runs away downwards.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from reference_sim import Potential
from reference_sim.energies import BendHinge, Gravity, Inertia, Step
from reference_sim.minimise import LBFGS, Newton

from ..parts import Row
from .newton_peer import Advance, Peer
from .peer_energies import StableNeoHookean, UnequalSprings
from .sheet import DT, FRAMES, Fall, regular_sheet

CASES = ("one step, 64 x 64", "fall, 64 x 64")
ABSENT: list[Row] = [("newton", "absent: pip install -e .[peers]", "")]
NOTES: list[Row] = [
    ("comparable", "times; VBD and our Newton, both on VBD's own potential", ""),
    ("not comparable", "a peer in our potential: other material; with sub-steps: other time step too", ""),
]
STATE_FRAME = 10  # of our fall: wrinkles have formed, and the sheet still moves
NEWTON = (1, 2, 4, 8)
# Solver, sub-steps of a frame, iterations in each; 20 x 10 is what newton's example of hanging cloth does.
STEPPING = (
    *(("VBD", 1, iterations) for iterations in (1, 3, 10, 30, 100, 300, 1000)),
    *(("VBD", substeps, 10) for substeps in (20, 100)),
    *(("XPBD", 1, 10), ("XPBD", 20, 10), ("XPBD", 128, 1), ("XPBD", 128, 4), ("XPBD", 512, 1)),
)
FALLING = (("VBD", 1, 10), ("VBD", 1, 100), ("VBD", 20, 10), ("XPBD", 128, 1))
LONG = 2.0  # seconds after which a contestant is not repeated


def measure(case: str, repeats: int) -> list[Row]:
    """Time and gaps of every contestant on one step, or of each on its own fall of 30 frames."""
    try:
        warm_up = [_first_step(solver) for solver in ("VBD", "XPBD")]
    except ImportError:
        return ABSENT
    cells = int(case.split()[-1])
    measured = _one_step(cells, repeats) if case.startswith("one step") else _falls(cells)
    return [*NOTES, *warm_up, *measured]


def _first_step(solver: str) -> Row:
    """Compiles newton's kernels, or loads them from its cache."""
    cloth = regular_sheet(4)
    clock = time.perf_counter()
    Peer(cloth, solver, iterations=1).advance(cloth.rest_positions, np.zeros((16, 3)), DT)
    return f"{solver}: import, compile or load kernels", time.perf_counter() - clock, "s"


class Judge:
    """The potentials of one cloth: ours, and each peer's own over a step of any length."""

    def __init__(self, fall: Fall) -> None:
        self.cloth, self.ours = fall.cloth, fall.potential
        shared = BendHinge(fall.cloth), Gravity(fall.cloth)
        self._own = {
            "VBD": (StableNeoHookean(fall.cloth), *shared),
            "XPBD": (UnequalSprings(fall.cloth), *shared),
        }

    def own(self, solver: str, dt: float = DT) -> Potential:
        """What "VBD" or "XPBD" descends in a step of dt [s]."""
        return Potential([*self._own[solver], Inertia(self.cloth, dt)])

    def own_gap(self, solver: str, substeps: int, advance: Advance) -> float:
        """Gap [J] of a peer's last sub-step in its own potential of that sub-step."""
        dt = DT / substeps
        last = Problem(self.own(solver, dt), advance.x_before, advance.v_before, dt)
        last.descend(last.guess, advance.x)
        return last.gap(advance.x)


@dataclass
class Problem:
    """A potential over one step from (x, v), and the lowest minimum found of it so far."""

    potential: Potential
    x: np.ndarray
    v: np.ndarray
    dt: float = DT
    best: float = np.inf

    def __post_init__(self) -> None:
        self.guess = self.minimum = self.x + self.dt * self.v
        self.potential.prepare(Step(self.x, self.v, self.guess, self.dt))

    def descend(self, *starts: np.ndarray) -> None:
        """Newton from each start (V, 3) [m]; the best minimum is kept."""
        newton = Newton(self.potential, max_iterations=100)
        for start in starts:
            result = newton.minimise(start)
            if result.energy < self.best:
                self.best, self.minimum = result.energy, result.positions

    def gap(self, x: np.ndarray) -> float:
        """Potential at x (V, 3) above the best minimum [J]."""
        return self.potential.value(x) - self.best


@dataclass
class Entry:
    """One contestant on one step: what it found, the median of its times, its gap in its own potential."""

    name: str
    advance: Advance
    seconds: float
    outcome: str = ""
    own_gap: float | None = None  # None: judged by VBD's potential of the whole frame, as ours is


def _one_step(cells: int, repeats: int) -> list[Row]:
    """All contestants on the step after STATE_FRAME frames, from a state rounded to newton's float32."""
    fall = Fall(regular_sheet(cells))
    for _ in range(STATE_FRAME):
        fall.step()
    x, v = (a.astype(np.float32).astype(np.float64) for a in (fall.x, fall.v))
    judge = Judge(fall)
    ours, vbd = Problem(judge.ours, x, v), Problem(judge.own("VBD"), x, v)
    entries = [*_ours(ours, repeats), *_theirs(judge, x, v, repeats), _newton_on(vbd)]
    finite = [entry for entry in entries if not entry.advance.diverged]
    ours.descend(ours.guess, *(entry.advance.x for entry in finite))
    vbd.descend(vbd.guess, *(e.advance.x for e in finite if e.name in ("VBD 1 x 1000", finite[-1].name)))
    rows: list[Row] = [
        ("start x + dt v: gap in ours", ours.gap(ours.guess), "J"),
        ("start x + dt v: gap in VBD's own", vbd.gap(vbd.guess), "J"),
    ]
    for entry in entries:
        rows += _rows_of(entry, ours, vbd)
    return rows


def _rows_of(entry: Entry, ours: Problem, vbd: Problem) -> list[Row]:
    rows: list[Row] = [(f"{entry.name}: step", 1e3 * entry.seconds, "ms")]
    if entry.outcome:
        rows.append((f"{entry.name}: outcome", entry.outcome, ""))
    if entry.advance.diverged:
        return rows
    x = entry.advance.x
    rows.append((f"{entry.name}: gap in ours", ours.gap(x), "J"))
    distance = np.linalg.norm(x - ours.minimum, axis=1).mean()
    rows.append((f"{entry.name}: mean distance to ours", 1e3 * float(distance), "mm"))
    if entry.own_gap is None:
        return [*rows, (f"{entry.name}: gap in VBD's own", vbd.gap(x), "J")]
    return [*rows, (f"{entry.name}: gap in its own, last sub-step", entry.own_gap, "J")]


def _repeated(name: str, run: Callable[[], tuple[Advance, str]], repeats: int) -> Entry:
    seconds: list[float] = []
    while len(seconds) < repeats and sum(seconds) < LONG:
        advance, outcome = run()
        seconds.append(advance.seconds)
    return Entry(name, advance, float(np.median(seconds)), "diverged" if advance.diverged else outcome)


def _minimised(problem: Problem, minimiser: Newton | LBFGS) -> tuple[Advance, str]:
    clock = time.perf_counter()
    result = minimiser.minimise(problem.guess)
    seconds = time.perf_counter() - clock
    advance = Advance(result.positions, problem.v, problem.x, problem.v, seconds)
    return advance, f"{result.status} after {result.iterations} iterations"


def _ours(problem: Problem, repeats: int) -> list[Entry]:
    """Newton cut short, Newton and L-BFGS to the end."""
    potential = problem.potential
    contestants: dict[str, Newton | LBFGS] = {
        f"our Newton {n}": Newton(potential, max_iterations=n) for n in NEWTON
    }
    contestants["our Newton"] = Newton(potential)
    contestants["our L-BFGS, then Newton"] = LBFGS(potential)
    return [
        _repeated(name, lambda minimiser=minimiser: _minimised(problem, minimiser), repeats)  # type: ignore[misc]
        for name, minimiser in contestants.items()
    ]


def _newton_on(problem: Problem) -> Entry:
    """Our Newton on VBD's potential: derivatives by torch, so its time is an upper bound."""
    problem.potential.hessian(problem.guess)  # loads torch
    advance, outcome = _minimised(problem, Newton(problem.potential))
    return Entry("our Newton on VBD's own", advance, advance.seconds, outcome)


def _theirs(judge: Judge, x: np.ndarray, v: np.ndarray, repeats: int) -> list[Entry]:
    entries = []
    for solver, substeps, iterations in STEPPING:
        peer = Peer(judge.cloth, solver, iterations=iterations, substeps=substeps)
        run = lambda peer=peer: (peer.advance(x, v, DT), "")  # noqa: E731
        entry = _repeated(f"{solver} {substeps} x {iterations}", run, repeats)
        if not entry.advance.diverged and (solver, substeps) != ("VBD", 1):
            entry.own_gap = judge.own_gap(solver, substeps, entry.advance)
        entries.append(entry)
    return entries


def _falls(cells: int) -> list[Row]:
    """30 frames of every method by itself: time a frame, and mean gaps over every tenth frame."""
    fall = Fall(regular_sheet(cells))
    judge = Judge(fall)
    start, seconds = fall.x, []
    frames = [start]
    for _ in range(FRAMES):
        seconds.append(fall.step()[1])
        frames.append(fall.x)
    rows = _judged("our Newton", judge, frames, seconds)
    for solver, substeps, iterations in FALLING:
        peer = Peer(judge.cloth, solver, iterations=iterations, substeps=substeps)
        advances = [peer.advance(start, np.zeros_like(start), DT)]
        while len(advances) < FRAMES and not advances[-1].diverged:
            advances.append(peer.advance(advances[-1].x, advances[-1].v, DT))
        name = f"{solver} {substeps} x {iterations}"
        if advances[-1].diverged:
            rows.append((f"{name}: outcome", f"diverged at frame {len(advances)}", ""))
            continue
        frames = [start, *(advance.x for advance in advances)]
        rows += _judged(name, judge, frames, [advance.seconds for advance in advances])
        own = [judge.own_gap(solver, substeps, advance) for advance in advances[9::10]]
        rows.append((f"{name}: gap in its own, mean", float(np.mean(own)), "J"))
    return rows


def _judged(name: str, judge: Judge, frames: Sequence[np.ndarray], seconds: Sequence[float]) -> list[Row]:
    """Rows of one fall; gaps are to minima found from x + dt v and from the result, per judged frame."""
    gaps = []
    for k in range(10, FRAMES + 1, 10):
        problem = Problem(judge.ours, frames[k - 1], (frames[k - 1] - frames[k - 2]) / DT)
        problem.descend(problem.guess, frames[k])
        gaps.append(problem.gap(frames[k]))
    masses = judge.cloth.masses
    return [
        (f"{name}: frame, median", 1e3 * float(np.median(seconds)), "ms"),
        (f"{name}: gap in ours, mean", float(np.mean(gaps)), "J"),
        (f"{name}: centre of mass at the end", float(masses @ frames[-1][:, 1] / masses.sum()), "m"),
    ]
