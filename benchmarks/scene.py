"""Scene: what is simulated, its energy terms, and the exact answer where one is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from benchmarks.declarations import DeclarationError, by_name, load_function

if TYPE_CHECKING:
    import numpy as np

    from benchmarks.assets import Assets
    from benchmarks.presets import Preset
    from reference_sim.cloth import Cloth
    from reference_sim.energies.energy import Energy
    from reference_sim.obstacle import Obstacle
    from snug.body.parametric_body import Body
    from snug.garments.garment import Garment
    from snug.motion.motion import Motion

LONGEST_FRAME = 1.0  # [s]; a dt of 33.3 is in milliseconds


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Declaration of a scene: cheap to list. Its module is imported when it is built.

    Attributes:
        name: in commands, rows and files.
        description: one line, for --list and run.json.
        module: has `build(scene, assets, **options)`, which returns a BuiltScene, or says another
            function behind a colon.
        declared_in, files: as of a MethodEntry.
        sizes: values of the preset that build() takes as options.
        options: further options of build().
        garment: what a body wears in it; it then needs the assets, and networks work on no other.
        motion: name of the motion.
        part: of the motion: "whole", "clip", "loop" or "start".
        obstacle: whether there is another thing to touch.
        metrics: names of the Measurements that are taken here; None for all that apply.
        counterpart: another scene whose roll-out by the same method metrics compare with.
        start_of: another scene whose settled start is that of this one too.
        networks_only: whether nobody simulates it, so that it has neither start nor posed body.
        own_garment: whether it tailors a garment that no network of the run was trained for.
        self_contact: whether the cloth of its simulations does not cross itself.
    """

    name: str
    description: str
    module: str = ""
    declared_in: str = ""
    files: tuple[str, ...] = ()
    sizes: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    garment: str = ""
    motion: str = ""
    part: str = ""
    obstacle: bool = False
    metrics: tuple[str, ...] | None = None
    counterpart: str = ""
    start_of: str = ""
    networks_only: bool = False
    own_garment: bool = False
    self_contact: bool = False

    @property
    def timed(self) -> bool:
        """True if costs are measured in this scene; cells of other scenes run side by side."""
        return self.metrics is None or "cost" in self.metrics

    @property
    def dynamic(self) -> bool:
        """True if metrics need quasi-static solutions of this scene."""
        return self.dressed and (self.metrics is None or "dynamics" in self.metrics)

    @property
    def simulated(self) -> bool:
        """True if the garment settles on a posed body before the motion starts."""
        return self.dressed and not self.networks_only

    @property
    def dressed(self) -> bool:
        """True if the scene has a body that wears a garment."""
        return bool(self.garment)

    def at(self, preset: Preset) -> Scene:
        """Return the scene with the sizes of a preset among its options. Raises DeclarationError."""
        if unknown := [name for name in self.sizes if not hasattr(preset, name)]:
            raise DeclarationError(f"scene {self.name}: sizes: no preset has {', '.join(unknown)}")
        sizes = {name: getattr(preset, name) for name in self.sizes}
        return replace(self, sizes=(), options={**sizes, **self.options})

    def build(self, assets: Assets | None = None) -> BuiltScene:
        """Build what the scene declares. Deterministic. Raises ValueError for missing assets."""
        if self.dressed and assets is None:
            raise ValueError(f"scene {self.name} needs assets: a body, a garment and the motion")
        return load_function(self.module, "build")(self, assets, **self.options)


@dataclass(frozen=True)
class Dressed:
    """Body, garment and motion: all that a network may read of a scene.

    Attributes:
        body, garment, motion: as read or made by the assets.
        betas: (S,) body shape; None for the mean body.
        before: the motion until then, where `motion` is a part of a longer one.
    """

    body: Body
    garment: Garment
    motion: Motion
    betas: np.ndarray | None = None
    before: Motion | None = None

    @property
    def pelvis(self) -> np.ndarray:
        """Positions (T,3) [m] of the posed root joint."""
        return self.body.joints(self.betas)[0] + self.motion.translations


@dataclass(frozen=True, kw_only=True, eq=False)
class BuiltScene:
    """Built scene: all that a method may read. Frame 0 of every array is the start.

    Attributes:
        name: the name in its declaration.
        cloth: mesh, material, `masses`, `free` vertices and `pins`.
        energies: the terms but for inertia, which the time step adds; each name once.
        dt: duration of a frame [s].
        frames: number of positions in a trajectory, the start included.
        settle: returns the start (V,3) [m] at rest, or positions and velocities (2,V,3) [m, m/s]. It may
            itself simulate, so it is called once, off the clock.
        obstacle: what the cloth touches, or None; the declaration then says `obstacle=True`.
        origin_heights: (T,) [m] where the gravity energy of each frame is zero.
        exact: the exact answer (T,V,3) [m], or None.
        dressed: body, garment and motion, or None.
        pin_positions: frame -> (P,3) [m] of pins that move.
        substeps: time steps that a simulator takes for a frame.
        warm_up: frames at the beginning that metrics leave out; the first two have no two before them.
        glitch: the frame whose pose is wrong on purpose.
        kept: frames of the motion that a trajectory holds, or None for all.
        repeated: two sets of frames of the trajectory that show the same motion.
        minimised: terms of simulations in place of `energies`, with self-contact, which no metric knows;
            none where the cloth may cross itself.

    Raises:
        ValueError: a warm-up below two.
    """

    name: str
    cloth: Cloth
    energies: tuple[Energy, ...]
    dt: float
    frames: int
    settle: Callable[[], np.ndarray]
    obstacle: Obstacle | None = None
    origin_heights: np.ndarray | None = None
    exact: np.ndarray | None = None
    dressed: Dressed | None = None
    pin_positions: Callable[[int], np.ndarray] | None = None
    substeps: int = 1
    warm_up: int = 2
    glitch: int | None = None
    kept: np.ndarray | None = None
    repeated: tuple[np.ndarray, np.ndarray] | None = None
    minimised: tuple[Energy, ...] = ()

    def __post_init__(self) -> None:
        by_name("energy", self.energies)  # rows of one would overwrite those of the other
        if self.warm_up < 2:
            raise ValueError(f"scene {self.name}: warm_up {self.warm_up}: give 2 frames or more")
        if not 0.0 < self.dt <= LONGEST_FRAME:
            remedy = f"give the duration of a frame in seconds, above 0 and at most {LONGEST_FRAME:g}"
            raise ValueError(f"scene {self.name}: dt {self.dt:g}: {remedy}")

    @cached_property
    def start_state(self) -> np.ndarray:
        """Positions and velocities at the start, (2,V,3) [m, m/s]."""
        import numpy as np

        state = np.asarray(self.settle(), dtype=np.float64)
        return np.stack([state, np.zeros_like(state)]) if state.ndim == 2 else state

    @property
    def start(self) -> np.ndarray:
        """Positions (V,3) [m] at the start."""
        return self.start_state[0]

    @property
    def start_velocity(self) -> np.ndarray:
        """Velocities (V,3) [m/s] at the start."""
        return self.start_state[1]

    @cached_property
    def skinned(self) -> np.ndarray | None:
        """The garment skinned to the poses as by the default recipe, (T,V,3) [m]; None without a body."""
        if self.dressed is None:
            return None
        from snug.networks.dressed_body import DressedBody  # loads torch
        from snug.recipe import DEFAULT

        motion, frames = self.dressed.motion, self.kept
        if frames is not None:
            motion = replace(motion, poses=motion.poses[frames], translations=motion.translations[frames])
        dressed = DressedBody(self.dressed.body, self.dressed.garment)
        return dressed.skin(motion, self.dressed.betas, smoothing=DEFAULT.smoothing)

    @property
    def simulated_energies(self) -> tuple[Energy, ...]:
        """Terms that a simulation minimises: those it is measured by, or these and self-contact."""
        return self.minimised or self.energies

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the energy terms of this scene, in the order of the tables."""
        return (*(e.name for e in self.energies), "inertia")
