"""Which scenes meet which methods: what the suites list, and what is called by its whole name."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from .methods import METHODS, find_method
from .presets import PRESETS, Preset
from .results import CLIP
from .scene import Scene
from .scenes import TSHIRT

if TYPE_CHECKING:
    from .plan import Motions

MEETINGS = ("garments", "speed")  # suites in which scenes meet methods


def meetings(
    suites: Sequence[str],
    declared: dict[str, Scene],
    *,
    full: bool,
    preset: Preset,
    motions: Motions,
    scenes: Sequence[str],
    methods: Sequence[str],
) -> Iterator[tuple[str, str, str]]:
    """(suite, scene, method), suite by suite. scenes and methods are names or patterns; empty means all.

    Naming scenes reaches all of each suite. A scene that no suite lists is met where its whole name is given:
    a body in a whole motion in garments, all else in speed. A method that no suite lists takes part in each
    suite where its whole name is given.
    """
    full, further = full or bool(scenes), bool(scenes) or preset.further
    loose_scenes = _unlisted_scenes(declared, motions, scenes)
    loose_methods = set(methods) & {entry.name for entry in METHODS} - _listed_methods()
    for suite in MEETINGS:
        if suite not in suites:
            continue
        module = _module(suite)
        others = module.FURTHER if methods or preset.further else ()
        meeting = (*module.methods(preset.newton_cuts), *others, *sorted(loose_methods))
        listed = module.scenes(motions.test, motions.swing_test, full=full, further=further)
        for scene in (*listed, *(name for name, home in loose_scenes.items() if home == suite)):
            # Networks for a second garment double the training: only for whoever names its scenes.
            plain = not further and declared[scene].garment not in ("", TSHIRT)
            for method in meeting:
                if not (named(scene, scenes) and named(method, methods)):
                    continue
                if not (plain and find_method(method).trained):
                    yield suite, scene, method


def named(name: str, patterns: Sequence[str]) -> bool:
    """Whether some pattern means that name; without patterns all are meant."""
    return not patterns or any(fnmatchcase(name, pattern) for pattern in patterns)


def default_suites(method: str, preset: Preset) -> list[str]:
    """The suites in which a method takes part at that preset without being named."""
    return [suite for suite in MEETINGS if method in _module(suite).methods(preset.newton_cuts)]


def _unlisted_scenes(declared: dict[str, Scene], motions: Motions, scenes: Sequence[str]) -> dict[str, str]:
    """Scenes called by their whole names that no suite lists -> the suite that takes them."""
    own = motions.test, motions.swing_test
    listed = {name for suite in MEETINGS for name in _module(suite).scenes(*own, full=True, further=True)}
    return {
        name: "garments" if scene.dressed and not name.endswith(CLIP) else "speed"
        for name, scene in declared.items()
        if name in scenes and name not in listed
    }


def _listed_methods() -> set[str]:
    """Every method that some suite lists at some preset."""
    cuts = [preset.newton_cuts for preset in PRESETS]
    modules = [_module(suite) for suite in MEETINGS]
    return {
        name
        for module in modules
        for own in (module.FURTHER, *(module.methods(cut) for cut in cuts))
        for name in own
    }


def _module(suite: str) -> Any:
    return importlib.import_module(f"benchmarks.suites.{suite}")
