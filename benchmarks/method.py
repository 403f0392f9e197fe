"""Method: prepare off the clock, run on it, return a trajectory. Only the harness owns a clock.

Beside it stands the training of its network: those of the project are in TRAININGS of
benchmarks.methods.declared_networks, a method from outside brings its own. Imports nothing heavy.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.declarations import DeclarationError, load, load_function
from benchmarks.results.row import ROLES

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.presets import Preset
    from benchmarks.scene import BuiltScene, Dressed, Scene
    from reference_sim.trajectory import Trajectory
    from snug.recipe import Recipe


@dataclass(frozen=True)
class Simulated:
    """Simulated training data: the training motions, and augmented clips made from them.

    Attributes:
        mixed: frames of augmented clips for each original frame, up to 20,000. The clips are the same for
            every training and seed, see snug.training.augmentation.make_shared_clips.
        method: name of the method that simulates.
        clips_by: name of the method that simulates the augmented clips; empty: `method`.
        turns: share of the default recipe's turns in the augmented clips.
    """

    mixed: int = 0
    method: str = "simulation"
    clips_by: str = field(default="", metadata={"added": True})
    turns: float = field(default=1.0, metadata={"added": True})


@dataclass(frozen=True)
class Training:
    """Training of one network.

    Attributes:
        kind: one of snug.kinds.KINDS.
        recipe: options of network and training.
        simulated: simulations that it learns from; None if it learns from the energies alone.
        packaged: network taken from the package in place of this training; empty: it is trained.
    """

    kind: str
    recipe: Recipe
    simulated: Simulated | None = None
    packaged: str = field(default="", metadata={"added": True})

    def at(self, preset: Preset) -> Training:
        """Return the training with the augmented clips of a preset: how many, how turned, by which solver."""
        simulated, recipe = self.simulated, replace(self.recipe, turn=preset.turns * self.recipe.turn)
        if simulated:
            simulated = replace(
                simulated, mixed=min(simulated.mixed, preset.simulated_mixed),
                clips_by=preset.clips_by or simulated.clips_by, turns=preset.turns * simulated.turns,
            )  # fmt: skip
        return replace(self, recipe=recipe, simulated=simulated)


class WorkerDied(RuntimeError):
    """The work did not come back; the message says why.

    status: the word of a result row, "timeout", "out-of-memory" or "failed".
    """

    def __init__(self, message: str, status: str = "failed") -> None:
        super().__init__(message)
        self.status = status


class Method:
    """Interface of a method; one object serves one cell. Derive from it, or write the same names.

    The harness owns the clock: it times the whole of run(), and inputs() by the same clock. What a method
    may add are the times of its frames, as `frame_seconds` of the trajectory.
    """

    def prepare(self, scene: BuiltScene) -> None:
        """Load, compile and warm up for a scene: paid once, not timed."""
        raise NotImplementedError

    def run(self) -> Trajectory:
        """Compute the roll-out, frame by frame. Timed. Failure is a status in it, not an exception.

        Short ones are called again until enough time is measured: each does all the work anew.
        """
        raise NotImplementedError

    def inputs(self, scene: BuiltScene) -> Callable[[int], object] | None:
        """Return a function of the frame that makes what run() takes as ready of that frame's pose.

        Timed, one frame at a time, and added to the run: end-to-end time, from pose to world vertices. By
        default the posed body and the places of the pins; None without a body.
        """
        return None if scene.dressed is None else posed_body(scene.dressed)

    def quasi_static(self) -> Trajectory | None:
        """Return the method's quasi-static solution of each frame, or None. Not timed."""
        return None

    def batch(self, copies: int) -> Callable[[], np.ndarray]:
        """Return a function that computes so many bodies at once when called, (T, copies, V, 3) [m].

        That call is timed. Asked only of methods declared `batched`.
        """
        raise NotImplementedError


def posed_body(dressed: Dressed) -> Callable[[int], tuple[np.ndarray, np.ndarray]]:
    """Return a function of the frame: vertices (B, 3) of the posed body, pins (P, 3) [m]."""
    body, motion, garment = dressed.body, dressed.motion, dressed.garment
    pose = body.poser(dressed.betas)

    def inputs(frame: int) -> tuple[np.ndarray, np.ndarray]:
        poses, translations = motion.poses[frame : frame + 1], motion.translations[frame : frame + 1]
        return pose(poses, translations)[0], garment.pin_positions(body, poses, translations)[0]

    return inputs


@dataclass(frozen=True, kw_only=True)
class MethodEntry:
    """Declaration of a method: cheap to list. Its module is imported when a cell needs it.

    Attributes:
        name: its name in commands, rows and files.
        description: one line, for --list and run.json.
        label: its name for people.
        module: has `make(*, models, seed, **options)`, which returns a Method, or says another function
            behind a colon; by default the file that declares the entry.
        declared_in: that file, or installed module, filled in by its reader; empty for the project's own.
        files: what it reads, as weights: paths relative to that file; a change makes its results stale.
        options: what make() gets besides models and seed.
        needs_body: whether it works on dressed bodies alone: `scene.dressed` has garment and motion too.
        trained: name of the network that it needs, if any.
        training: how that is trained, where benchmarks.methods.declared_networks does not have it.
        seeded: whether another seed gives another answer; if not, it runs once whatever the seeds.
        dtype: of its computation; trajectories and metrics are float64 in any case.
        truncated: whether it stops before the minimum on purpose, after a number of iterations.
        needs_no_obstacle: whether it knows no contact.
        package: what it needs installed besides this project.
        batched: whether it has `batch(copies)`, many bodies at once; scenes with `networks_only` are met
            by such methods alone.
        gives_first_frame: whether it computes frame 0 too, as networks do; others are given the start.
        timed: whether its run time is measured in scenes that measure run times.
        declared_ms: [ms] a frame, as its author says, where no clock of ours can measure it.
        other_mesh: whether its mesh is not the scene's: then only surfaces are compared.
        static_known: False of a solver of another quasi-static solution that does not return it.
        left_out: reason why it is not run; empty where it runs.
        role: its place in tables and plots: `solver`, `warm-started`, `network`, `ablation`, `baseline`,
            `external`, or another of benchmarks.results.row.ROLES.
        family: methods of one curve of a report, which differ in effort alone; empty: the method's name.
        level: place on that curve, as a number of iterations or a tolerance.
        base: name of the method that reports compare this one with.
        pairing_group: shared by methods compared seed by seed.

    Raises:
        DeclarationError: an unknown role.
    """

    name: str
    description: str
    module: str = ""
    label: str = ""
    declared_in: str = ""
    files: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    needs_body: bool = False
    trained: str | None = None
    training: Training | None = None
    seeded: bool = False
    dtype: str = "float64"
    truncated: bool = False
    needs_no_obstacle: bool = False
    package: str | None = None
    batched: bool = False
    gives_first_frame: bool = False
    timed: bool = True
    declared_ms: float | None = None
    other_mesh: bool = False
    static_known: bool = True
    left_out: str = ""
    role: str = "baseline"
    family: str = ""
    level: float | None = None
    base: str = ""
    pairing_group: str = ""

    def __post_init__(self) -> None:
        if self.role not in ROLES:
            roles = ", ".join(filter(None, ROLES))
            raise DeclarationError(f"method {self.name}: unknown role '{self.role}'; use one of {roles}")
        if self.declared_ms is not None and not 0.0 < self.declared_ms < math.inf:
            raise DeclarationError(f"method {self.name}: declared_ms={self.declared_ms}: give it above 0")

    def is_meant_for(self, scene: Scene) -> bool:
        """Return whether method and scene may meet: some are for batched ones alone."""
        if scene.networks_only:
            return self.batched
        return not (scene.own_garment and self.trained)

    def skip(self, scene: Scene) -> str | None:
        """Return why this method cannot do that scene, or None."""
        if self.left_out:
            return self.left_out
        if self.needs_body and not scene.dressed:
            return f"{self.name} moves a garment with a body's joints; this scene has no body"
        if self.needs_no_obstacle and (scene.dressed or scene.obstacle):
            return f"{self.name} is compared without contact, where its energies and ours are alike"
        if self.package is not None and not is_installed(self.package):
            return f"{self.name} needs the package {self.package}, which is not installed"
        return None

    def make(self, *, models: Path, seed: int) -> Method:
        """Make a fresh method for one cell; `models` is the folder of trained networks."""
        if self.declared_in:
            load(self.declared_in)  # an energy of its own is then known by name
        return load_function(self.module, "make")(models=models, seed=seed, **self.options)


def is_installed(package: str) -> bool:
    """Return whether a package can be imported; a mere folder of that name cannot."""
    try:
        spec = importlib.util.find_spec(package)
    except ModuleNotFoundError:  # what it is a part of
        return False
    return spec is not None and spec.origin is not None
