"""Which scenes meet which methods in a run: its cells; beside them its cases."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING

from benchmarks.cell import Cell
from benchmarks.declarations import DeclarationError, by_name
from benchmarks.method import MethodEntry
from benchmarks.methods.catalogue.all_methods import METHODS
from benchmarks.metrics import MODULES
from benchmarks.plan.motion_split import nearest
from benchmarks.plan.plan import Motions, PlanError
from benchmarks.plan.roll_out_cells import roll_out_cells
from benchmarks.plan.suites import SUITE_NAMES, SUITES, Extent, Suite
from benchmarks.presets import PRESETS, Preset
from benchmarks.scene import Scene
from benchmarks.scenes import GARMENT_SCENES, SCENES, all_scenes, further_scenes
from benchmarks.validation.case import METHOD
from benchmarks.validation.registry import CASES

if TYPE_CHECKING:
    from benchmarks.external.roll_out_option import RollOutOption
    from benchmarks.validation.case import Case

UNTRAINED = "networks are trained for a second garment where its scenes are named"


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Names and patterns by which cells are chosen, and all that they may name.

    full: whether suites are named. scenes, methods: names or patterns; empty means all that the suites list.
    user_scenes, user_methods: entries that are not the project's, named among these. roll_outs: stored ones,
    which meet each scene that is asked for. one_scene: as of a selection. fabric_scenes, fabric_cases: of a
    user's fabrics, textile tests and where SNUG's lies among them.
    """

    suites: tuple[str, ...]
    preset: Preset
    motions: Motions
    full: bool = False
    scenes: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    seeds: tuple[int, ...] = (0,)
    user_scenes: tuple[Scene, ...] = ()
    user_methods: tuple[MethodEntry, ...] = ()
    roll_outs: tuple[RollOutOption, ...] = ()
    one_scene: bool = False
    fabric_scenes: tuple[Scene, ...] = ()
    fabric_cases: tuple[Case, ...] = ()

    @cached_property
    def declared_scenes(self) -> dict[str, Scene]:
        """Name -> scene, of all that could be asked for. Raises DeclarationError where two have one name."""
        of = self.motions
        motions = dict.fromkeys((*of.measured, *of.test, *of.validation))
        dynamic = dict.fromkeys((*of.dynamic_measured, *of.dynamic_test, *of.dynamic_validation))
        declared = all_scenes(motions, dynamic, of.worn)
        taken = {case.name for case in CASES}
        for scene in self.user_scenes:
            if scene.name in taken:
                raise DeclarationError(
                    f"{scene.declared_in}: scene '{scene.name}': a case of the project has this name: "
                    "give it another"
                )
        return by_name("scene", (*declared.values(), *self.fabric_scenes, *self.user_scenes))

    @cached_property
    def declared_methods(self) -> dict[str, MethodEntry]:
        """Name -> method, of all that could be asked for."""
        return by_name("method", (*METHODS, *self.user_methods))

    @property
    def extent(self) -> Extent:
        """Naming scenes reaches all of each suite, and so does preset paper."""
        further = bool(self.scenes) or self.preset.further
        return Extent(self.preset, self.motions, self.full or further, further, self.fabric_scenes)


def choose_cells(selection: Selection) -> tuple[tuple[Cell, ...], tuple[Case, ...]]:
    """Return the cells and cases that a selection names.

    Raises:
        PlanError: a word that names nothing, a selection of nothing, a roll-out that cannot take part.
        DeclarationError: two scenes or methods of one name.
    """
    declared, methods = selection.declared_scenes, selection.declared_methods
    names = [case.name for case in (*CASES, *selection.fabric_cases)]
    _check_words("scene", selection.scenes, [*declared, *names])
    _check_words("method", selection.methods, list(methods))
    chosen: dict[tuple[str, str, int], Cell] = {}
    for suite, scene, entry in _pairs(selection):
        method = entry.name
        for seed in selection.seeds if entry.seeded else (0,):
            key = (scene, method, seed)
            before = chosen[key].suites if key in chosen else ()
            chosen[key] = Cell(declared[scene].at(selection.preset), entry, seed, (*before, suite))
    cases = () if selection.one_scene else tuple(_cases(selection))  # some have the name of a scene
    if not (chosen or cases):
        raise PlanError(_nothing_to_run(selection))
    if selection.one_scene and len({scene for scene, _, _ in chosen}) != 1:
        raise PlanError(f"{', '.join(selection.scenes)}: name one scene; see python -m benchmarks.run --list")
    stored = roll_out_cells(selection.roll_outs, tuple(chosen.values()))
    # The reference first: an error against it can be said as soon as another cell is done.
    order = {name: place for place, name in enumerate(methods)}
    places = {name: place for place, name in enumerate(declared)}
    last = len(order)
    cells = sorted(
        (*chosen.values(), *stored),
        key=lambda c: (places[c.scene.name], order.get(c.method, last), c.seed),
    )
    cells = _timed_once(cells)
    scenes = {cell.scene.name: cell.scene for cell in cells}
    settled = (*SCENES, *further_scenes(selection.motions.first_garment))  # those that any run may start from
    known = {scene.name: scene for scene in settled} | scenes
    for user_scene in (scene for scene in scenes.values() if scene.declared_in):
        _check_user_scene(user_scene, known, selection.motions)
    return tuple(cells), cases


def _timed_once(cells: Sequence[Cell]) -> list[Cell]:
    """Return the cells; of a garment's whole motions the first alone keeps its costs.

    Timed cells run one by one, the others side by side. What a frame costs, one motion tells.
    """
    untimed = tuple(name for name in MODULES if name != "cost")
    begun: dict[str, Scene] = {}
    kept = []
    for cell in cells:
        scene = cell.scene
        whole = scene.part == "whole" and scene.metrics is None and not scene.declared_in
        if whole and begun.setdefault(scene.garment, scene) != scene:
            cell = replace(cell, scene=replace(scene, metrics=untimed))
        kept.append(cell)
    return kept


def _nothing_to_run(selection: Selection) -> str:
    """Return the line that refuses an empty selection: its preset and suites, and the remedy."""
    preset = selection.preset.name
    suites = f"suite{'s' * (len(selection.suites) > 1)} {', '.join(selection.suites)}"
    line = f"nothing to run: at preset {preset} no such scene meets such a method in {suites}"
    everywhere = replace(selection, suites=SUITE_NAMES, full=True)
    for suite in SUITE_NAMES:
        in_suite = replace(everywhere, suites=(suite,))
        if any(any(part(in_suite)) for part in (_pairs, _cases)):
            return f"{line}; --suite {suite} has them"
    methods = list(dict.fromkeys(entry.name for *_, entry in _pairs(replace(everywhere, methods=()))))
    if selection.scenes and methods:
        return f"{line}; methods of these scenes are {', '.join(methods[:6])}{', ...' * bool(methods[6:])}"
    return f"{line}; see --list --preset {preset}"


def _check_user_scene(scene: Scene, known: Mapping[str, Scene], motions: Motions) -> None:
    """Raise PlanError for a start or a motion that a user's scene names and nobody knows."""
    chain, last = {scene.name}, scene
    while last.start_of:
        before = known.get(last.start_of)
        if before is None or not before.simulated or before.name in chain:
            others = [name for name, other in known.items() if other.simulated and name not in chain]
            raise PlanError(
                f"{last.declared_in}: scene '{last.name}': start_of='{last.start_of}': name another scene "
                f"whose garment settles, of the run or without a motion; {nearest(last.start_of, others)}"
            )
        chain.add(before.name)
        last = before
    if scene.dressed:
        from snug.motion.library import LIBRARY  # loads numpy

        if scene.motion not in (names := [*motions.files, *LIBRARY]):
            raise PlanError(
                f"{scene.declared_in}: scene '{scene.name}': no motion is called '{scene.motion}'; "
                f"{nearest(scene.motion, names)}"
            )


def _pairs(selection: Selection) -> Iterator[tuple[str, str, MethodEntry]]:
    """Yield (suite, scene, method), suite by suite; a method that is left out of a scene says why.

    A scene that no suite lists is met where it is named: a body in a whole motion in garments, all else in
    speed. A method that no suite lists takes part in each suite where its whole name is given.
    """
    extent, declared = selection.extent, selection.declared_scenes
    unlisted = _unlisted_scenes(selection)
    user_methods = set(selection.methods) & set(selection.declared_methods) - _listed_methods()
    for suite in SUITES:
        listed = suite.scenes(extent)
        if suite.name not in selection.suites or not suite.methods(extent):
            continue
        more = suite.more_methods if selection.methods or selection.preset.further else ()
        further = suite.named_methods if selection.methods else ()
        asked = replace(extent, full=extent.full or bool(selection.methods))
        methods = dict.fromkeys((*suite.methods(asked), *more, *further, *sorted(user_methods)))
        for scene in (*listed, *(name for name, home in unlisted.items() if home == suite.name)):
            # Networks for a second garment double the training: only for whoever names its scenes.
            plain = not extent.further and declared[scene].garment not in ("", extent.motions.first_garment)
            for method in methods:
                if not (named(scene, selection.scenes) and named(method, selection.methods)):
                    continue
                entry = selection.declared_methods[method]
                if entry.meant_for(declared[scene]):
                    if plain and entry.trained:
                        entry = replace(entry, left_out=UNTRAINED)
                    yield suite.name, scene, entry


def _cases(selection: Selection) -> Iterator[Case]:
    """Yield the cases of the suites; none where methods are named without the simulation.

    The smallest preset runs those marked, unless they are named, and a run that names no suite those that
    are not long.
    """
    if named(METHOD, selection.methods):
        for case in (*CASES, *selection.fabric_cases):
            small = case.smoke or selection.scenes or not selection.preset.smallest
            short = selection.extent.full or not case.long
            if small and short and case.suite in selection.suites and named(case.name, selection.scenes):
                yield case


def named(name: str, patterns: Sequence[str]) -> bool:
    """Return whether some pattern means that name; without patterns all are meant.

    >>> named("tshirt/kick", ["tshirt/*"]), named("flag", []), named("flag", ["tshirt/*"])
    (True, True, False)
    """
    return not patterns or name in patterns or any(fnmatchcase(name, pattern) for pattern in patterns)


def default_suites(method: str, preset: Preset) -> list[str]:
    """Return the suites in which a method takes part at that preset without being named."""
    return [suite.name for suite in SUITES if method in suite.methods(Extent(preset, Motions()))]


def _unlisted_scenes(selection: Selection) -> dict[str, str]:
    """Return scenes that no suite lists -> the suite that takes them.

    They are called by their whole names, or by a pattern that no listed scene has, as 'trousers/*', which
    means the motions of the split.
    """
    motions = selection.motions
    everything = Extent(selection.preset, motions, full=True, further=True)
    listed = {name for suite in SUITES for name in suite.scenes(everything)}
    patterns = [p for p in selection.scenes if not any(named(name, [p]) for name in listed)]

    def asked(scene: Scene) -> bool:
        return scene.name in selection.scenes or (
            any(named(scene.name, [p]) for p in patterns)
            and scene.dressed
            and scene.motion in motions.measured_of(scene.garment)
        )

    return {
        name: "garments" if scene.part == "whole" else "speed"
        for name, scene in selection.declared_scenes.items()
        if name not in listed and asked(scene)
    }


def _listed_methods() -> set[str]:
    """Return every method that some suite lists at some preset."""
    extents = [Extent(preset, Motions(), full=True) for preset in PRESETS]

    def of_suite(suite: Suite) -> set[str]:
        return {
            *suite.more_methods,
            *suite.named_methods,
            *(name for extent in extents for name in suite.methods(extent)),
        }

    return set().union(*map(of_suite, SUITES))


def choose_suites(names: Sequence[str]) -> tuple[str, ...]:
    """Return the suites named, "all" meaning each; without names those of a default run. Raises PlanError."""
    for name in names:
        if name not in (*SUITE_NAMES, "all"):
            known = ", ".join((*SUITE_NAMES, "all"))
            raise PlanError(f"--suite: unknown suite '{name}'; choose from {known}")
    chosen = names or [suite.name for suite in SUITES if suite.default]
    return tuple(name for name in SUITE_NAMES if "all" in chosen or name in chosen)


def names_no_motion(scenes: Sequence[str], user_scenes: Sequence[Scene] = ()) -> bool:
    """Return whether a choice names scenes without a body and cases alone."""
    known = {scene.name for scene in (*all_scenes((), ()).values(), *user_scenes) if not scene.dressed}
    known |= {case.name for case in CASES}
    return bool(scenes) and known.issuperset(scenes)


def _check_words(what: str, patterns: Sequence[str], names: Sequence[str]) -> None:
    for pattern in patterns:
        if not any(named(name, [pattern]) for name in names):
            hint = ""
            if what == "scene" and pattern.partition("/")[0] in {g.garment for g in GARMENT_SCENES}:
                hint = " (scenes of a dressed body are the validation and test motions: see --test-motions)"
            raise PlanError(f"unknown {what} '{pattern}'; {nearest(pattern, names)}{hint}")
