"""python -m reports.entries: the page of all entries and of the project's own published methods."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results.json_file import ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command.command_line import Parser, command
from reference_sim.files.atomic_files import replacing

if TYPE_CHECKING:
    from reports.run.finished_run import Run

ENTRIES = "submissions"
PAGE = "index.html"
EXAMPLES = """examples:
  python -m reports.entries                                   submissions/index.html
  python -m reports.entries mine -o entries.html              of other entries

Entries without scores are left out and named: python -m benchmarks.submit score DIR makes them.
exit status: 0 written; 1 written without some entry; 2 a folder cannot be read."""


def entries_in(folder: Path) -> list[Path]:
    """Return the folders of entries, by name. Raises ResultsError where there is none."""
    found = sorted(path.parent for path in folder.glob("*/entry.toml"))
    if not found:
        raise ResultsError(f"{folder}: holds no entry, a folder with entry.toml")
    return found


def page_of(folder: Path, path: Path, published: tuple[RunFolder, Run]) -> tuple[str, list[Path]]:
    """Return the page of the entries in a folder, and the entries that have no scores.

    Args:
        folder: has a folder for each entry.
        path: where the page will be.
        published: the run whose methods stand beside entries of its protocol.

    Raises:
        ResultsError: no entry, or scores that cannot be read.
    """
    from reports.page.entries_page import entries_page  # loads pandas
    from reports.run.reading import read_run
    from reports.tables.entries import entries_tables, of_entry

    found = entries_in(folder)
    scores = {entry: RunFolder(entry / "scores") for entry in found}
    without = [entry for entry in found if not scores[entry].config_path.is_file()]
    scored = [of_entry(scores[entry], read_run(scores[entry])) for entry in found if entry not in without]
    return entries_page(path, entries_tables(scored, published)), without


@command("reports.entries", bad_input=(ResultsError, ValueError))
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
    from reports.run.reading import read_run
    from reports.statistics.published import DEFAULT, PUBLISHED

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
