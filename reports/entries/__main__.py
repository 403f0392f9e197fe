"""python -m reports.entries: the page of all entries and of the project's own published methods."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import replacing
from reports.entries.page import ENTRIES, PAGE, entries_in, page_of
from reports.run.reading import read_run
from reports.statistics.published import DEFAULT, PUBLISHED

EXAMPLES = """examples:
  python -m reports.entries                                   submissions/index.html
  python -m reports.entries mine -o entries.html              of other entries

Entries without scores are left out and named: python -m benchmarks.submit score DIR makes them.
exit status: 0 written; 1 written without some entry; 2 a folder cannot be read."""


@command("reports.entries")
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = Parser(
        prog="python -m reports.entries",
        description="Make the page of all entries beside the published methods of the project.",
        epilog=EXAMPLES,
    )
    parser.add_argument("entries", metavar="DIR", nargs="?", default=ENTRIES, help=f"default {ENTRIES}")
    parser.add_argument("-o", "--out", metavar="FILE", help=f"the page (default DIR/{PAGE})")
    options = parser.parse_args(arguments)
    folder, run = Path(options.entries), RunFolder(PUBLISHED / DEFAULT)
    path = Path(options.out) if options.out else folder / PAGE
    entries_in(folder)  # before much is read
    page, without = page_of(folder, path, (run, read_run(run)))
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8", newline="\n")
    for entry in without:
        print(f"{entry}: left out: it has no scores; run python -m benchmarks.submit score {entry}")
    print(path)
    return 1 if without else 0


if __name__ == "__main__":
    raise SystemExit(main())
