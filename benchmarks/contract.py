"""Contract of a user's methods and scenes: invariants that are checked while the ordinary runner runs them.

`watched_method` and `watched_scene` put a watch around an entry. A run of it fails with a ContractError that
names everything that is broken, each with its remedy.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.assets import FEWEST_FRAMES
from benchmarks.declarations import raised_at
from benchmarks.method import Method, MethodEntry
from benchmarks.plan.plan import TaskId
from benchmarks.provenance import digest
from benchmarks.runner.cells import CellTask
from benchmarks.runner.isolated_process import one_line
from benchmarks.runner.task import Context, Outcome
from benchmarks.scene import BuiltScene, Scene
from reference_sim import Potential, Trajectory
from reference_sim.energies import Energy, Step

if TYPE_CHECKING:
    from benchmarks.assets import Assets

PLACE_TOLERANCE = 1e-6  # [m] of what should be in its place; times a frame's length in float32
CLOCK_SLACK = 1.1  # of the clock: what frames say of themselves may be more by so much, in all
DISPLACEMENT = 0.02  # of the mean edge, for the places at which derivatives are compared
DIFFERENCE_STEP = 1e-6  # [m] of central differences: their error is some 1e-7 of the derivative
DERIVATIVE_TOLERANCE = 1e-4  # of the norm of the gradient, of the Hessian's largest entry
SUM_ROUND_OFF = 1e-13  # of a sum of many terms, as a share of it
DIRECTIONS = 3  # along which derivatives are compared


class ContractError(RuntimeError):
    """Faults of a user's entry, each with its remedy, separated by semicolons."""


def demand(*claims: tuple[object, str]) -> None:
    """Raise ContractError with the texts of all claims that are false."""
    if wrong := [text for true, text in claims if not true]:
        raise ContractError("; ".join(wrong))


@contextmanager
def naming(what: str, home: str) -> Iterator[None]:
    """Raise ContractError where the user's code raises within, with its file and line."""
    try:
        yield
    except ContractError:
        raise
    except Exception as error:
        where = raised_at(error, home)
        raise ContractError(f"{what} raises {one_line(error)}{f' ({where})' if where else ''}") from None


# --- methods -----------------------------------------------------------------------------------------------


def watched_method(entry: MethodEntry) -> MethodEntry:
    """Return an entry whose method is that of `entry`, under watch."""
    return dataclasses.replace(entry, module=__name__, options={"entry": entry})


def make(*, models: Path, seed: int, entry: MethodEntry) -> WatchedMethod:
    """Make the method of `entry`, under watch."""
    return WatchedMethod(entry, models, seed)


class WatchedMethod(Method):
    """A user's method. What it has done is checked when the runner asks for its quasi-static solution."""

    def __init__(self, entry: MethodEntry, models: Path, seed: int) -> None:
        self.entry, self.models, self.seed = entry, models, seed
        self.home = entry.declared_in or entry.module

    def _prepared(self, scene: BuiltScene, seed: int) -> Method:
        with naming("make()", self.home):
            method = self.entry.make(models=self.models, seed=seed)
        with naming("prepare()", self.home):
            method.prepare(scene)
        return method

    def prepare(self, scene: BuiltScene) -> None:
        """Prepare the method. From now on the scene must stay as it is, and this process by itself."""
        self.scene, self.before, self.hosts = scene, fingerprints(scene), list[str]()
        sys.addaudithook(self._notice)
        self.method = self._prepared(scene, self.seed)

    def _notice(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "socket.connect" and isinstance(arguments[1], tuple):
            self.hosts.append(f"{arguments[1][0]}:{arguments[1][1]}")

    def run(self) -> Trajectory:
        """Run the method."""
        clock = time.perf_counter()
        with naming("run()", self.home):
            self.last = self.method.run()
        self.seconds = time.perf_counter() - clock
        given = type(self.last).__name__
        demand((isinstance(self.last, Trajectory), f"run() gives a {given}: return a Trajectory"))
        return self.last

    def inputs(self, scene: BuiltScene) -> Callable[[int], object] | None:
        """Return what the method does."""
        with naming("inputs()", self.home):
            return self.method.inputs(scene)

    def batch(self, copies: int) -> Callable[[], np.ndarray]:
        """Return what the method does."""
        with naming("batch()", self.home):
            return self.method.batch(copies)

    def quasi_static(self) -> Trajectory | None:
        """Return what the method does, once its run is known to keep the contract. Raises ContractError."""
        with naming("quasi_static()", self.home):
            held = self.method.quasi_static()
        scene, last, entry = self.scene, self.last, self.entry
        x = np.asarray(last.positions, dtype=np.float64)
        bad, stated = np.flatnonzero(~np.isfinite(x).all(axis=(1, 2))), float(np.nansum(last.frame_seconds))
        changed = [name for name, text in fingerprints(scene).items() if self.before.get(name) != text]
        near = PLACE_TOLERANCE * max(1.0, np.abs(scene.start).max())
        pin = "" if entry.other_mesh else self._loose_pin(x, near)
        demand(
            (entry.gives_first_frame or entry.other_mesh or distance(x[0], scene.start) <= near,
                "frame 0 is off the scene's start: put scene.start there, or say gives_first_frame=True"),
            (not pin, f"a pin is off its place in {pin}: "
                "x[cloth.pins] = scene.pin_positions(frame), or the start where that is None"),
            (entry.other_mesh or np.array_equal(last.faces, scene.cloth.faces),
                "gives other faces than the scene's: give cloth.faces"),
            (np.shape(last.times) == (len(x),) and np.allclose(last.times, np.arange(len(x)) * scene.dt),
                "gives other times than np.arange(frames) * scene.dt"),
            (not len(bad) or (last.status == "diverged" and last.reason), "has a position that is not finite "
                f"in frame {bad.min(initial=len(x))}: say status='diverged', and why"),
            (stated <= CLOCK_SLACK * self.seconds + PLACE_TOLERANCE, f"its frames say {stated:.3g} s in all, "
                f"the clock {self.seconds:.3g} s: give frame_seconds in seconds, of run() alone"),
            (not changed, f"alters the scene: {', '.join(changed)}: copy what you change, others read it"),
            (not self.hosts, f"connects to {', '.join(self.hosts[:1])}: fetch what it needs beforehand, keep "
                "it beside the file and name it in files="),
        )  # fmt: skip
        again = distance(x, self._run_again(self.seed))
        demand((again == 0.0, f"a second run gives other positions, by {again:.3g} m: draw all that is "
            "random from `seed`, keep nothing between objects"))  # fmt: skip
        if not entry.seeded and entry.trained is None:
            other = distance(x, self._run_again(self.seed + 1))
            demand((other == 0.0, f"another seed gives other positions, by {other:.3g} m: say seeded=True"))
        return held

    def _run_again(self, seed: int) -> np.ndarray:
        method = self._prepared(self.scene, seed)
        with naming("run() of a second object", self.home):
            return np.asarray(method.run().positions, dtype=np.float64)

    def _loose_pin(self, x: np.ndarray, near: float) -> str:
        """Return the first frame in which a pin is not near where the scene has it, empty without one."""
        scene, pins = self.scene, self.scene.cloth.pins
        for frame in range(1, len(x)) if scene.dressed is None and len(pins) else ():
            place = scene.pin_positions(frame) if scene.pin_positions else scene.start[pins]
            if distance(x[frame][pins], np.asarray(place)) > near:
                return f"frame {frame}"
        return ""


@dataclass(frozen=True, kw_only=True, eq=False)
class PrepareCell(CellTask):
    """A method of a user, prepared before anything is simulated, for a garment that has not settled."""

    kind = "prepare"
    stage = "preparing"

    def run(self, context: Context, needed: Mapping[TaskId, Outcome]) -> Outcome:
        """Make and prepare the method."""
        scene, models = self.cell.scene.build(context.assets), context.folder.models
        at_rest = dataclasses.replace(scene, settle=lambda: scene.cloth.rest_positions)
        self.cell.entry.make(models=models, seed=self.cell.seed).prepare(at_rest)
        return Outcome()


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest distance [m] of two arrays of positions along an axis."""
    return float(np.nanmax(np.abs(one - other), initial=0.0)) if one.shape == other.shape else np.inf


def fingerprints(scene: BuiltScene) -> dict[str, str]:
    """Return name -> digest of the arrays of a scene, which nobody may alter."""
    cloth, worn, obstacle = scene.cloth, scene.dressed, scene.obstacle
    held: dict[str, Any] = {
        "cloth.rest_positions": cloth.rest_positions,
        "cloth.faces": cloth.faces,
        "cloth.masses": cloth.masses,
        "start": scene.start,
        "start_velocity": scene.start_velocity,
        "obstacle.positions": obstacle and obstacle.positions,
        "origin_heights": scene.origin_heights,
        "exact": scene.exact,
        "dressed.motion.poses": worn and worn.motion.poses,
        "dressed.motion.translations": worn and worn.motion.translations,
        "dressed.garment.rest_positions": worn and worn.garment.rest_positions,
    }
    return {name: digest(np.asarray(value)) for name, value in held.items() if value is not None}


# --- scenes ------------------------------------------------------------------------------------------------


def watched_scene(scene: Scene) -> Scene:
    """Return the declaration of a scene that is checked whenever it is built."""
    return dataclasses.replace(scene, module=__name__, options={"scene": scene})


def build(watched: Scene, assets: Assets | None, *, scene: Scene) -> BuiltScene:
    """Build the scene, and once more to look at it. Raises ContractError."""
    home = scene.declared_in or scene.module
    with naming("build()", home):
        built, again = (scene.build(assets) for _ in range(2))
    given = type(built).__name__
    demand((isinstance(built, BuiltScene), f"build() gives a {given}: return a BuiltScene"))
    with naming("settle()", home):
        before, after = fingerprints(built), fingerprints(again)
    changed = [name for name in before if after.get(name) != before[name]]
    demand(
        (built.name == scene.name, f"is built as '{built.name}': give name=scene.name"),
        (built.frames >= FEWEST_FRAMES, f"has {built.frames} frames: {FEWEST_FRAMES} are needed"),
        (built.energies, "declares no energies: without one there is nothing to minimise"),
        (all(energy.cloth is built.cloth for energy in built.energies),
            "an energy is made of another cloth: use the scene's"),
        ((built.obstacle is not None) == (scene.obstacle or scene.dressed),
            "builds an obstacle and declares none, or the reverse: say obstacle=True where it has one"),
        ((built.dressed is not None) == scene.dressed,
            "is built dressed and names no garment, or the reverse: say garment= and motion= where it is"),
        (not changed, f"is built otherwise the second time: {', '.join(changed)}: draw all that is random "
            "from a fixed seed"),
    )  # fmt: skip
    for energy in again.energies:
        if not type(energy).__module__.startswith("reference_sim."):
            with naming(f"energy {energy.name}", home):
                check_derivatives(energy, again)
    return built


def check_derivatives(energy: Energy, scene: BuiltScene) -> None:
    """Compare gradient and Hessian with central differences of value and gradient. Raises ContractError."""
    cloth, random = scene.cloth, np.random.default_rng(0)
    edges = cloth.edges
    length = float(np.linalg.norm(scene.start[edges[:, 0]] - scene.start[edges[:, 1]], axis=1).mean())
    x = scene.start + DISPLACEMENT * length * random.standard_normal(scene.start.shape)
    energy.prepare(Step(scene.start, scene.start_velocity, x, scene.dt, scene.obstacle, 1))
    value, gradient = energy.value_and_gradient(x)
    what = f"energy {energy.name}: its"
    finite = np.isfinite(value) and np.shape(gradient) == x.shape and np.isfinite(gradient).all()
    demand((finite, f"{what} value {value} and gradient {np.shape(gradient)}: give finite ones {x.shape}"))
    moved = np.abs(gradient).max(axis=1) > 0.0  # elsewhere any direction says the same
    for _ in range(DIRECTIONS):
        direction = random.standard_normal(x.shape) * (moved[:, None] if moved.any() else 1.0)
        ahead, behind = (
            energy.value_and_gradient(x + sign * DIFFERENCE_STEP * direction) for sign in (1.0, -1.0)
        )
        slope, stated = (ahead[0] - behind[0]) / (2.0 * DIFFERENCE_STEP), float((gradient * direction).sum())
        near = DERIVATIVE_TOLERANCE * np.linalg.norm(gradient) + SUM_ROUND_OFF * abs(value) / DIFFERENCE_STEP
        demand((abs(slope - stated) <= near, f"{what} gradient is not the derivative of its value: "
            f"{stated:.6g} N along a direction, differences say {slope:.6g} N"))  # fmt: skip
    turned = (ahead[1] - behind[1]) / (2.0 * DIFFERENCE_STEP)
    if type(energy).add_hessian is Energy.add_hessian and not energy.dynamic:
        blocks = energy.active_hessian_blocks(x)[1]  # the solver reads one half of them
        skew = np.abs(blocks - blocks.swapaxes(1, 2)).max(initial=0.0)
        demand((skew <= 1e-9 * np.abs(blocks).max(initial=0.0), f"{what} Hessian is not symmetric; leave it "
            "to automatic differentiation, or mend it"))  # fmt: skip
    product = (Potential([energy]).hessian(x) @ direction.ravel()).reshape(x.shape)
    off, most = float(np.abs(turned - product).max()), float(np.abs(turned).max())
    round_off = SUM_ROUND_OFF * np.abs(gradient).max() / DIFFERENCE_STEP
    near = DERIVATIVE_TOLERANCE * max(most, np.abs(product).max()) + round_off
    demand((off <= near, f"{what} Hessian is not the derivative of its gradient: off by {off:.3g} of "
        f"{most:.3g} N/m; leave it to automatic differentiation, or mend it"))  # fmt: skip
