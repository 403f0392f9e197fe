"""What a request asks for: scenes and methods, cases, microbenchmarks, motions to train and test on."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from .methods import METHODS, find_method
from .performance.microbenchmark import SUITE, Microbenchmark
from .performance.registry import MICROBENCHMARKS
from .plan import Motions, PlanError
from .presets import PRESETS, Preset
from .scene import Scene
from .scenes import GARMENT_SCENES, all_scenes
from .suites import SUITE_NAMES, SUITES, Extent, Suite
from .tasks.cell import Cell
from .validation.case import METHOD
from .validation.registry import CASES

if TYPE_CHECKING:
    from snug.motion import Motion

    from .validation.case import Case

FEWEST = 3  # frames of a motion: inertia needs two before the one that is judged
MEASURED: tuple[Case | Microbenchmark, ...] = (*CASES, *MICROBENCHMARKS)  # what is no cell


@dataclass(frozen=True, kw_only=True)
class Request:
    """The words of a request. full: whether suites are named; scenes and methods: names or patterns; empty
    means all that the suites list.
    """

    suites: tuple[str, ...]
    preset: Preset
    motions: Motions
    full: bool = False
    scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    seeds: tuple[int, ...] = (0,)

    @property
    def extent(self) -> Extent:
        """Naming scenes reaches all of each suite."""
        named = bool(self.scenes)
        return Extent(self.preset, self.motions, self.full or named, named or self.preset.further)


def choose(request: Request) -> tuple[tuple[Cell, ...], tuple[Case, ...], tuple[Microbenchmark, ...]]:
    """What the request names. Raises PlanError for a word that names nothing."""
    declared = all_scenes(request.motions.test, request.motions.dynamic_test, request.motions.worn)
    _check_words("scene", request.scenes, [*declared, *(entry.name for entry in MEASURED)])
    _check_words("method", request.methods, [entry.name for entry in METHODS])
    found: dict[tuple[str, str, int], Cell] = {}
    for suite, scene, method in _pairs(request, declared):
        entry = find_method(method)
        for seed in request.seeds if entry.seeded else (0,):
            key = (scene, method, seed)
            before = found[key].suites if key in found else ()
            found[key] = Cell(declared[scene].at(request.preset), entry, seed, (*before, suite))
    cases, microbenchmarks = tuple(_cases(request)), tuple(_microbenchmarks(request))
    if not (found or cases or microbenchmarks):
        raise PlanError("nothing to run: no suite asked for has these scenes and methods; see --list")
    # The reference first: an error against it can be said as soon as another cell is done.
    order = {entry.name: place for place, entry in enumerate(METHODS)}
    places = {name: place for place, name in enumerate(declared)}
    cells = sorted(found.values(), key=lambda c: (places[c.scene.name], order[c.method], c.seed))
    return tuple(cells), cases, microbenchmarks


def _pairs(request: Request, declared: dict[str, Scene]) -> Iterator[tuple[str, str, str]]:
    """(suite, scene, method), suite by suite.

    A scene that no suite lists is met where its whole name is given: a body in a whole motion in garments,
    all else in speed. A method that no suite lists takes part in each suite where its whole name is given.
    """
    extent = request.extent
    unlisted = _unlisted_scenes(request, declared)
    own_methods = set(request.methods) & {entry.name for entry in METHODS} - _listed_methods()
    for suite in SUITES:
        listed = suite.scenes(extent)
        if suite.name not in request.suites or not suite.methods(extent):
            continue
        more = suite.more_methods if request.methods or request.preset.further else ()
        further = suite.named_methods if request.methods else ()
        methods = (*suite.methods(extent), *more, *further, *sorted(own_methods))
        for scene in (*listed, *(name for name, home in unlisted.items() if home == suite.name)):
            # Networks for a second garment double the training: only for whoever names its scenes.
            plain = not extent.further and declared[scene].garment not in ("", extent.motions.first_garment)
            for method in methods:
                if not (named(scene, request.scenes) and named(method, request.methods)):
                    continue
                entry = find_method(method)
                if entry.meant_for(declared[scene]) and not (plain and entry.trained):
                    yield suite.name, scene, method


def _cases(request: Request) -> Iterator[Case]:
    """Those of the suites; the smallest preset runs those marked, unless they are named.

    Naming methods without the simulation leaves them out.
    """
    if named(METHOD, request.methods):
        for case in CASES:
            small = case.smoke or request.scenes or request.preset.name != "smoke"
            if small and case.suite in request.suites and named(case.name, request.scenes):
                yield case


def _microbenchmarks(request: Request) -> Iterator[Microbenchmark]:
    """Those of the scenes and methods named; the smallest preset runs those marked, unless they are named."""
    for benchmark in MICROBENCHMARKS if SUITE in request.suites else ():
        small = benchmark.smoke or request.scenes or request.preset.name != "smoke"
        wanted = small and named(benchmark.name, request.scenes) and named(benchmark.method, request.methods)
        if wanted and (not benchmark.long or benchmark.name in request.scenes):
            yield benchmark


def named(name: str, patterns: Sequence[str]) -> bool:
    """Whether some pattern means that name; without patterns all are meant."""
    return not patterns or any(fnmatchcase(name, pattern) for pattern in patterns)


def default_suites(method: str, preset: Preset) -> list[str]:
    """The suites in which a method takes part at that preset without being named."""
    return [suite.name for suite in SUITES if method in suite.methods(Extent(preset, Motions()))]


def _unlisted_scenes(request: Request, declared: dict[str, Scene]) -> dict[str, str]:
    """Scenes called by their whole names that no suite lists -> the suite that takes them."""
    everything = Extent(request.preset, request.motions, full=True, further=True)
    listed = {name for suite in SUITES for name in suite.scenes(everything)}
    return {
        name: "garments" if scene.part == "whole" else "speed"
        for name, scene in declared.items()
        if name in request.scenes and name not in listed
    }


def _listed_methods() -> set[str]:
    """Every method that some suite lists at some preset."""
    extents = [Extent(preset, Motions()) for preset in PRESETS]

    def of_suite(suite: Suite) -> set[str]:
        return {
            *suite.more_methods,
            *suite.named_methods,
            *(name for extent in extents for name in suite.methods(extent)),
        }

    return set().union(*map(of_suite, SUITES))


def choose_suites(words: Iterable[str]) -> tuple[str, ...]:
    """The suites named, "all" meaning each; without words those of a default run. Raises PlanError."""
    words = list(words)
    for word in words:
        if word not in (*SUITE_NAMES, "all"):
            known = ", ".join((*SUITE_NAMES, "all"))
            raise PlanError(f"--suite: unknown suite '{word}'; choose from {known}")
    chosen = words or [suite.name for suite in SUITES if suite.default]
    return tuple(name for name in SUITE_NAMES if "all" in chosen or name in chosen)


def choose_motions(paths: Sequence[str], test_names: Sequence[str], preset: Preset) -> Motions:
    """Which motions train and which test. Raises PlanError (or the reader's own error) for a bad request.

    Without paths: the embedded library with its own division. With paths: the files alone, plus the library
    where "library" is among the paths. test_names moves motions to the test set; without it the test
    motions of the library test, and of files alone the first in order of names. A single file tests, and the
    library trains. The test motions of the library never train, whichever motions test.
    """
    from snug.motion_files import load_motions
    from snug.motion_library import DYNAMIC_TEST, DYNAMIC_TRAIN, LIBRARY, TEST, TRAIN

    files: dict[str, Motion] = {}
    for path in paths:
        for motion in load_motions(path) if path != "library" else ():
            if motion.name in files or motion.name in LIBRARY:
                raise PlanError(f"--motions {path}: the name '{motion.name}' is taken; rename the file")
            if motion.frames < FEWEST:
                raise PlanError(f"--motions {path}: {motion.frames} frames; at least {FEWEST} are needed")
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
    train = tuple(name for name in names if name not in (*test, *TEST))
    if not train:
        train = tuple(name for name in TRAIN if name not in test)
    # Whoever names the test motions means all of them, whatever the size of the preset.
    few, fewer = preset.train_motions, preset.test_motions
    test = test if test_names else test[:fewer]
    return Motions(train[:few], test, files, DYNAMIC_TRAIN[:few], DYNAMIC_TEST[:fewer])


def names_no_motion(scenes: Sequence[str]) -> bool:
    """Whether a choice of scenes names scenes without a body, cases and
    microbenchmarks alone; no motion is looked at then."""
    known = {name for name, scene in all_scenes((), ()).items() if not scene.dressed}
    known |= {entry.name for entry in MEASURED}
    return bool(scenes) and known.issuperset(scenes)


def _check_words(what: str, patterns: Sequence[str], names: Sequence[str]) -> None:
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            hint = ""
            if what == "scene" and pattern.partition("/")[0] in {g.garment for g in GARMENT_SCENES}:
                hint = " (scenes of a dressed body are the test motions: see --test-motions)"
            raise PlanError(f"unknown {what} '{pattern}'; {_nearest(pattern, names)}{hint}")


def _nearest(word: str, names: Sequence[str]) -> str:
    near = difflib.get_close_matches(word, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else "see --list"
