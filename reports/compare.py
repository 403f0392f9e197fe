"""python -m reports.compare A B: changes from run A to run B beyond the noise of both; fails if worse.

Suite garments is compared by garment over its motions and seeds, and motion by motion; every other scene
by itself, over its seeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reports.comparison import BETTER, FAILING, GONE, OTHER, WORSE, Comparison, compare
from reports.finished_run import Run, read_run

EXAMPLES = """examples:
  python -m reports.compare before after
  python -m reports.compare before after --metrics 'energy/*,curvature/*' --methods snug
  python -m reports.compare before after --without-times         beside other work on the machine
  python -m reports.compare before after --shared                of what both runs have

What counts as a change (docs/outputs.md has the rules in full):
  a mean   beyond 2 % of an energy and 5 % of another answer, with p below 0.05 by Holm
           and beyond the uncertainties of both runs; of a garment also motion by motion
  a time   repeated: all of its interval beyond 15 %, on the same hardware; once: a factor of 2
  a check  one that passes in one run alone, or is off by more than A's tolerance
  a cell   one that comes to its end in one run alone
  a loss   methods, motions, seeds and metrics that A has and B has not
A network with one seed in B and more in A is judged by the prediction interval of A's seeds.

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
        parser.add_argument(f"--{name}", metavar="NAME,...", default="*", help="only these (patterns)")
    parser.add_argument("--without-times", action="store_true", help="neither run times nor memory")
    parser.add_argument("--shared", action="store_true", help="leave out what B lacks")
    options = parser.parse_args(arguments)
    one, other = (read_run(RunFolder(path)) for path in (options.one, options.other))
    comparison = compare(
        one, other, options.metrics, options.methods,
        times=not options.without_times, shared=options.shared,
    )  # fmt: skip
    for change in comparison.changes:
        print(f"{change.verdict:8}{change.place}  {change.method}  {change.metric}  {change.size}")
    print("\n".join(_summary(comparison, (one, other))))
    return 1 if any(change.verdict in FAILING for change in comparison.changes) else 0


def _summary(comparison: Comparison, runs: Sequence[Run]) -> Iterator[str]:
    order = (GONE, WORSE, BETTER, OTHER)
    counts = [f"{sum(c.verdict == v for c in comparison.changes)} {v}" for v in order]
    yield f"{comparison.compared} means compared: {', '.join(counts)}."
    if count := comparison.not_judged:
        yield f"Not judged: {count} means differ, but have one seed or were timed once."
    machines = [", ".join(sorted(set(run.frame["hardware"]))) for run in runs]
    if machines[0] != machines[1]:
        yield f"No times compared: A ran on {machines[0]}, B on {machines[1]}."


if __name__ == "__main__":
    raise SystemExit(main())
