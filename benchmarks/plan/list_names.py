"""The text of --list: every name that the command knows, and what a study takes of them."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.methods.catalogue.all_methods import METHODS
from benchmarks.plan.choose_cells import expanded, matching
from benchmarks.plan.motion_split import split_motions
from benchmarks.plan.read_study import read_study, study_names
from benchmarks.plan.study import Study
from benchmarks.presets import PRESETS
from benchmarks.scenes import FURTHER_SCENES, GARMENT_SCENES, SCENES
from benchmarks.scenes.variations import shapes, there_and_back
from benchmarks.validation.registry import CASES


def list_names(study: Study) -> str:
    """Return studies, scenes, methods, motions, sizes and cases, one line each.

    Every scene and method can be named in every study. Those that take part without being named are those of
    the given study.
    """
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
    plain = (*SCENES, there_and_back(TEST[0]), *shapes(TEST[0]), *FURTHER_SCENES)
    motions = split_motions(study)
    found = [
        *dict.fromkeys((*(s.name for s in plain), *(n + clip for n, _ in dressed for clip in ("", "@clip"))))
    ]
    taken = {name: matching(found, expanded(part.scenes, motions)) for name, part in study.parts.items()}
    parts = (
        ("studies", ((name, read_study(name).question) for name in study_names())),
        ("parts of this study", ((name, part.question) for name, part in study.parts.items())),
        ("scenes of each part where none is named", ((n, ", ".join(s)) for n, s in taken.items() if s)),
        (
            f"scenes; of a dressed body, in a test or validation motion, also its liveliest part, as "
            f"{dressed[0][0]}@clip",
            [*((s.name, s.description) for s in plain), *dressed],
        ),
        (
            "methods, and the parts in which they take part without being named",
            ((m.name, f"{m.description} [{_parts_of(m.name, study) or 'when named'}]") for m in METHODS),
        ),
        (
            "training motions",
            ((name, f"{CLIPS[name].content}, {CLIPS[name].frames} frames") for name in TRAIN),
        ),
        ("motions without a role", ((name, "") for name in CONTROL)),
        ("sizes", ((p.name, p.description) for p in PRESETS)),
        *((f"cases of part {name}", _cases(name)) for name in dict.fromkeys(c.suite for c in CASES)),
    )
    return "\n\n".join(_section(title, rows) for title, rows in parts)


def _parts_of(method: str, study: Study) -> str:
    return ", ".join(name for name, part in study.parts.items() if matching([method], part.methods))


def _cases(suite: str) -> list[tuple[str, str]]:
    """Return the cases of a suite; those of an engine, which share a scene, in one line."""
    by_scene: dict[str, list[str]] = {}
    for case in (case for case in CASES if case.suite == suite):
        by_scene.setdefault(f"{case.scene}/*" if case.scene else case.name, []).append(case.description)
    return [(name, f"{len(d)} points, {d[0]} the first" if d[1:] else d[0]) for name, d in by_scene.items()]


def _section(title: str, rows: Iterable[tuple[str, str]]) -> str:
    rows = list(rows)
    if not any(description for _, description in rows):
        return f"{title}\n  {', '.join(name for name, _ in rows)}"
    width = max(len(name) for name, _ in rows)
    return "\n".join([title, *(f"  {name:<{width}}  {description}".rstrip() for name, description in rows)])
