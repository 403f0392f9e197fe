"""The page of entries: a table for each protocol and set of scenes, with the project's methods."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from benchmarks.results.protocol import LEAST_MOTIONS
from benchmarks.results.row import DECLARED, ResultsError
from benchmarks.results.run_folder import RunFolder
from reports.finished_run import Run, read_run
from reports.page.write_page import fill_page, table_data
from reports.statistics.effects import Effect
from reports.statistics.means_and_spreads import mean_of
from reports.statistics.pareto import TIME
from reports.statistics.relative_excess import excess_of
from reports.tables.table import Cells, Column, Table

ENTRIES, PAGE = "submissions", "index.html"
SCRIPTS = ("tables", "entries")  # in this order
DYNAMICS, PENETRATION = "dynamics/common_correlation", "penetration/surface"
ROLES = ("baseline", "network", "solver", "external")  # of the project's own methods
PICTURE = "picture.png"
# What stands behind numbers: of an entry whose files are not as they were scored nothing was computed here.
VERIFIED, FILES_ONLY, UNVERIFIED = "verified from vertices", "files only", "declared"
COLUMNS = (
    Column("rank", "Rank"),
    Column("entry", "Entry", text=True),
    Column("relative_excess/total", "Relative excess", "%"),
    Column(DYNAMICS, "Dynamic correlation"),
    Column(PENETRATION, "Surface inside", "%"),
    Column(TIME, "Time", "ms"),
    Column("clock", "Time is", text=True),
    Column("learned_from", "Learned from", text=True),
    Column("proof", "Scores", text=True),
    Column("commit", "Commit", text=True),
    Column("date", "Date", text=True),
    Column("hash", "Roll-outs", text=True),
)


@dataclass(frozen=True, eq=False)
class Scored:
    """A method over some scenes: of an entry, or of the project.

    Attributes:
        run: that has its rows.
        method: name in rows.
        title: for people.
        learned_from: training data in words.
        scenes: that the row is over.
        folder: of an entry.
    """

    run: Run
    method: str
    title: str
    learned_from: str
    scenes: tuple[str, ...]
    folder: Path | None = None

    def proof(self) -> str:
        """Return what its numbers rest on: a program, files, or a declaration."""
        if self.folder is None:
            return VERIFIED
        files = self.run.config.get("entry")
        if not files or RunFolder(self.folder).find_changes(files):
            return UNVERIFIED
        return VERIFIED if self.run.config["metadata"].get("program") else FILES_ONLY

    def title_cell(self) -> list[str | None]:
        """Return the title as the page's script shows it: with a link, and a picture of one frame."""
        if self.folder is None:
            return [self.title, self.title, "", ""]
        url, picture = self.run.config["metadata"].get("url", ""), self.folder / "scores" / PICTURE
        data = base64.b64encode(picture.read_bytes()).decode() if picture.is_file() else ""
        return [
            self.title, self.title, "", "", url if url.startswith("https://") else None,
            f"data:image/png;base64,{data}" if data else None,
        ]  # fmt: skip

    def cells(self) -> Cells:
        """Return its row, as COLUMNS has it."""
        rows = self.run.garment_rows
        rows = rows[rows["scene"].isin(self.scenes)]
        excess = excess_of(self.run, rows, self.method)
        means = [mean_of(rows, self.method, metric) for metric in (DYNAMICS, PENETRATION, TIME)]
        timed = rows[(rows["method"] == self.method) & (rows["metric"] == TIME)]
        declared = (timed["reason"] == DECLARED).any()
        clock = "declared" if declared else "measured" if len(timed) else "unknown"
        energy = excess.effect if excess else None
        if energy and energy.motions < LEAST_MOTIONS:  # its interval says nothing
            energy = replace(energy, error=None, covers="")
        config = self.run.config
        hashes = config.get("roll_outs") if self.folder else None
        origin = (config.get("commit") or "", (config.get("date") or config.get("started") or "")[:10])
        digest = sha256("".join(hashes.values()).encode()).hexdigest()[:8] if hashes else ""
        return (None, self.title, energy, *means, clock, self.learned_from, self.proof(), *origin, digest)


def load_entry(folder: Path) -> Scored:
    """Return the entry in a folder.

    Raises:
        ResultsError: no scores, run.json without the entry's metadata, or scores of another name.
    """
    scores, advice = RunFolder(folder / "scores"), f"run python -m benchmarks.submit score {folder}"
    if not scores.config_path.is_file():
        raise ResultsError(f"{folder}: has no scores: {advice}")
    run, name = read_run(scores), folder.resolve().name
    try:
        metadata = run.config["metadata"]
        title, authors, data = (metadata[key] for key in ("title", "authors", "training_data"))
    except (KeyError, TypeError):
        raise ResultsError(f"{scores.config_path}: has no metadata of an entry: {advice}") from None
    scenes = tuple(sorted(set(run.frame[run.frame["method"] == name]["scene"])))
    if not scenes:
        remedy = f"give the folder its old name, or {advice}"
        raise ResultsError(f"{scores.rows_path}: no scores of '{name}': {remedy}")
    return Scored(run, name, f"{title}; {authors}", data, scenes, folder)


def list_published(name: str, run: Run, scenes: Sequence[str]) -> list[Scored]:
    """Return the methods of the published run of that name that have rows in these scenes."""
    rows = run.garment_rows
    rows = rows[rows["scene"].isin(scenes) & rows["usable"]]
    methods = run.order(set(rows["method"]) & set(run.with_role(*ROLES)))
    return [
        Scored(run, method, run.label(method), f"see run {name}", tuple(scenes)) for method in methods
    ]


def full_scenes(run: Run) -> tuple[str, ...]:
    """Return the scenes that a full entry covers: the first garment in the preset's test motions."""
    count = (run.config.get("preset_values") or {}).get("test_motions")
    motions = (run.config.get("motions") or {}).get(f"test {run.first_garment}") or ()
    return tuple(f"{run.first_garment}/{motion}" for motion in motions[:count])


def entries_tables(
    entries: Sequence[Scored], name: str, run: Run
) -> list[tuple[Table, Sequence[Scored]]]:
    """Return a table for each protocol and set of scenes, full ones first, and whom its rows are of.

    Methods of the published run of that name stand in each table of their protocol. Rows are sorted by
    relative excess; rows without it, or with roll-outs that are missing or fell off, are last.
    """
    full = full_scenes(run)
    groups: dict[tuple[str, tuple[str, ...]], list[Scored]] = {(run.protocol, tuple(sorted(full))): []}
    for entry in entries:
        groups.setdefault((entry.run.protocol, entry.scenes), []).append(entry)
    tables: list[tuple[Table, Sequence[Scored]]] = []
    for (protocol, scenes), scored in sorted(
        groups.items(), key=lambda item: (-len(item[0][1]), item[0])
    ):
        every = [*scored, *(list_published(name, run, scenes) if protocol == run.protocol else ())]
        lines = sorted(((entry.cells(), entry) for entry in every), key=lambda line: _excess(line[0]))
        part = "all" if set(scenes) == set(full) else f"{len(scenes)} of {len(full)}: {', '.join(scenes)}"
        title = f"Protocol {protocol}" if protocol[:1].isdigit() else protocol.capitalize()
        caption = f"{title}; scenes: {part}."
        rows = tuple((place, *cells[1:]) for place, (cells, _) in enumerate(lines, 1))
        tables.append((Table("entries", COLUMNS, rows, caption), [scored for _, scored in lines]))
    return tables


def _excess(cells: Cells) -> float:
    return cells[2].shown if isinstance(cells[2], Effect) and cells[2].complete else float("inf")


def page_of(folder: Path, name: str, run: Run) -> str:
    """Return the page of the entries in a folder, beside the methods of the published run of that name.

    Raises:
        ResultsError: scores that cannot be read.
    """
    entries = [load_entry(path.parent) for path in sorted(folder.glob("*/entry.toml"))]
    content = []
    for table, lines in entries_tables(entries, name, run):
        content.append(data := table_data(lines[0].run, table))
        for row, scored in zip(data["rows"], lines):
            row[1] = scored.title_cell()
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    # No text of an entry ends the element.
    return fill_page("entries.html", SCRIPTS, content=text.replace("<", "\\u003c"))
