"""What a run will do, decided and checked before anything is created."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

from snug.recipe import learns_from_simulation

from .meetings import meetings, named
from .methods import METHODS, find_method
from .presets import Preset
from .scene import Scene
from .scenes import SMALL_SCENES, TSHIRT, WORN, all_scenes, motion_of
from .studies import METHOD as STUDIES_METHOD
from .studies import STUDIES, Study
from .suites import SUITE_NAMES
from .suites.extremes import CASES, Case
from .suites.extremes import METHOD as EXTREMES_METHOD
from .suites.validation import CHECKS, Check
from .suites.validation import METHOD as VALIDATION_METHOD

if TYPE_CHECKING:
    from snug.motion import Motion


class PlanError(ValueError):
    """A request that cannot be met; the message names the word and what there is instead."""


@dataclass(frozen=True)
class Cell:
    """One scene met by one method with one seed; `suites` are those that report it."""

    scene: Scene
    method: str
    seed: int
    suites: tuple[str, ...]

    @property
    def label(self) -> str:
        return f"{self.scene.name} x {self.method}" + (f" (seed {self.seed})" if self.seed else "")


@dataclass(frozen=True)
class Network:
    """A network that some cell needs: its name in snug.recipe.TRAININGS, its seed, the garment it is for."""

    name: str
    seed: int
    garment: str = TSHIRT

    @property
    def label(self) -> str:
        return f"{self.name} seed {self.seed}" + (f" ({self.garment})" if self.garment != TSHIRT else "")


@dataclass(frozen=True)
class OwnBody:
    """A user's body: its file, and a digest of what it held when the run was planned."""

    path: Path
    digest: str


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Everything to be done. train and test are names of motions; files holds those read from files.

    swing_train, swing_test: the same for garments that swing. body: an own one; None: the package's.
    only: states of the folder's records in which a piece of work is done again; fresh: all records are
    forgotten first. workers: processes side by side where nothing is timed against another.
    """

    preset: Preset
    suites: tuple[str, ...]
    cells: tuple[Cell, ...]
    checks: tuple[Check, ...]
    cases: tuple[Case, ...]
    studies: tuple[Study, ...] = ()
    train: tuple[str, ...]
    test: tuple[str, ...]
    swing_train: tuple[str, ...] = ()
    swing_test: tuple[str, ...] = ()
    files: dict[str, Motion] = field(default_factory=dict)
    body: OwnBody | None = None
    seeds: tuple[int, ...]
    device: str
    folder: Path
    command: str
    only: frozenset[str] = frozenset(("stale", "missing"))
    fresh: bool = False
    workers: int = 1

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scenes of all cells, each once."""
        return tuple({cell.scene.name: cell.scene for cell in self.cells}.values())

    @property
    def networks(self) -> tuple[Network, ...]:
        """Every network that some cell needs."""
        return tuple(dict.fromkeys(filter(None, (network_of(cell) for cell in self.cells if runs(cell)))))

    @property
    def models(self) -> tuple[tuple[str, int], ...]:
        """(kind, seed) of the T-shirt's networks, which studies look at."""
        return tuple((network.name, network.seed) for network in self.networks if network.garment == TSHIRT)

    @property
    def garments(self) -> tuple[str, ...]:
        """What bodies wear in the scenes of the plan."""
        return tuple(dict.fromkeys(cell.scene.garment for cell in self.cells if cell.scene.dressed))

    def train_of(self, garment: str) -> tuple[str, ...]:
        """Names of the motions that networks of a garment train on."""
        return self.swing_train if swings(garment) else self.train

    def test_of(self, garment: str) -> tuple[str, ...]:
        """Names of a garment's test motions, and of what it does besides in the plan's scenes."""
        own = self.swing_test if swings(garment) else self.test
        done = (motion_of(scene.name) for scene in self.scenes if scene.dressed and scene.garment == garment)
        return tuple(dict.fromkeys((*own, *done)))

    @property
    def simulated(self) -> tuple[str, ...]:
        """Garments whose training motions have to be simulated."""
        learning = (network for network in self.networks if learns_from_simulation(network.name))
        return tuple(dict.fromkeys(network.garment for network in learning))

    @property
    def body_file(self) -> Path | None:
        """The file of an own body."""
        return self.body.path if self.body else None

    @property
    def needs_wardrobe(self) -> bool:
        return any(cell.scene.dressed for cell in self.cells)


def runs(cell: Cell) -> bool:
    """Whether the cell is computed at all."""
    return find_method(cell.method).skip(cell.scene) is None


def network_of(cell: Cell) -> Network | None:
    """The network that a cell needs."""
    entry = find_method(cell.method)
    return Network(entry.trained, cell.seed, cell.scene.garment) if entry.trained else None


def swings(garment: str) -> bool:
    """Whether a garment's motions are those that stop within a frame."""
    return any(wear.swings for wear in WORN if wear.garment == garment)


@dataclass(frozen=True)
class Motions:
    """Names of the motions of a run, training apart from test, and those that came from files."""

    train: tuple[str, ...]
    test: tuple[str, ...]
    files: dict[str, Motion]
    swing_train: tuple[str, ...] = ()
    swing_test: tuple[str, ...] = ()


def choose_motions(paths: Sequence[str], test_names: Sequence[str], preset: Preset) -> Motions:
    """Which motions train and which test. Raises PlanError (or the reader's own error) for a bad request.

    Without paths: the embedded library with its own division. With paths: the files alone, plus the library
    where "library" is among the paths. test_names moves motions to the test set; without it the test
    motions of the library test, and of files alone the first in order of names. A single file tests, and the
    library trains.
    """
    from snug.motion_files import load_motions
    from snug.motion_library import DYNAMIC_TEST, DYNAMIC_TRAIN, LIBRARY, TEST, TRAIN

    files: dict[str, Motion] = {}
    for path in paths:
        for motion in load_motions(path) if path != "library" else ():
            if motion.name in files or motion.name in LIBRARY:
                raise PlanError(f"--motions {path}: the name '{motion.name}' is taken; rename the file")
            files[motion.name] = motion
    with_library = not paths or "library" in paths
    names = [*sorted(files), *((*TRAIN, *TEST) if with_library else ())]
    for name in test_names:
        if name not in names:
            raise PlanError(f"--test-motions: unknown motion '{name}'; {_nearest(name, names)}")
    if test_names:
        test = tuple(name for name in names if name in test_names)
    else:
        test = TEST if with_library else tuple(names[:1])
    train = tuple(name for name in names if name not in test)
    train = train if test_names else tuple(name for name in train if name not in TEST)
    if not train:
        train = tuple(name for name in TRAIN if name not in test)
    # Whoever names the test motions means all of them, whatever the size of the preset.
    few, fewer = preset.train_motions, preset.test_motions
    test = test if test_names else test[:fewer]
    return Motions(train[:few], test, files, DYNAMIC_TRAIN[:few], DYNAMIC_TEST[:fewer])


def names_no_motion(scenes: Sequence[str]) -> bool:
    """Whether a choice of scenes names small scenes, checks and cases alone; no motion is looked at then."""
    known = {item.name for group in (SMALL_SCENES, CHECKS, CASES, STUDIES) for item in group}
    return bool(scenes) and known.issuperset(scenes)


def choose_cells(
    suites: Sequence[str],
    *,
    full: bool,
    preset: Preset,
    motions: Motions,
    scenes: Sequence[str],
    methods: Sequence[str],
    seeds: Sequence[int],
) -> tuple[tuple[Cell, ...], tuple[Check, ...], tuple[Case, ...]]:
    """Cells, checks and cases that the request names. Raises PlanError for a word that names nothing.

    scenes and methods: see benchmarks.meetings.
    """
    declared = all_scenes(motions.test, motions.swing_test)
    rows = [item.name for group in (CHECKS, CASES, STUDIES) for item in group]
    _check_words("scene", scenes, [*declared, *rows])
    _check_words("method", methods, [entry.name for entry in METHODS])

    found: dict[tuple[str, str, int], Cell] = {}
    for suite, scene, method in meetings(
        suites, declared, full=full, preset=preset, motions=motions, scenes=scenes, methods=methods
    ):
        for seed in seeds if find_method(method).seeded else (0,):
            key = (scene, method, seed)
            before = found[key].suites if key in found else ()
            found[key] = Cell(declared[scene], method, seed, (*before, suite))
    known = [check for check in CHECKS if check.smoke or scenes or preset.name != "smoke"]
    checks = _matching(known, scenes, "validation" in suites and named(VALIDATION_METHOD, methods))
    hard = [case for case in CASES if case.smoke or scenes or preset.name != "smoke"]
    cases = _matching(hard, scenes, "extremes" in suites and named(EXTREMES_METHOD, methods))
    if not (found or checks or cases or choose_studies(suites, scenes, methods)):
        raise PlanError("nothing to run: no suite asked for has these scenes and methods; see --list")
    # The reference first: an error against it can be said as soon as another cell is done.
    order = {entry.name: place for place, entry in enumerate(METHODS)}
    places = {name: place for place, name in enumerate(declared)}
    cells = sorted(found.values(), key=lambda c: (places[c.scene.name], order[c.method], c.seed))
    return tuple(cells), checks, cases


def choose_studies(suites: Sequence[str], scenes: Sequence[str], methods: Sequence[str]) -> tuple[Study, ...]:
    """The studies of the suites, chosen by name as scenes are."""
    known = [study for study in STUDIES if study.suite in suites]
    return _matching(known, scenes, named(STUDIES_METHOD, methods))


def choose_suites(words: Iterable[str]) -> tuple[str, ...]:
    """The suites named, "all" meaning each; none named means each too. Raises PlanError."""
    words = list(words)
    for word in words:
        if word not in (*SUITE_NAMES, "all"):
            known = ", ".join((*SUITE_NAMES, "all"))
            raise PlanError(f"--suite: unknown suite '{word}'; choose from {known}")
    return tuple(name for name in SUITE_NAMES if not words or "all" in words or name in words)


def _matching(items, patterns: Sequence[str], wanted: bool):
    return tuple(item for item in items if wanted and named(item.name, patterns))


def _check_words(what: str, patterns: Sequence[str], names: Sequence[str]) -> None:
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            hint = ""
            if what == "scene" and pattern.startswith(tuple(wear.prefix for wear in WORN)):
                hint = " (scenes of a dressed body are the test motions: see --test-motions)"
            raise PlanError(f"unknown {what} '{pattern}'; {_nearest(pattern, names)}{hint}")


def _nearest(word: str, names: Sequence[str]) -> str:
    near = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else "see --list"
