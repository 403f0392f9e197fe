"""Which scenes meet which methods in a study: its cells; beside them its known answers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from benchmarks.method import MethodEntry
from benchmarks.metrics import measured_in
from benchmarks.plan.cell import Cell
from benchmarks.plan.motions import Motions
from benchmarks.plan.study import Part, Study, StudyError, nearest
from benchmarks.scene import Scene
from benchmarks.scenes import GARMENT_SCENES, SCENES, all_scenes, further_scenes
from benchmarks.validation.case import METHOD, Case

UNTRAINED = "networks are trained for a second garment where its scenes are named"
SETS = ("{smoke}", "{short}")  # of cases
PLACES = re.compile(r"\{(motion|swinging)(?: (\d+))?\}")


@dataclass(frozen=True)
class Declared:
    """All that could be asked for: scenes and methods of the project and of a user, known answers."""

    scenes: Mapping[str, Scene]
    methods: Mapping[str, MethodEntry]
    cases: tuple[Case, ...]


def choose_cells(
    study: Study, motions: Motions, declared: Declared
) -> tuple[tuple[Cell, ...], tuple[Case, ...]]:
    """Return the cells and cases that a study names.

    Raises:
        StudyError: a word that names nothing, a choice of nothing, a roll-out that cannot take part.
    """
    _check_words(study, motions, declared)
    chosen: dict[tuple[str, str, int], Cell] = {}
    for part, scene, entry in _pairs(study, motions, declared):
        for seed in study.seeds if entry.seeded else (0,):
            key = (scene.name, entry.name, seed)
            before = chosen[key].suites if key in chosen else ()
            chosen[key] = Cell(scene.at(study.sizes), entry, seed, (*before, part))
    cases = tuple(_cases(study, declared.cases))
    if not (chosen or cases):
        raise StudyError(
            f"nothing to run: no such scene meets such a method in part{'s' * (len(study.parts) > 1)} "
            f"{', '.join(study.parts)}; see --list, or name another study"
        )
    stored = roll_out_cells(study, tuple(chosen.values()), declared)
    # The reference first: an error against it can be said as soon as another cell is done.
    order = {name: place for place, name in enumerate(declared.methods)}
    places = {name: place for place, name in enumerate(declared.scenes)}
    cells = sorted(
        (*chosen.values(), *stored),
        key=lambda c: (places[c.scene.name], order.get(c.method, len(order)), c.seed),
    )
    cells = _timed_once(cells)
    scenes = {cell.scene.name: cell.scene for cell in cells}
    settled = (*SCENES, *further_scenes(motions.first_garment))  # those that any run may start from
    known = {scene.name: scene for scene in settled} | scenes
    for user_scene in (scene for scene in scenes.values() if scene.declared_in):
        _check_user_scene(user_scene, known, motions)
    return tuple(cells), cases


def matching(names: Iterable[str], patterns: Sequence[str]) -> list[str]:
    """Return the names that some pattern means, without those that one beginning with ! means.

    >>> matching(["snug", "snug-no-noise", "snug+cleanup"], ["snug*", "!*+*"])
    ['snug', 'snug-no-noise']
    """
    unwanted = [pattern[1:] for pattern in patterns if pattern.startswith("!")]
    wanted = [pattern for pattern in patterns if not pattern.startswith("!")] or ["*"] * bool(unwanted)
    return [name for name in names if _means(name, wanted) and not _means(name, unwanted)]


def _means(name: str, patterns: Sequence[str]) -> bool:
    return name in patterns or any(fnmatchcase(name, pattern) for pattern in patterns)


def _pairs(study: Study, motions: Motions, declared: Declared) -> Iterator[tuple[str, Scene, MethodEntry]]:
    """Yield (part, scene, method), part by part; a method that is left out of a scene says why."""
    scenes = _scenes(study, motions, declared.scenes)
    listed = {name for part in study.parts.values()
              for name in matching(declared.methods, (*part.methods, *part.optional_methods))}  # fmt: skip
    unlisted = [name for name in study.methods if name in declared.methods and name not in listed]
    for name, part in study.parts.items():
        methods = matching(declared.methods, part.methods)
        if study.methods:
            methods += [*matching(declared.methods, part.optional_methods), *unlisted]
            methods = matching(dict.fromkeys(methods), study.methods)
        untrained = [] if study.scenes else matching(scenes[name], part.untrained)
        for scene in (declared.scenes[scene] for scene in scenes[name]):
            for entry in (declared.methods[method] for method in methods):
                if entry.meant_for(scene):
                    left_out = UNTRAINED if scene.name in untrained and entry.trained else entry.left_out
                    yield name, scene, replace(entry, left_out=left_out)


def _scenes(study: Study, motions: Motions, declared: Mapping[str, Scene]) -> dict[str, list[str]]:
    """Return part -> names of its scenes.

    A scene that field `scenes` names and no part lists is met in the first part with a scene of its kind:
    called by its whole name (without such a part in the first), or in a motion of the split by a pattern that
    no listed scene has, as 'trousers/*'.
    """
    usual = {name: matching(declared, expanded(part.scenes, motions)) for name, part in study.parts.items()}
    if not study.scenes:
        return usual
    listed = {name: [*usual[name], *matching(declared, expanded(part.optional_scenes, motions))]
              for name, part in study.parts.items()}  # fmt: skip
    every = {name for names in listed.values() for name in names}
    chosen = {part: matching(dict.fromkeys(names), study.scenes) for part, names in listed.items()}
    fresh = [pattern for pattern in study.scenes if not matching(every, [pattern])]
    kinds = {part: {declared[name].part for name in names} for part, names in usual.items()}
    for name in matching(declared, study.scenes):
        scene = declared[name]
        homes = [part for part in kinds if scene.part in kinds[part]]
        if name in study.scenes:
            homes += [*kinds][:1]
        elif not (scene.dressed and scene.motion in motions.measured_of(scene.garment)
                  and matching([name], fresh)):  # fmt: skip
            continue
        if name not in every and homes:
            chosen[homes[0]].append(name)
    return chosen


def expanded(patterns: Sequence[str], motions: Motions) -> list[str]:
    """Return the patterns of a part with garment and motions of a run in their places."""
    found = []
    for pattern in patterns:
        pattern = pattern.replace("{garment}", motions.first_garment)
        if not (place := PLACES.search(pattern)):
            found.append(pattern)
            continue
        garment = pattern.partition("/")[0].removeprefix("!")
        names = motions.measured_of(garment) if place[1] == "motion" else motions.dynamic_measured
        if place[2]:
            names = names[int(place[2]) - 1 : int(place[2])]
        found += [PLACES.sub(name.replace("\\", "\\\\"), pattern) for name in names]
    return found


def _timed_once(cells: Sequence[Cell]) -> list[Cell]:
    """Return the cells; of a garment's whole motions the first alone keeps its costs.

    Timed cells run one by one, the others side by side. What a frame costs, one motion tells.
    """
    untimed = tuple(m.name for m in measured_in(None) if m.name != "cost")
    begun: dict[str, Scene] = {}
    kept = []
    for cell in cells:
        scene = cell.scene
        whole = scene.part == "whole" and scene.metrics is None and not scene.declared_in
        if whole and begun.setdefault(scene.garment, scene) != scene:
            cell = replace(cell, scene=replace(scene, metrics=untimed))
        kept.append(cell)
    return kept


def _cases(study: Study, cases: Sequence[Case]) -> Iterator[Case]:
    """Yield the cases of the parts; none where methods are named without the simulation."""
    if study.methods and not matching([METHOD], study.methods):
        return
    for case in cases:
        part = study.parts.get(case.suite, Part())
        sets = {"{smoke}": case.smoke and not case.long, "{short}": not case.long}
        words = [case.name if sets.get(word) else word for word in part.cases]
        if part.cases and matching([case.name], study.scenes or words):
            yield case


def _check_user_scene(scene: Scene, known: Mapping[str, Scene], motions: Motions) -> None:
    """Raise StudyError for a start or a motion that a user's scene names and nobody knows."""
    chain, last = {scene.name}, scene
    while last.start_of:
        before = known.get(last.start_of)
        if before is None or not before.simulated or before.name in chain:
            others = [name for name, other in known.items() if other.simulated and name not in chain]
            raise StudyError(
                f"{last.declared_in}: scene '{last.name}': start_of='{last.start_of}': name another scene "
                f"whose garment settles, of the run or without a motion; {nearest(last.start_of, others)}"
            )
        chain.add(before.name)
        last = before
    if scene.dressed:
        from snug.motion.library import LIBRARY  # loads numpy

        if scene.motion not in (names := [*motions.files, *LIBRARY]):
            raise StudyError(
                f"{scene.declared_in}: scene '{scene.name}': no motion is called '{scene.motion}'; "
                f"{nearest(scene.motion, names)}"
            )


def _check_words(study: Study, motions: Motions, declared: Declared) -> None:
    """Raise StudyError for a word of a field that nothing has as its name."""
    cases = [case.name for case in declared.cases]
    scenes, methods = list(declared.scenes), list(declared.methods)
    words: list[tuple[tuple[str, ...], Sequence[str], Sequence[str]]]
    words = [(("scenes",), study.scenes, [*scenes, *cases]), (("methods",), study.methods, methods)]
    # Scenes that tailor a T-shirt themselves are none of a run with another garment.
    scenes = list(dict.fromkeys((*scenes, *all_scenes((), ()))))
    for name, part in study.parts.items():
        words += [
            (("parts", name, "scenes"), expanded((*part.scenes, *part.optional_scenes), motions), scenes),
            (("parts", name, "methods"), (*part.methods, *part.optional_methods), methods),
            (("parts", name, "cases"), part.cases, [*cases, *SETS]),
        ]
    for field, patterns, known in words:
        for word in patterns:
            if matching(known, [word.removeprefix("!")]):
                continue
            what, hint = field[-1].removesuffix("s"), ""
            if what == "scene" and word.partition("/")[0] in {g.garment for g in GARMENT_SCENES}:
                hint = " (scenes of a dressed body are the validation and test motions: see test_motions)"
            raise StudyError(f"{study.place(*field)}: unknown {what} '{word}'; {nearest(word, known)}{hint}")


def roll_out_cells(study: Study, cells: Sequence[Cell], declared: Declared) -> list[Cell]:
    """Return the cells of stored roll-outs: each meets the scenes for which it has a file, in their parts.

    Raises:
        StudyError: a name that a method has, or a file of one scene where several are asked for.
        RollOutFileError: a file that cannot be read.
    """
    if not study.rollouts:
        return []
    from benchmarks.methods.outside import entry_of  # loads numpy

    scenes = {cell.scene.name: cell.scene for cell in cells if not cell.scene.networks_only}
    suites: dict[str, tuple[str, ...]] = {}
    for cell in cells:
        suites[cell.scene.name] = tuple(dict.fromkeys((*suites.get(cell.scene.name, ()), *cell.suites)))
    stored: list[Cell] = []
    for option in study.rollouts.values():
        what = f"{option.name}={option.path}"
        if option.name in declared.methods:
            raise StudyError(f"{what}: a method is called {option.name}: give another name, as in NAME=FILE")
        if len(scenes) != 1 and not option.places:
            raise StudyError(
                f"{what}: is of one scene, and {len(scenes)} are asked for: name it with --scenes, or put "
                "{scene} into the path"
            )
        entries = {name: entry for name in scenes if (entry := entry_of(option, name))}
        if not entries:
            raise StudyError(f"{what}: no file for {', '.join(scenes)}")
        stored += [Cell(scenes[name], entry, 0, suites[name]) for name, entry in entries.items()]
    return stored
