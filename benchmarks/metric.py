"""A metric: a number of a roll-out under its name, with unit, title and definition; and what it may read.

A module of benchmarks/metrics holds METRICS, a tuple of Metric, and

    measure(roll_out: RollOut) -> dict[str, float]     name -> value; what does not apply is left out

and where it wants curves in the trajectory file

    series(roll_out: RollOut) -> dict[str, np.ndarray]  name -> (T,)

Its name in the tuple of benchmarks/metrics/__init__.py is all that it takes to have it measured, written,
tabulated and defined in the report.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reference_sim import Trajectory

    from .method import MethodEntry
    from .metrics.curvature import CurvatureSeries
    from .metrics.geometry import Penetration
    from .scene import BuiltScene, Scene

WHOLE = ("ok", "stalled")  # statuses of cells that came to their last frame


@dataclass(frozen=True, kw_only=True)
class Metric:
    """The declaration of a metric.

    title: the head of its column; table: the table that has this column, or empty. reference_tolerance: how
    far from zero the value of the reference simulation may be; its row is then judged.
    """

    name: str
    unit: str
    title: str
    definition: str
    table: str = ""
    lower_is_better: bool | None = None
    reference_tolerance: float | None = None


@dataclass(eq=False)
class RollOut:
    """What one method did in a scene. positions: (T,V,3) [m], the frames before the first that is not finite.

    quasi_static: (T,V,3) [m] its own answer to poses held still, or None. counterpart: (T',V,3) [m] what the
    same method did in the scene's counterpart, or None. suites: those that report it.
    """

    group: SceneRollOuts
    entry: MethodEntry
    seed: int
    status: str
    suites: tuple[str, ...]
    trajectory: Trajectory
    quasi_static: np.ndarray | None = None
    counterpart: np.ndarray | None = None
    positions: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        from .metrics.geometry import whole_frames

        self.positions = whole_frames(self.trajectory.positions)

    @property
    def scene(self) -> BuiltScene:
        return self.group.scene

    @property
    def whole(self) -> bool:
        """Whether it came to its last frame, and every position is finite."""
        return self.status in WHOLE and len(self.positions) == self.scene.frames

    @property
    def reference(self) -> RollOut | None:
        """The simulation of the same scene, where this is not that."""
        reference = self.group.reference
        return None if reference is self else reference

    @cached_property
    def curvature(self) -> CurvatureSeries:
        from .metrics.curvature import curvature_series

        return curvature_series(self.positions, self.scene.cloth.faces)

    @property
    def energies(self) -> dict[str, np.ndarray]:
        """Term -> (T,) [J], and "total"."""
        return self.group.energies[self.place]

    @property
    def inside(self) -> Penetration:
        """How deep its vertices lie in the obstacle of the scene."""
        return self.group.inside[self.place]

    @property
    def place(self) -> int:
        return self.group.roll_outs.index(self)


@dataclass(eq=False)
class SceneRollOuts:
    """The roll-outs of one scene that are measured together: they share its search trees.

    simulated_quasi_static: (T,V,3) [m] the simulator's answer to poses held still, or None. gap_samples:
    frames at which a step is solved again. memo: what modules keep of all roll-outs together.
    """

    declaration: Scene
    scene: BuiltScene
    gap_samples: int
    simulated_quasi_static: np.ndarray | None = None
    roll_outs: list[RollOut] = field(default_factory=list)
    memo: dict[str, Any] = field(default_factory=dict)

    def find(self, *, role: str, family: str | None = None, level: float | None = None) -> RollOut | None:
        """The first that came to its end, of that role, and of that family and level where they are given."""
        for roll_out in self.roll_outs:
            entry = roll_out.entry
            fits = entry.role == role and family in (None, entry.family) and level in (None, entry.level)
            if fits and roll_out.status in WHOLE:
                return roll_out
        return None

    @cached_property
    def reference(self) -> RollOut | None:
        return self.find(role="reference")

    @cached_property
    def energies(self) -> list[dict[str, np.ndarray]]:
        from .metrics.energy import energy_series

        return energy_series(self.scene, [roll_out.positions for roll_out in self.roll_outs])

    @cached_property
    def inside(self) -> list[Penetration]:
        from .metrics.geometry import penetration

        assert self.scene.obstacle is not None
        return penetration([roll_out.positions for roll_out in self.roll_outs], self.scene.obstacle)

    @cached_property
    def skinned(self) -> np.ndarray | None:
        """(T,V,3) [m] the garment skinned to the poses, as the default recipe does; None without a body."""
        if self.scene.dressed is None:
            return None
        from snug.dresser import DressedBody
        from snug.recipe import DEFAULT

        dressed = self.scene.dressed
        return DressedBody(dressed.body, dressed.garment).skinned(
            dressed.motion, dressed.betas, smoothing=DEFAULT.smoothing
        )

    def measure(self, wanted: Sequence[RollOut]) -> Iterator[tuple[dict[str, float], dict[str, np.ndarray]]]:
        """Metrics and curves of each wanted roll-out, in that order, by all modules that apply."""
        from .metrics import modules

        chosen = self.declaration.metrics
        for roll_out in wanted:
            found: dict[str, float] = {}
            curves: dict[str, np.ndarray] = {}
            for name, module in modules().items() if len(roll_out.positions) else ():
                if chosen is not None and name not in chosen:
                    continue
                suites: tuple[str, ...] = getattr(module, "SUITES", roll_out.suites)
                if any(suite in suites for suite in roll_out.suites):
                    found |= module.measure(roll_out)
                    curves |= module.series(roll_out) if hasattr(module, "series") else {}
            yield found, curves
