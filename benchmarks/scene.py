"""A scene: what there is to simulate, its terms and no other, and the exact answer where one is known."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from reference_sim import Cloth, Obstacle
    from reference_sim.energies import Energy
    from snug.body import Body
    from snug.garments import Garment
    from snug.motion import Motion

    from .presets import Preset
    from .wardrobe import Wardrobe


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The declaration of a scene: cheap to list. Its module is imported when it is built.

    `garment` names what a body wears in it; it then needs the wardrobe, and networks work on no other.
    `obstacle` says that there is another thing to touch.
    """

    name: str
    description: str
    module: str
    garment: str = ""
    obstacle: bool = False

    @property
    def dressed(self) -> bool:
        """Whether there is a body that wears a garment."""
        return bool(self.garment)

    def build(self, preset: Preset, wardrobe: Wardrobe | None = None) -> BuiltScene:
        """Make everything the scene declares. Deterministic. A dressed scene needs the wardrobe."""
        if self.dressed and wardrobe is None:
            raise ValueError(f"scene {self.name} needs a wardrobe: a body, a garment and the motion")
        return importlib.import_module(self.module).build(self.name, preset, wardrobe)


@dataclass(frozen=True)
class Dressed:
    """Who wears what and moves how: what a network may know of a scene."""

    body: Body
    garment: Garment
    motion: Motion


@dataclass(frozen=True, kw_only=True, eq=False)
class BuiltScene:
    """All that a method may read. Frame 0 of every array is the start.

    energies: the terms declared, inertia left out: the time step adds it. dt [s]; frames: positions of a
    trajectory, the start included. settle: gives the start (V,3) [m] from which to simulate; it may itself
    simulate, so it is called once, off the clock. origin_heights: (T,) [m] where the gravity energy of each
    frame is zero. exact: (T,V,3) [m] or None. pin_positions: frame -> (P,3) [m] of handles that move.
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
    start_velocity: np.ndarray | None = None
    pin_positions: Callable[[int], np.ndarray] | None = None

    @cached_property
    def start(self) -> np.ndarray:
        """(V,3) [m]."""
        return self.settle()

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the terms that exist in this scene, in the order of the tables."""
        return (*(e.name for e in self.energies), "inertia")
