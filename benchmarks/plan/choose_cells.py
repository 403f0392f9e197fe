"""Which scenes meet which methods in a study: its cells; and its known answers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from benchmarks.assets import Inputs
from benchmarks.external.roll_out_files import PLACE
from benchmarks.method import MethodEntry
from benchmarks.methods.own_energies import find_own_reference
from benchmarks.metrics import pick_measured
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.plan.study import Part, Study, StudyError, nearest
from benchmarks.scene import Scene
from benchmarks.scenes import all_scenes, dress_scenes
from benchmarks.validation.case import METHOD, Case
from snug.motion.library import LIBRARY

SETS = ("{smoke}", "{short}")  # of cases
PLACES = re.compile(r"\{(motion|swinging)(?: (\d+))?\}")


@dataclass(frozen=True)
class ReadStudy:
    """A study without files, and all of project and user that it could name."""

    study: Study
    inputs: Inputs
    motions: Motions
    scenes: Mapping[str, Scene]
    methods: Mapping[str, MethodEntry]
    cases: tuple[Case, ...]


def choose_cells(scope: ReadStudy) -> tuple[tuple[Cell, ...], tuple[Case, ...]]:
    """Return the cells and cases of a study: the product of its scenes and methods, by part.

    Raises:
        StudyError: a word or a choice of nothing, a roll-out that cannot take part.
    """
    study = scope.study
    _check_words(scope)
    chosen: dict[tuple[str, str, int], Cell] = {}
    for name, scenes in scenes_of_parts(scope).items():
        usual = matching(scope.methods, study.parts[name].methods)
        methods = choose(scope.methods, study.methods, usual)
        pairs = ((scope.scenes[scene], scope.methods[method]) for scene in scenes for method in methods)
        for scene, entry in (pair for pair in pairs if pair[1].is_meant_for(pair[0])):
            one_seed = bool(matching([entry.name], study.one_seed))
            for seed in study.seeds[: 1 if one_seed else None] if entry.seeded else (0,):
                key = (scene.name, entry.name, seed)
                before = chosen[key].suites if key in chosen else ()
                chosen[key] = Cell(scene.at(study.sizes), entry, seed, (*before, name))
    chosen |= find_own_references(chosen)
    cases = tuple(_cases(study, scope.cases))
    if not (chosen or cases):
        raise StudyError(
            f"nothing to run: no such scene meets such a method in part{'s' * (len(study.parts) > 1)} "
            f"{', '.join(study.parts)} (some are for networks alone); see --list, or name another study"
        )
    stored = roll_out_cells(study, tuple(chosen.values()), scope.methods)
    # The reference first: errors against it are known when another cell is done.
    places = {name: place for place, name in enumerate(scope.scenes)}
    order = {name: place for place, name in enumerate((*scope.methods, *study.rollouts))}
    unsorted = (*chosen.values(), *stored)
    ordered = sorted(unsorted, key=lambda c: (places[c.scene.name], order.get(c.method, 0), c.seed))
    cells = _time_once(ordered)
    _check_user_scenes([cell.scene for cell in cells], scope.motions)
    return tuple(cells), cases


def find_own_references(chosen: Mapping[tuple[str, str, int], Cell]) -> dict[tuple[str, str, int], Cell]:
    """Return simulations of methods' own energies, where the reference runs and these count."""
    compared = {c.scene.name for c in chosen.values() if c.entry.role == "reference"}
    added = {}
    for cell in chosen.values():
        counts = any(m.name == "own_energies" for m in pick_measured(cell.scene.metrics))
        entry = find_own_reference(cell.entry) if counts and cell.scene.name in compared else None
        if entry and (key := (cell.scene.name, entry.name, 0)) not in chosen:
            added[key] = replace(cell, entry=entry, seed=0)
    return added


def matching(names: Iterable[str], patterns: Sequence[str]) -> list[str]:
    """Return the names that a pattern means, without those of one that begins with !.

    >>> matching(["snug", "snug-no-noise", "snug+cleanup"], ["snug*", "!*+*"])
    ['snug', 'snug-no-noise']
    """
    excluded = [pattern[1:] for pattern in patterns if pattern.startswith("!")]
    included = [pattern for pattern in patterns if not pattern.startswith("!")] or ["*"] * bool(excluded)
    return [name for name in names if _means(name, included) and not _means(name, excluded)]


def choose(names: Iterable[str], patterns: Sequence[str], usual: list[str]) -> list[str]:
    """Return the names that patterns mean; without any, or of ! alone, those of `usual`.

    >>> choose(["a", "b", "c"], ["!b"], ["a", "b"])
    ['a']
    """
    wanted = any(not pattern.startswith("!") for pattern in patterns)
    return matching(names if wanted else usual, patterns) if patterns else usual


def _means(name: str, patterns: Sequence[str]) -> bool:
    return name in patterns or any(fnmatchcase(name, pattern) for pattern in patterns)


def scenes_of_parts(scope: ReadStudy) -> dict[str, list[str]]:
    """Return part -> names of its scenes.

    A scene that field `scenes` names and no part lists is met in the first part with a scene of its kind.
    """
    scenes, patterns, parts = scope.scenes, scope.study.scenes, scope.study.parts
    usual = {name: matching(scenes, expand(part.scenes, scope.motions)) for name, part in parts.items()}
    extras = {n: matching(scenes, expand(p.optional_scenes, scope.motions)) for n, p in parts.items()}
    listed = {name for group in (usual, extras) for names in group.values() for name in names}
    chosen = {n: choose(dict.fromkeys((*usual[n], *extras[n])), patterns, usual[n]) for n in parts}
    wanted = [p for p in patterns if not p.startswith("!")]
    strays = [p for p in wanted if p in scenes or not matching(listed, [p])]
    for name in matching(matching(scenes, strays), patterns) if set(strays) - listed else ():
        scene = scenes[name]
        of_split = scene.dressed and scene.motion in scope.motions.pick_motions(scene.garment)
        homes = [part for part in parts if scene.part in {scenes[n].part for n in usual[part]}]
        homes += list(parts) if name in patterns else []
        if name not in listed and homes and (name in patterns or of_split):
            chosen[homes[0]].append(name)
    return chosen


def expand(patterns: Sequence[str], motions: Motions) -> list[str]:
    """Return the patterns of a part with garment and motions of a run in place. Raises StudyError."""
    expanded = []
    for pattern in patterns:
        pattern = pattern.replace("{garment}", motions.garments[0].garment)
        if not (place := PLACES.search(pattern)):
            expanded.append(pattern)
            continue
        garment = pattern.partition("/")[0].removeprefix("!")
        roles = motions.roles(dynamic=True) if place[1] == "swinging" else motions.by_role(garment)
        names, number = roles[motions.split], int(place[2] or 1)
        if place[2] and not 1 <= number <= len(names):
            raise StudyError(f"{pattern}: there are {len(names)} such motions, counted from 1")
        names = names[: motions.few]
        names = names[number - 1 : number] if place[2] else names
        expanded += [pattern.replace(place[0], name) for name in names]
    return expanded


def _time_once(cells: Sequence[Cell]) -> list[Cell]:
    """Return the cells; of a garment's whole motions the first alone keeps its costs.

    Timed cells run one by one, others side by side. What a frame costs, one motion tells.
    """
    untimed = tuple(m.name for m in pick_measured(None) if m.name != "cost")
    begun: dict[str, Scene] = {}
    result = []
    for cell in cells:
        scene = cell.scene
        whole = scene.part == "whole" and scene.metrics is None and not scene.declared_in
        if whole and begun.setdefault(scene.garment, scene) != scene:
            cell = replace(cell, scene=replace(scene, metrics=untimed))
        result.append(cell)
    return result


def _cases(study: Study, cases: Sequence[Case]) -> Iterator[Case]:
    """Yield the cases of the parts; none where methods are named without the simulation."""
    if study.methods and not matching([METHOD], study.methods):
        return
    for case in cases:
        part = study.parts.get(case.suite, Part())
        sets = {"{smoke}": case.smoke and not case.long, "{short}": not case.long}
        names = [case.name if sets.get(word) else word for word in part.cases]
        if choose([case.name], study.scenes if part.cases else (), matching([case.name], names)):
            yield case


def _check_words(scope: ReadStudy) -> None:
    """Raise StudyError for a word of a field that nothing has as its name."""
    study, methods, cases = scope.study, list(scope.methods), [case.name for case in scope.cases]

    def check(field: str, choices: Sequence[str], names: Iterable[str]) -> None:
        for word in names:
            if not matching(choices, [word.removeprefix("!")]):
                kind, hint = field.rpartition(".")[2].removesuffix("s"), ""
                if kind == "scene" and "/" in word:
                    hint = " (scenes of a dressed body are validation and test motions: see test_motions)"
                raise StudyError(f"{field}: unknown {kind} '{word}'; {nearest(word, choices)}{hint}")

    check("scenes", [*scope.scenes, *cases], study.scenes)
    check("methods", methods, study.methods)
    check("one_seed", methods, study.one_seed)
    # Scenes that tailor a T-shirt themselves are none of a run with another garment.
    scenes = list({**scope.scenes, **all_scenes((), ())})
    for name, part in study.parts.items():
        patterns = expand((*part.scenes, *part.optional_scenes), scope.motions)
        check(f"parts.{name}.scenes", scenes, patterns)
        check(f"parts.{name}.methods", methods, part.methods)
        check(f"parts.{name}.cases", [*cases, *SETS], part.cases)


def _check_user_scenes(scenes: Sequence[Scene], motions: Motions) -> None:
    """Raise StudyError for an unknown start or motion of a user's scene."""
    starts = (*dress_scenes(motions.garments[0].garment), *scenes)
    settling = [scene.name for scene in starts if scene.simulated and not scene.start_of]
    for scene in (scene for scene in scenes if scene.declared_in):
        for field, names in (("start_of", settling), ("motion", [*motions.files, *LIBRARY])):
            needed = scene.dressed and field == "motion"
            if (word := getattr(scene, field)) not in names and (word or needed):
                place = f"{scene.declared_in}: scene '{scene.name}': {field}='{word}'"
                raise StudyError(f"{place}: nothing that serves is called so; {nearest(word, names)}")


def roll_out_cells(study: Study, cells: Sequence[Cell], methods: Mapping[str, MethodEntry]) -> list[Cell]:
    """Return the cells of stored roll-outs: each meets the scenes for which it has a file.

    Raises:
        StudyError: a name that a method has, or a file of one scene where several are asked for.
        RollOutFileError: a file that cannot be read.
    """
    if not study.rollouts:
        return []
    from benchmarks.methods.outside import entry_of  # loads numpy

    scenes: dict[str, Scene] = {}
    suites: dict[str, dict[str, None]] = {}
    for cell in (cell for cell in cells if not cell.scene.networks_only):
        scenes[cell.scene.name] = cell.scene
        suites.setdefault(cell.scene.name, {}).update(dict.fromkeys(cell.suites))
    stored: list[Cell] = []
    for option in study.rollouts.values():
        text = f"{option.name}={option.path}"
        if option.name in methods:
            raise StudyError(f"{text}: a method is called {option.name}: give another name")
        if len(scenes) != 1 and PLACE not in option.path:
            raise StudyError(
                f"{text}: is of one scene, and {len(scenes)} are asked for: name it with --scenes, or put "
                "{scene} into the path"
            )
        entries = {name: entry for name in scenes if (entry := entry_of(option, name))}
        if not entries:
            raise StudyError(f"{text}: no file for {', '.join(scenes)}")
        stored += [Cell(scenes[name], entry, 0, tuple(suites[name])) for name, entry in entries.items()]
    return stored
