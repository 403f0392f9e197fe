"""Tables of entries and of the project's own published methods: one for each protocol and set of scenes."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlencode

from benchmarks.results.protocol import LEAST_MOTIONS
from benchmarks.results.row import DECLARED, ResultsError
from benchmarks.results.run_folder import RunFolder
from reference_sim.command_line import Parser, command
from reference_sim.files.atomic_files import replacing
from reports.page.write_page import filled, table_data
from reports.run.finished_run import Run
from reports.run.reading import read_run
from reports.statistics.effects import Effect
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.outcomes import DEFAULT, PUBLISHED
from reports.statistics.relative_excess import excess_of
from reports.tables.table import Cell, Column, Table

DYNAMICS, PENETRATION, TIME = "dynamics/common_correlation", "penetration/surface", "cost/frame"
ROLES = ("bound", "baseline", "network", "solver", "external")  # of the project's own methods
COLUMNS = (
    Column("entry", "Entry", text=True),
    Column("relative_excess/total", "Relative excess", "%"),
    Column(DYNAMICS, "Dynamic correlation"),
    Column(PENETRATION, "Surface inside", "%"),
    Column(TIME, "Time", "ms"),
    Column("clock", "Time is", text=True),
    Column("learned_from", "Learned from", text=True),
)
OWN_DATA = "see run {}"


@dataclass(frozen=True, eq=False)
class Scored:
    """A method over some scenes: of an entry, or of the project.

    Attributes:
        run: that has its rows.
        folder: of the run, where its page would be.
        method: name in rows.
        title: for people.
        learned_from: training data in words.
        scenes: that the row is over.
    """

    run: Run
    folder: RunFolder
    method: str
    title: str
    learned_from: str
    scenes: tuple[str, ...]

    def cells(self) -> tuple[Cell, ...]:
        """Return its row, as COLUMNS has it."""
        rows = self.run.garment_rows
        rows = rows[rows["scene"].isin(self.scenes)]
        excess = excess_of(self.run, rows, self.method)
        numbers = [mean_of(rows, self.method, metric) for metric in (DYNAMICS, PENETRATION, TIME)]
        timed = rows[(rows["method"] == self.method) & (rows["metric"] == TIME)]
        declared = (timed["reason"] == DECLARED).any()
        clock = "declared" if declared else "measured" if len(timed) else "unknown"
        shown: Cell = None
        if excess is not None:  # an interval over fewer motions says nothing
            shown = excess.effect if excess.effect.motions >= LEAST_MOTIONS else excess.typical
        return (self.title, shown, *numbers, clock, self.learned_from)

    def link(self, target: Path) -> str:
        """Return the address of its roll-out in the player of the run's page; empty where no page is kept."""
        page = self.folder.page_path
        if not page.is_file():
            return ""
        place = urlencode({"scene": self.scenes[0], "methods": f"{self.run.reference},{self.method}"})
        return f"{Path(os.path.relpath(page, target.parent)).as_posix()}#{place}"


def of_entry(folder: RunFolder, run: Run) -> Scored:
    """Return the entry whose scores a folder holds.

    Raises:
        ResultsError: run.json without the entry's metadata, or no scores of a method with the entry's name.
    """
    again = f"run python -m benchmarks.submit score {folder.path.parent} --replace"
    try:
        title, authors, data = (run.config["metadata"][key] for key in ("title", "authors", "training_data"))
    except (KeyError, TypeError):
        raise ResultsError(f"{folder.config_path}: has no metadata of an entry: {again}") from None
    name = folder.path.resolve().parent.name
    scenes = tuple(sorted(set(run.frame[run.frame["method"] == name]["scene"])))
    if not scenes:
        remedy = f"give the folder its old name, or {again}"
        raise ResultsError(f"{folder.rows_path}: no scores of '{name}': {remedy}")
    return Scored(run, folder, name, f"{title}; {authors}", data, scenes)


def of_published(folder: RunFolder, run: Run, scenes: Sequence[str]) -> list[Scored]:
    """Return the methods of a published run that have rows in these scenes."""
    rows = run.garment_rows
    rows = rows[rows["scene"].isin(scenes) & rows["usable"]]
    methods = run.ordered(set(rows["method"]) & set(run.with_role(*ROLES)))
    source = OWN_DATA.format(folder.path.name)
    return [Scored(run, folder, name, run.label(name), source, tuple(scenes)) for name in methods]


def full_scenes(run: Run) -> tuple[str, ...]:
    """Return the scenes that a full entry covers: the first garment in the preset's test motions."""
    count = (run.config.get("preset_values") or {}).get("test_motions")
    motions = (run.config.get("motions") or {}).get(f"test {run.first_garment}") or ()
    return tuple(f"{run.first_garment}/{motion}" for motion in motions[:count])


def entries_tables(
    entries: Sequence[Scored], published: tuple[RunFolder, Run]
) -> list[tuple[Table, list[Scored]]]:
    """Return a table for each protocol and set of scenes, full ones first, and the methods of its rows.

    No table has rows of two protocols, or means over different scenes. Methods of the project stand in each
    table of their protocol. Rows are sorted by relative excess, rows without it last.
    """
    folder, run = published
    full = full_scenes(run)
    groups: dict[tuple[str, tuple[str, ...]], list[Scored]] = {(run.protocol, tuple(sorted(full))): []}
    for entry in entries:
        groups.setdefault((entry.run.protocol, entry.scenes), []).append(entry)
    tables = []
    for (protocol, scenes), scored in sorted(groups.items(), key=lambda item: (-len(item[0][1]), item[0])):
        every = [*scored, *(of_published(folder, run, scenes) if protocol == run.protocol else ())]
        lines = sorted(((entry.cells(), entry) for entry in every), key=lambda line: _excess(line[0]))
        part = "all" if set(scenes) == set(full) else f"{len(scenes)} of {len(full)}: {', '.join(scenes)}"
        what = f"Protocol {protocol}" if protocol[:1].isdigit() else protocol.capitalize()
        caption = f"{what}; scenes: {part}."
        rows = tuple(cells for cells, _ in lines)
        tables.append((Table("entries", COLUMNS, rows, caption), [entry for _, entry in lines]))
    return tables


def _excess(cells: tuple[Cell, ...]) -> float:
    shown = cells[1].shown if isinstance(cells[1], Effect) else cells[1]
    return shown if isinstance(shown, float) else float("inf")


ENTRIES = "submissions"
PAGE = "index.html"
SCRIPTS = ("tables", "entries")  # in this order


def entries_page(path: Path, tables: Sequence[tuple[Table, Sequence[Scored]]]) -> str:
    """Return the markup of the page.

    Args:
        path: where it will be; links lead from it to pages of runs.
        tables: of reports.entries.entries_tables.
    """
    content = []
    for table, scored in tables:
        data = table_data(scored[0].run, table)
        for row, entry in zip(data["rows"], scored):
            if link := entry.link(path):
                row[0] = [row[0], row[0], "", "", link]
        content.append(data)
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    # No text of an entry ends the element.
    return filled("entries.html", SCRIPTS, content=text.replace("<", "\\u003c"))


def entries_in(folder: Path) -> list[Path]:
    """Return the folders of entries, by name. Raises ResultsError where there is none."""
    entries = sorted(path.parent for path in folder.glob("*/entry.toml"))
    if not entries:
        raise ResultsError(f"{folder}: holds no entry, a folder with entry.toml")
    return entries


def page_of(folder: Path, path: Path, published: tuple[RunFolder, Run]) -> tuple[str, list[Path]]:
    """Return the page of the entries in a folder, and the entries that have no scores.

    Args:
        folder: has a folder for each entry.
        path: where the page will be.
        published: the run whose methods stand beside entries of its protocol.

    Raises:
        ResultsError: no entry, or scores that cannot be read.
    """
    entries = entries_in(folder)
    scores = {entry: RunFolder(entry / "scores") for entry in entries}
    without = [entry for entry in entries if not scores[entry].config_path.is_file()]
    scored = [of_entry(scores[entry], read_run(scores[entry])) for entry in entries if entry not in without]
    return entries_page(path, entries_tables(scored, published)), without


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
