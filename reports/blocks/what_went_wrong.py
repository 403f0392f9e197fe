"""Sentences on failures: how many cells ended how, the worst by name, files that could not be read."""

from __future__ import annotations

from reports.blocks.printed_tables import cut
from reports.run.finished_run import Run
from reports.statistics.outcomes import BAD, STRAIN, counted, overstretched
from reports.tables.number_texts import number

MOST = 5  # failures on page one
FILES = 12  # names of files that could not be read


def worst(run: Run) -> list[tuple[str, str]]:
    """Say what went worst: counts of endings, then single failures by name."""
    counts = endings(run)
    if run.problems:
        counts += f" {len(run.problems)} files could not be read: see the end."
    named = [(name, cut(event)) for name, event in failures(run)]
    return [("What went worst", counts), *named] if counts or named else []


def endings(run: Run) -> str:
    """Say how many cells, checks and stress tests ended how, with every kind that is not ok."""
    parts = []
    for kind, counts in counted(run).items():
        bad = [f"{counts[name]} {name}" for name in (*BAD, "skipped") if counts[name]]
        parts.append(f"of {sum(counts.values()):,} {kind} {', '.join(bad) if bad else 'all ended well'}")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def failures(run: Run) -> list[tuple[str, str]]:
    """Name the worst: failed cells and checks first, then stress tests, then overstretched networks.

    There are MOST of them in all, some of each kind.
    """
    rows = run.frame[run.frame["status"].isin(BAD)]
    rows = rows.assign(rank=rows["status"].map(BAD.index)).sort_values("rank", kind="stable")
    rows = rows.drop_duplicates(["scene", "method", "seed"])
    is_case = rows["case"] != ""
    kinds: list[list[tuple[str, str]]] = [
        [
            (
                f"{run.label(row.method)}, {row.scene}" + (f", seed {row.seed}" if row.seed else ""),
                f"{row.status}: {row.reason}",
            )
            for row in part.itertuples()
        ]
        for part in (rows[~is_case], rows[is_case])
    ]
    kinds.append(
        [
            (
                f"{run.label(method)}, {scene}",
                f"{STRAIN[metric]} {number(strain)} J, {number(ratio)} times the simulation's",
            )
            for method, scene, metric, strain, ratio in overstretched(run)[:3]
        ]
    )
    chosen: list[tuple[str, str]] = []
    for left, kind in zip((3, 2, 1), kinds):
        chosen += kind[: max((MOST - len(chosen)) // left, 1)]
    return chosen[:MOST]


def unread_files(run: Run) -> list[tuple[str, str]]:
    """Name the files of the run that could not be read."""
    more = [f"and {len(run.problems) - FILES} more"] if len(run.problems) > FILES else []
    files = "; ".join([*run.problems[:FILES], *more])
    return [("Files of this run that could not be read, missing above", files)] if files else []
