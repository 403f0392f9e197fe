"""The text of --list: every name that the command knows."""

from __future__ import annotations

from collections.abc import Iterable

from .meetings import default_suites
from .method import MethodEntry
from .methods import METHODS
from .presets import PRESETS, find_preset
from .results import CLIP
from .scenes import SMALL_SCENES, WORN
from .studies import STUDIES
from .suites import SUITES
from .suites.extremes import MAPS, REFUSALS, STEPS
from .suites.validation import CHECKS


def listing() -> str:
    """Suites, scenes, methods, motions and presets, one line each."""
    from snug.motion_library import DYNAMIC_TEST, DYNAMIC_TRAIN, TEST, TRAIN

    dressed = [
        (wear.prefix + name, f"a body in {wear.words}; unseen in training")
        for wear in WORN
        for name in (DYNAMIC_TEST if wear.swings else (*TEST, *DYNAMIC_TEST))
    ]
    parts = (
        ("suites", ((s.name, s.description) for s in SUITES)),
        (
            f"scenes; of a dressed body also its liveliest part, as {dressed[0][0]}{CLIP}",
            [*((s.name, s.description) for s in SMALL_SCENES), *dressed],
        ),
        (
            "methods, and the suites in which they take part without being named",
            ((m.name, f"{m.description} {_where(m)}") for m in METHODS),
        ),
        ("training motions", ((name, "") for name in TRAIN)),
        ("training motions of garments that swing", ((name, "") for name in DYNAMIC_TRAIN)),
        ("presets", ((p.name, p.description) for p in PRESETS)),
        ("validation checks", ((c.name, c.description) for c in CHECKS)),
        ("extreme cases", [*((c.name, c.description) for c in (*STEPS, *REFUSALS)), *map(_map, MAPS)]),
        ("studies", ((s.name, f"{s.suite}: {s.description}") for s in STUDIES)),
    )
    return "\n\n".join(_section(title, rows) for title, rows in parts)


def _where(method: MethodEntry) -> str:
    suites = default_suites(method.name, find_preset("quick"))
    return f"[{', '.join(suites)}]" if suites else "[when named]"


def _map(name: str) -> tuple[str, str]:
    cases = MAPS[name]
    return f"{name}/*", f"{len(cases)} points over stiffness and time step, {cases[0].name} the first"


def _section(title: str, rows: Iterable[tuple[str, str]]) -> str:
    rows = list(rows)
    if not any(description for _, description in rows):
        return f"{title}\n  {', '.join(name for name, _ in rows)}"
    width = max(len(name) for name, _ in rows)
    return "\n".join([title, *(f"  {name:<{width}}  {description}".rstrip() for name, description in rows)])
