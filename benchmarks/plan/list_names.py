"""The text of --list: every name that the command knows."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.method import MethodEntry
from benchmarks.methods.catalogue.all_methods import METHODS
from benchmarks.plan.choose_cells import Selection, choose_suites, default_suites
from benchmarks.plan.motion_split import split_motions
from benchmarks.plan.suites import SUITES
from benchmarks.presets import PRESETS, Preset
from benchmarks.scenes import FURTHER_SCENES, GARMENT_SCENES, SCENES
from benchmarks.scenes.variations import shapes, there_and_back
from benchmarks.validation.registry import CASES


def list_names(preset: Preset, suites: tuple[str, ...] = ()) -> str:
    """Return suites, scenes, methods, motions and presets, one line each.

    Every scene and method can be named at every preset. The scenes that take part without being named are
    those of the given preset and suites.

    Raises:
        PlanError: a suite that does not exist.
    """
    measured = [suite for suite in SUITES if suite.name in choose_suites(suites)]
    from snug.motion.library import CONTROL, DYNAMIC_TEST, DYNAMIC_VALIDATION, TEST, TRAIN, VALIDATION
    from snug.motion.recorded.table import CLIPS

    swinging = dict.fromkeys(DYNAMIC_TEST, "test") | dict.fromkeys(DYNAMIC_VALIDATION, "validation")
    roles = dict.fromkeys(TEST, "test") | dict.fromkeys(VALIDATION, "validation") | swinging
    dressed = [
        (scene.name, f"{scene.description} ({role})")
        for scenes in GARMENT_SCENES
        for motion, role in (swinging if scenes.dynamic else roles).items()
        for scene in (scenes.scene(motion),)
    ]
    extent = Selection(
        suites=suites, preset=preset, motions=split_motions((), (), preset), full=bool(suites)
    ).extent
    parts = (
        ("suites", ((s.name, s.description) for s in SUITES)),
        (
            f"scenes that preset {preset.name} measures in each suite where none is named",
            ((s.name, ", ".join(s.scenes(extent))) for s in measured if s.scenes(extent)),
        ),
        (
            "scenes; of a dressed body, in a test or validation motion, also its liveliest part, as "
            f"{dressed[0][0]}@clip",
            [
                *((s.name, s.description) for s in SCENES),
                *dressed,
                *((s.name, s.description) for s in map(there_and_back, TEST[:1])),
                *((s.name, s.description) for s in shapes(TEST[0])),
                *((s.name, s.description) for s in FURTHER_SCENES),
            ],
        ),
        (
            f"methods, and the suites in which they take part at preset {preset.name} without being named",
            ((m.name, f"{m.description} {_where(m, preset)}") for m in METHODS),
        ),
        (
            "training motions",
            ((name, f"{CLIPS[name].content}, {CLIPS[name].frames} frames") for name in TRAIN),
        ),
        ("motions without a role", ((name, "") for name in CONTROL)),
        ("presets", ((p.name, p.description) for p in PRESETS)),
        *((f"cases of suite {name}", _cases(name)) for name in dict.fromkeys(c.suite for c in CASES)),
    )
    return "\n\n".join(_section(title, rows) for title, rows in parts)


def _cases(suite: str) -> list[tuple[str, str]]:
    """Return the cases of a suite; those of an engine, which share a scene, in one line."""
    by_scene: dict[str, list[str]] = {}
    for case in (case for case in CASES if case.suite == suite):
        by_scene.setdefault(f"{case.scene}/*" if case.scene else case.name, []).append(case.description)
    return [(name, f"{len(d)} points, {d[0]} the first" if d[1:] else d[0]) for name, d in by_scene.items()]


def _where(method: MethodEntry, preset: Preset) -> str:
    suites = default_suites(method.name, preset)
    return f"[{', '.join(suites)}]" if suites else "[when named]"


def _section(title: str, rows: Iterable[tuple[str, str]]) -> str:
    rows = list(rows)
    if not any(description for _, description in rows):
        return f"{title}\n  {', '.join(name for name, _ in rows)}"
    width = max(len(name) for name, _ in rows)
    return "\n".join([title, *(f"  {name:<{width}}  {description}".rstrip() for name, description in rows)])
