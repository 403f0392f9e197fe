"""python -m benchmarks.submit: check an entry of other people, and score it from its vertices."""

from __future__ import annotations

import contextlib
import sys
import tempfile
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from benchmarks.timing import one_thread
from reference_sim.command_line import Parser, command

PROGRAM = "benchmarks.submit"
SHOWN = 5  # differences that are printed
EXAMPLES = """examples:
  python -m benchmarks.export tshirt/dance_turn -o dance            a scene, to be dressed elsewhere
  python -m benchmarks.submit check submissions/mine                seconds: metadata, files, protocol
  python -m benchmarks.submit score submissions/mine                minutes: writes submissions/mine/scores
  python -m benchmarks.submit score submissions/mine --replace      after a change of the entry
  python -m reports.entries                                         the page of all entries

DIR has entry.toml and one roll-out for each scene, or a program (docs/entries.md). Both check and score load
  the program, and score runs it: read the program of somebody else first. Scores that are there are compared
  with those of now.
exit status: 0 fine; 1 faults, or scores that are not the recorded ones: a line each; 2 DIR is no entry."""


def make_parser() -> Parser:
    """Return the parser of the command."""
    parser = Parser(
        prog=f"python -m {PROGRAM}", description="Check and score an entry of the benchmark.", epilog=EXAMPLES
    )
    parser.add_argument("action", choices=("check", "score"), help="check alone, or check and score")
    parser.add_argument("entry", metavar="DIR", help="folder of the entry")
    parser.add_argument("--replace", action="store_true", help="write the scores whatever was recorded")
    parser.add_argument("--page", action="store_true", help="write scores/report.html, to look at roll-outs")
    return parser


@command(PROGRAM)
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    options = make_parser().parse_args(arguments)
    one_thread()
    from benchmarks.submit import scores  # loads numpy
    from benchmarks.submit.entry import faults_of

    with tempfile.TemporaryDirectory(prefix="entry-") as folder:
        entry, faults = faults_of(Path(options.entry), Path(folder) / "run", scores=not options.replace)
    for fault in faults:
        print(fault)
    if faults or entry is None:
        print(f"{options.entry}: {len(faults)} fault{'s' * (len(faults) > 1)}")
        return 1
    if options.action == "check":
        covered = f"{len(entry.scenes)} scenes{'' if entry.full else ', a partial entry'}"
        print(f"{options.entry}: nothing found; {covered}")
        return 0
    with contextlib.redirect_stdout(sys.stderr):
        rows, config = scores.scored(entry, page=options.page)
    if entry.scores.rows_path.is_file() and not options.replace:
        elsewhere = scores.scored_elsewhere(entry)
        tolerance = scores.tolerance_of(entry, elsewhere=elsewhere)
        differing = scores.differences(entry.scores.read_rows(), rows, tolerance)
        for line in (lines := list(islice(differing, SHOWN))):
            print(line)
        if lines:
            print(f"{options.entry}: refused: its scores are not the recorded ones")
            return 1
        what = "energies as recorded, on another processor" if elsewhere else "as recorded"
        print(f"{options.entry}: scored again, {len(rows)} rows, {what}")
        return 0
    scores.write(entry, rows, config)
    print(f"{options.entry}: {len(rows)} rows in {entry.scores.rows_path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
