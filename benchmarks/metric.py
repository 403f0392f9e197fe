"""Metric: a number of a roll-out by name, unit, title and definition; and the roll-outs that it reads.

A file of benchmarks/metrics declares Measurements: metrics, and the functions that measure them. A user's
file behind --set metrics= holds METRICS, a tuple of Metric, and functions called measure, compare, series
and judge.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.declarations import load
from benchmarks.results.protocol import FAMILY
from benchmarks.results.row import USABLE

if TYPE_CHECKING:
    from benchmarks.method import MethodEntry
    from benchmarks.scene import BuiltScene
    from reference_sim.trajectory import Trajectory

Made = TypeVar("Made")
Floats = NDArray[np.float64]
Positions = Floats  # (T,V,3) [m] of a roll-out
Vertices = Floats  # (V,3) [m] of a frame
Faces = NDArray[np.int64]  # (F,3) triangles, outward
NUMBERS_OF = ("answer", "method", "machine")
COMPARED_WITH = ("reference", "reference-variant")  # roles of what others are measured beside


class Estimate(NamedTuple):
    """Number and its uncertainty, in the same unit; nan where it is unknown.

    moved: by how much each member of the reference's family, in its place, changes the number.
    """

    value: float
    uncertainty: float
    moved: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Metric:
    """Declaration of a metric.

    Attributes:
        name: in results.csv, also a pattern such as `energy/*`.
        unit: "1" where it has no dimension.
        title: head of its column.
        definition: one line for the report.
        table: the table that has this column, or empty.
        lower_is_better: None where neither is.
        arbitrary_zero: whether its zero is a choice, as the height of a potential energy: then
            differences say something, and ratios nothing.
        of: what it is a number of: the "answer" of a method; the "method" itself, as its size; or the
            "machine", as every time. Another seed gives another answer; another machine another time.
        declared_in: as of a MethodEntry.

    Raises:
        ValueError: another `of`, no unit, or a table that is no word.

    >>> Metric(name="height/mean", unit="m", title="Height", definition="mean over frames").of
    'answer'
    """

    name: str
    unit: str
    title: str
    definition: str
    table: str = ""
    lower_is_better: bool | None = None
    arbitrary_zero: bool = False
    of: str = "answer"
    declared_in: str = ""

    def __post_init__(self) -> None:
        if not re.fullmatch(r"\w*", self.table):
            raise ValueError(f"metric '{self.name}': table='{self.table}': use letters, digits and _")
        if not self.unit:
            raise ValueError(f"metric '{self.name}' has no unit: say '1' where it has no dimension")
        if self.of not in NUMBERS_OF:
            raise ValueError(f"metric '{self.name}': of='{self.of}': use one of {', '.join(NUMBERS_OF)}")

    @property
    def heading(self) -> str:
        """Title, and unit where it has one, for a column or an axis."""
        return f"{self.title} [{self.unit}]" if self.unit != "1" else self.title


def metrics_of(*rows: tuple[Any, ...], **shared: Any) -> tuple[Metric, ...]:
    """Declare metrics that share fields.

    Args:
        rows: name, unit, title and definition of each; a dict of other fields may follow.
        shared: fields of all of them.

    >>> metrics_of(("a/x", "m", "X", "a length"), ("a/y", "m", "Y", "a height"), table="a")[1].table
    'a'
    """
    names = ("name", "unit", "title", "definition")
    return tuple(Metric(**dict(zip(names, row)) | shared | dict(*row[4:])) for row in rows)


@dataclass(frozen=True)
class Measurements:
    """Metrics measured together.

    Attributes:
        name: in the `metrics` of a scene; the path of a user's file.
        metrics: all that the functions give a number of.
        measure: of a roll-out, name -> value; what does not apply is left out.
        compare: of a roll-out and the reference, name -> value. It is called with each member of the
            reference's family too (benchmarks.results.protocol), whose noise is the uncertainty of a
            number.
        series: of a roll-out, curves beside the trajectory, name -> (T,), or (T,V) of every vertex.
        judge: of a roll-out and its values, status and reason where it failed though it ended well.
        where_named: whether only scenes that name it are measured.
        other_meshes: whether it applies to a roll-out on another mesh than the scene's.
        suites: the parts of a study whose cells it is measured in; all by default.
    """

    name: str
    metrics: tuple[Metric, ...]
    measure: Callable[[RollOut], Mapping[str, float | Estimate]] | None = None
    compare: Callable[[RollOut, RollOut], dict[str, float]] | None = None
    series: Callable[[RollOut], Mapping[str, np.ndarray]] | None = None
    judge: Callable[[RollOut, dict[str, Any]], tuple[str, str] | None] | None = None
    where_named: bool = False
    other_meshes: bool = False
    suites: tuple[str, ...] = ()


def measurements_in(home: str) -> Measurements:
    """Return what a user's file measures."""
    module = load(home)
    names = ("measure", "compare", "series", "judge")
    functions: Any = {name: getattr(module, name, None) for name in names}
    return Measurements(home, tuple(module.METRICS), **functions)


@dataclass(eq=False)
class Kept:
    """Memory of what metric modules computed of an object."""

    _made: dict[Callable[..., Any], Any] = field(default_factory=dict, init=False, repr=False)

    def get(self, make: Callable[[Any], Made]) -> Made:
        """Return make(self), computed at the first call."""
        if make not in self._made:
            self._made[make] = make(self)
        entry = self._made[make]
        return entry.result() if isinstance(entry, Future) else entry

    def keep(self, make: Callable[[Any], Made], future: Future[Made]) -> None:
        """Take what another process computes in place of make(self)."""
        self._made[make] = future


@dataclass(eq=False)
class RollOut(Kept):
    """Roll-out of a method in a scene. `positions` (T,V,3) [m] end before the first frame that is not finite.

    Attributes:
        group: the roll-outs of the scene.
        entry: the method.
        trajectory: as the method returned it.
        status: of its cell.
        suites: those that report it.
        quasi_static: (T,V,3) [m] the method's quasi-static solutions, or None.
        counterpart: (T',V,3) [m] roll-out of the same method in the scene's counterpart, or None.
    """

    group: SceneRollOuts
    entry: MethodEntry
    trajectory: Trajectory
    status: str = "ok"
    suites: tuple[str, ...] = ()
    quasi_static: np.ndarray | None = None
    counterpart: np.ndarray | None = None
    positions: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.positions = self.trajectory.finite().positions

    @property
    def scene(self) -> BuiltScene:
        """Scene that was rolled out."""
        return self.group.scene

    @property
    def reference(self) -> RollOut | None:
        """Reference simulation of the same scene; None where this is it, or there is none."""
        reference = self.group.reference
        return None if reference is self else reference

    @property
    def judged(self) -> slice:
        """Frames after those of the warm-up."""
        return slice(self.scene.warm_up, None)

    def match_frames(self, other: np.ndarray) -> slice:
        """Return the frames after the warm-up that positions (T',V,3) [m] of another roll-out have too."""
        return slice(self.scene.warm_up, min(len(self.positions), len(other)))


@dataclass(eq=False)
class SceneRollOuts(Kept):
    """Roll-outs of one scene measured together: they share its search trees.

    Attributes:
        scene: as it was built.
        gap_samples: least number of frames whose time step is solved again.
        quasi_static: (T,V,3) [m] the simulator's quasi-static solutions, or None.
        roll_outs: to be filled before anything is measured.
    """

    scene: BuiltScene
    gap_samples: int = 0
    quasi_static: np.ndarray | None = None
    roll_outs: list[RollOut] = field(default_factory=list)

    @property
    def reference(self) -> RollOut | None:
        """Finished reference simulation of the scene, or None."""
        of_role = (roll_out for roll_out in self.roll_outs if roll_out.entry.role == "reference")
        return next((roll_out for roll_out in of_role if roll_out.status in USABLE), None)

    @property
    def family(self) -> list[RollOut]:
        """Members of the reference's family that converged in every frame."""
        return [r for r in self.roll_outs if r.entry.name in FAMILY and r.status == "ok"]
