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
- XPBD by its own potential: of its last sub-step alone, and not exactly, as its bending has no energy.
- newton computes in float32: what is left of VBD's gap after many iterations may be round-off.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from reference_sim import Potential
from reference_sim.energies import BendHinge, Gravity, Inertia, Step
from reference_sim.minimise import LBFGS, Newton

from .child import Row
from .newton_peer import Advance, Peer
from .peer_energies import StableNeoHookean, UnequalSprings
from .sheet import DT, FRAMES, Fall, regular_sheet

CASES = ("one step, 64 x 64", "fall, 64 x 64")
ABSENT: list[Row] = [("newton", "absent: pip install -e .[peers]", "")]
NOTES: list[Row] = [
    ("comparable", "times; VBD and our Newton, both on VBD's own potential", ""),
    ("not comparable", "a peer in our potential: other material; XPBD: other time step as well", ""),
]
STATE_FRAME = 10  # of our fall: wrinkles have formed, and the sheet still moves
NEWTON = (1, 2, 4, 8)
VBD = (1, 3, 10, 30, 100, 300, 1000)
XPBD = ((1, 10), (32, 1), (128, 1), (128, 4), (512, 1))  # sub-steps, iterations
FALLING = (("VBD", 1, 10), ("VBD", 1, 100), ("XPBD", 128, 1))
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
    """Both potentials of one cloth, each over a step of any length, and their best known minimum."""

    def __init__(self, fall: Fall) -> None:
        cloth = self.cloth = fall.cloth
        self.ours = fall.potential
        shared = BendHinge(cloth), Gravity(cloth)
        self.vbd = Potential([StableNeoHookean(cloth), *shared, Inertia(cloth, DT)])
        self._springs = [UnequalSprings(cloth), *shared]

    def xpbd(self, dt: float) -> Potential:
        """XPBD's potential over a step of dt [s]."""
        return Potential([*self._springs, Inertia(self.cloth, dt)])


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
    """One contestant on one step: what it found, and the median of its times."""

    name: str
    advance: Advance
    seconds: float
    outcome: str = ""


def _one_step(cells: int, repeats: int) -> list[Row]:
    """All contestants on the step after STATE_FRAME frames, from a state rounded to newton's float32."""
    fall = Fall(regular_sheet(cells))
    for _ in range(STATE_FRAME):
        fall.step()
    x, v = (a.astype(np.float32).astype(np.float64) for a in (fall.x, fall.v))
    judge = Judge(fall)
    ours, vbd = Problem(judge.ours, x, v), Problem(judge.vbd, x, v)
    entries = [*_ours(ours, repeats), *_theirs(judge, x, v, repeats)]
    descended = _newton_on(vbd)
    finite = [entry.advance.x for entry in entries if not entry.advance.diverged]
    ours.descend(ours.guess, *finite)
    vbd.descend(vbd.guess, descended.advance.x, finite[-1], _result(entries, f"VBD {VBD[-1]}"))
    rows: list[Row] = [
        ("start x + dt v: gap in ours", ours.gap(ours.guess), "J"),
        ("start x + dt v: gap in VBD's own", vbd.gap(vbd.guess), "J"),
    ]
    for entry in [*entries, descended]:
        rows.append((f"{entry.name}: step", 1e3 * entry.seconds, "ms"))
        if entry.outcome:
            rows.append((f"{entry.name}: outcome", entry.outcome, ""))
        if entry.advance.diverged:
            continue
        rows.append((f"{entry.name}: gap in ours", ours.gap(entry.advance.x), "J"))
        distance = np.linalg.norm(entry.advance.x - ours.minimum, axis=1).mean()
        rows.append((f"{entry.name}: mean distance to ours", 1e3 * float(distance), "mm"))
        if entry.name.startswith("XPBD"):
            substeps = int(entry.name.split()[1])
            rows.append((f"{entry.name}: gap in its own", _own_gap(judge, entry.advance, substeps), "J"))
        else:
            rows.append((f"{entry.name}: gap in VBD's own", vbd.gap(entry.advance.x), "J"))
    return rows


def _result(entries: Sequence[Entry], name: str) -> np.ndarray:
    return next(entry.advance.x for entry in entries if entry.name == name)


def _own_gap(judge: Judge, advance: Advance, substeps: int) -> float:
    """Gap [J] of XPBD's last sub-step in XPBD's own potential of that sub-step."""
    own = Problem(judge.xpbd(DT / substeps), advance.x_before, advance.v_before, DT / substeps)
    own.descend(own.guess, advance.x)
    return own.gap(advance.x)


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
    contestants = [("VBD", 1, n) for n in VBD] + [("XPBD", *case) for case in XPBD]
    for solver, substeps, iterations in contestants:
        peer = Peer(judge.cloth, solver, iterations=iterations, substeps=substeps)
        run = lambda peer=peer: (peer.advance(x, v, DT), "")  # noqa: E731
        entries.append(_repeated(_name(solver, substeps, iterations), run, repeats))
    return entries


def _name(solver: str, substeps: int, iterations: int) -> str:
    return f"{solver} {iterations}" if solver == "VBD" else f"{solver} {substeps} x {iterations}"


def _falls(cells: int) -> list[Row]:
    """30 frames of every method by itself: time a frame, and mean gaps over every fifth frame."""
    start = Fall(regular_sheet(cells))
    judge = Judge(start)
    rows: list[Row] = []
    start_x = start.x.copy()
    frames = [start_x]
    seconds = []
    for _ in range(FRAMES):
        _, spent = start.step()
        frames.append(start.x)
        seconds.append(spent)
    rows += _judged("our Newton", judge, frames, seconds, [])
    for solver, substeps, iterations in FALLING:
        peer = Peer(judge.cloth, solver, iterations=iterations, substeps=substeps)
        frames, seconds, advances = [start_x], [], []
        v = np.zeros_like(start_x)
        for _ in range(FRAMES):
            advance = peer.advance(frames[-1], v, DT)
            if advance.diverged:
                break
            frames.append(advance.x)
            seconds.append(advance.seconds)
            advances.append(advance)
            v = advance.v
        rows += _judged(_name(solver, substeps, iterations), judge, frames, seconds, advances)
    return rows


def _judged(
    name: str,
    judge: Judge,
    frames: Sequence[np.ndarray],
    seconds: Sequence[float],
    advances: Sequence[Advance],
) -> list[Row]:
    """Rows of one fall; gaps are to minima found from x + dt v and from the result, per judged frame."""
    if len(frames) <= FRAMES:
        return [(f"{name}: outcome", f"diverged at frame {len(frames)}", "")]
    ours, own = [], []
    for k in range(5, FRAMES + 1, 5):
        v = (frames[k - 1] - frames[k - 2]) / DT
        problem = Problem(judge.ours, frames[k - 1], v)
        problem.descend(problem.guess, frames[k])
        ours.append(problem.gap(frames[k]))
        if name.startswith("XPBD"):
            own.append(_own_gap(judge, advances[k - 1], int(name.split()[1])))
        else:
            problem = Problem(judge.vbd, frames[k - 1], v)
            problem.descend(frames[k])
            own.append(problem.gap(frames[k]))
    whose = "its" if advances else "VBD's"
    heights = judge.cloth.masses @ frames[-1][:, 1] / judge.cloth.masses.sum()
    return [
        (f"{name}: frame, median", 1e3 * float(np.median(seconds)), "ms"),
        (f"{name}: gap in ours, mean", float(np.mean(ours)), "J"),
        (f"{name}: gap in {whose} own, mean", float(np.mean(own)), "J"),
        (f"{name}: centre of mass at the end", float(heights), "m"),
    ]
