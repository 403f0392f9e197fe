"""python -m reports.compare A B: changes from run A to run B beyond the noise of both; fails if worse.

Suite garments is compared by garment over its motions and seeds, and motion by motion; every other scene
by itself, over its seeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.results.row import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reports.comparison import HEADLINE, Comparison, compare
from reports.finished_run import Run, read_run
from reports.scene_changes import BETTER, FAILING, GONE, OTHER, WORSE
from reports.statistics.outcomes import PUBLISHED, read_published
from reports.statistics.relative_excess import RELATIVE_EXCESS
from reports.text.text_table import markdown_table

EXAMPLES = """examples:
  python -m reports.compare before after                chief metrics of each method; what is worse
  python -m reports.compare before after --metrics '*'  each change in a line
  python -m reports.compare before after --shared       of what both runs have

A mean of an answer has changed beyond 2 or 5 % and the noise of both runs, with p below 0.05; rules of times,
checks, single motions and single seeds: docs/notebook/statistics.md.

exit status: 0 nothing is worse or gone; 1 something is; 2 a folder is no run, or its results.csv is not of
  the digest in run.json, or the two share nothing or differ in preset, sizes, body or garment."""


@command("reports.compare")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.compare",
        description="Find changes between two runs beyond the noise of both; fail if results got worse.",
        epilog=EXAMPLES,
    )
    parser.add_argument("one", metavar="A", help="folder of the earlier run")
    parser.add_argument("other", metavar="B", help="folder of the later run")
    for name in ("metrics", "methods"):
        parser.add_argument(
            f"--{name}", metavar="NAME,...", help="only these (patterns), each change in a line"
        )
    parser.add_argument("--without-times", action="store_true", help="neither run times nor memory")
    parser.add_argument("--shared", action="store_true", help="leave out what B lacks")
    options = parser.parse_args(arguments)
    one, other = (read_run(RunFolder(path)) for path in (options.one, options.other))
    comparison = compare(
        one, other, options.metrics or "*", options.methods or "*",
        times=not options.without_times, shared=options.shared,
    )  # fmt: skip
    changes = list(comparison.changes)
    if short := not (options.metrics or options.methods):
        print("\n".join(_headline(comparison, one)))
        changes = [c for c in changes if c.verdict == WORSE and c.metric not in HEADLINE]
    for change in changes[: MOST_CHANGES if short else None]:
        print(f"{change.verdict:8}{change.place}  {change.method}  {change.metric}  {change.size}")
    order = (GONE, WORSE, BETTER, OTHER)
    counts = [f"{sum(c.verdict == v for c in comparison.changes)} {v}" for v in order]
    print(f"{comparison.compared} means compared: {', '.join(counts)}.")
    machines = [", ".join(run.machines) for run in (one, other)]
    if machines[0] != machines[1]:
        print(f"No times compared: A ran on {machines[0]}, B on {machines[1]}.")
    if short and comparison.changes:
        print("Each change: --metrics '*'")
    return 1 if any(change.verdict in FAILING for change in comparison.changes) else 0


def compare_published(run: Run, published: Path = PUBLISHED) -> str:
    """Return in a line how a run agrees with the published one of its study; empty without one.

    Networks of one seed are judged by the prediction interval of the published seeds.
    """
    study: dict[str, Any] = run.config.get("study") or {}
    folder = published / str(study.get("name")).partition(":")[0]
    if study.get("trained") or not RunFolder(folder).config_path.is_file():
        return ""
    try:
        comparison = compare(read_published(folder), run, times=False, shared=True)
    except ResultsError as error:
        return f"published: not compared ({error})"
    if not comparison.changes:
        return f"published: reproduced ({comparison.compared} means)"
    rows = dict.fromkeys(f"{run.label(c.method)} in {c.place}" for c in comparison.changes)
    names = ", ".join([*rows][:MOST_CHANGES]) + ", ..." * (len(rows) > MOST_CHANGES)
    return f"published: {len(comparison.changes)} numbers differ: {names}"


MOST_METHODS, MOST_CHANGES = 16, 8  # lines without --metrics or --methods


def _headline(comparison: Comparison, run: Run) -> Iterator[str]:
    """Yield the table of the chief metrics of each method."""
    if not comparison.headline:
        return
    metrics = {RELATIVE_EXCESS.name: RELATIVE_EXCESS, **run.metrics}
    heads = [metrics[name].heading if name in metrics else name for name in HEADLINE]
    rows = [[run.label(name), *cells] for name, cells in comparison.headline.items()]
    yield markdown_table([["Method", *heads], *rows[:MOST_METHODS]])
    if (rest := len(rows) - MOST_METHODS) > 0:
        yield f"{rest} more methods: --methods '*'"


if __name__ == "__main__":
    raise SystemExit(main())
