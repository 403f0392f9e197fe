"""Means over scenes and seeds of the rows of a run.

Only finite values of cells that ended ok, or stalled at some frames, enter a mean; a mean says when one
of its cells stalled. Nothing is filled in for a cell that failed.
The mean is first taken over the scenes of one seed, then over seeds; the spread is the standard
deviation over seeds (n - 1), absent for a single seed.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from benchmarks.results import Row
from reports import palette
from reports.numbers import finite

TERMS = ("strain", "bending", "gravity", "inertia", "collision", "total")
USABLE = ("ok", "stalled")
EXTRA_TERMS = ("spring", "area", "friction", "barrier")
TSHIRT = "T-shirt"
_GARMENTS = {"dressed": TSHIRT}  # by the part of a scene's name before its motion, where that does not say


@dataclass(frozen=True)
class Mean:
    """The mean of a metric, its spread over seeds, and what went into it.

    `complete` says that every seed has every scene asked for; otherwise the mean is over fewer cells
    than its neighbours in a table, and the table must say so. `stalled` says that a solver left some
    frames of some cell unconverged, `seeded` that another seed would give another value. `by_seed`: the mean
    over scenes of each seed; empty for what was derived from other means. `lost`: seeds of which nothing
    usable is left, as of a network that diverged. `kin`: means of equal kin and seed began with the same
    draws; empty for none.
    """

    value: float
    spread: float | None
    scenes: int
    seeds: int
    complete: bool
    stalled: bool = False
    seeded: bool = True
    by_seed: Mapping[int, float] = field(default_factory=dict, compare=False)
    lost: int = 0
    kin: str = field(default="", compare=False)

    @property
    def fewer(self) -> str:
        """Words for a verdict: over how many scenes or seeds, where these are not all."""
        if self.lost:
            return f" ({self.seeds} of {self.seeds + self.lost} seeds)"
        return "" if self.complete else only(self.scenes)


class Measurements:
    """The usable numbers of some rows, asked for by scene, method and metric."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self.rows = tuple(rows)
        self._values: dict[tuple[str, str, str], dict[int, float]] = {}
        self._stalled: set[tuple[str, str]] = set()
        self._unusable: dict[str, set[tuple[str, int]]] = {}  # method -> scene and seed
        self.units: dict[str, str] = {}
        for row in self.rows:
            if row.status in USABLE and row.value is not None and finite(row.value):
                key = (row.scene, row.method, row.metric)
                self._values.setdefault(key, {})[row.seed] = row.value
                if row.status == "stalled":
                    self._stalled.add((row.scene, row.method))
                self.units.setdefault(row.metric, row.unit)
            elif row.status != "skipped":
                self._unusable.setdefault(row.method, set()).add((row.scene, row.seed))
        self.scenes = tuple(dict.fromkeys(row.scene for row in self.rows))
        self.methods = tuple(palette.ordered(row.method for row in self.rows if row.method))
        self.metrics = tuple(dict.fromkeys(key[2] for key in self._values))

    def only(self, scenes: Iterable[str]) -> Measurements:
        """The measurements of the scenes given."""
        kept = set(scenes)
        return Measurements(row for row in self.rows if row.scene in kept)

    def seeds(self, scene: str, method: str, metric: str) -> dict[int, float]:
        """Value by seed, empty where nothing usable was measured."""
        return self._values.get((scene, method, metric), {})

    def diverged(self, method: str) -> bool:
        """Whether that is what became of the method somewhere."""
        return any(row.method == method and row.status == "diverged" for row in self.rows)

    def mean(self, method: str, metric: str, scenes: Sequence[str] | None = None) -> Mean | None:
        """Mean over the scenes (all by default) and seeds that have the metric, None if there are none."""
        by_seed: dict[int, list[float]] = {}
        used = set()
        asked = self.scenes if scenes is None else scenes
        for scene in asked:
            for seed, value in self.seeds(scene, method, metric).items():
                by_seed.setdefault(seed, []).append(value)
                used.add(scene)
        if not by_seed:
            return None
        means = {seed: statistics.fmean(values) for seed, values in by_seed.items()}
        lost = {seed for scene, seed in self._unusable.get(method, ()) if scene in asked} - means.keys()
        return Mean(
            value=statistics.fmean(means.values()),
            spread=statistics.stdev(means.values()) if len(means) > 1 else None,
            scenes=len(used),
            seeds=len(means),
            complete=not lost and all(len(values) == len(asked) for values in by_seed.values()),
            stalled=any((scene, method) in self._stalled for scene in used),
            seeded=palette.is_seeded(method),
            by_seed=means,
            lost=len(lost),
            kin=palette.kin_of(method),
        )

    def shared(
        self, methods: Iterable[str], metric: str, scenes: Sequence[str] | None = None
    ) -> tuple[str, ...]:
        """Of the scenes (all by default) those where each method has the metric, with all its seeds."""
        asked = self.scenes if scenes is None else scenes
        own = {m: {seed for s in asked for seed in self.seeds(s, m, metric)} for m in methods}
        return tuple(
            s for s in asked if all(had and self.seeds(s, m, metric).keys() == had for m, had in own.items())
        )

    def pair(
        self, one: str, other: str, metric: str, scenes: Sequence[str] | None = None
    ) -> tuple[Mean | None, Mean | None]:
        """Both means over the scenes that the two methods share, None where they share none.

        Where one of them was not measured at all, the other's mean is over its own scenes.
        """
        asked = self.scenes if scenes is None else scenes
        both = self.shared((one, other), metric, asked)
        first, second = (self.mean(method, metric, both or asked) for method in (one, other))
        if first is None or second is None:
            return first, second
        if not both:
            return None, None
        complete = len(both) == len(asked)
        first, second = (replace(m, complete=complete and not m.lost) for m in (first, second))
        return first, second

    def value(self, method: str, metric: str, scenes: Sequence[str] | None = None) -> float | None:
        """The mean alone, or None."""
        mean = self.mean(method, metric, scenes)
        return None if mean is None else mean.value


def only(scenes: int) -> str:
    """Words behind a number or verdict that is over so many scenes, fewer than all."""
    return f" ({scenes} {'scene' if scenes == 1 else 'scenes'} only)"


def wardrobe(measurements: Measurements) -> dict[str, tuple[str, ...]]:
    """The scenes of each garment by its name, the T-shirt's first."""
    found: dict[str, list[str]] = {}
    for scene in sorted(worn_scenes(measurements), key=lambda scene: not scene.startswith("dressed/")):
        prefix = scene.partition("/")[0]
        found.setdefault(_GARMENTS.get(prefix, prefix.capitalize()), []).append(scene)
    return {garment: tuple(scenes) for garment, scenes in found.items()}


def dressed_scenes(measurements: Measurements) -> tuple[str, ...]:
    """The scenes of the T-shirt, over which the paper's tables take their means; without one, of the first
    other garment.
    """
    return next(iter(wardrobe(measurements).values()), ())


def worn_scenes(measurements: Measurements) -> tuple[str, ...]:
    """The scenes with any garment on a moving body: they are named garment/motion."""
    return tuple(scene for scene in measurements.scenes if "/" in scene)


def suite_rows(rows: Iterable[Row], suite: str) -> list[Row]:
    return [row for row in rows if row.suite == suite]


def benchmark_cells(rows: Iterable[Row], first: str) -> list[Row]:
    """The rows of garments and speed, each cell once: a cell that both report is taken from `first`."""
    kept = [row for row in rows if row.suite in ("garments", "speed")]
    taken = {_cell(row) for row in kept if row.suite == first}
    return [row for row in kept if row.suite == first or _cell(row) not in taken]


def _cell(row: Row) -> tuple[str, str, int, str]:
    return (row.scene, row.method, row.seed, row.metric)


def speed_measurements(rows: Iterable[Row]) -> Measurements:
    """What an error-against-run-time plot may use: everything that has a scene and a method."""
    return Measurements(benchmark_cells(rows, "speed"))


def excess_energy(measurements: Measurements, scene: str, method: str) -> float | None:
    """Mean total energy of a method above that of the simulation in the same scene [J per frame]."""
    own = measurements.value(method, "energy/total", [scene])
    reference = measurements.value(palette.REFERENCE, "energy/total", [scene])
    if own is None or reference is None or method == palette.REFERENCE:
        return None
    return own - reference
