"""Page one of a run as few lines for a terminal: its first sentence and few columns of its table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from reports.blocks.page_one_sentences import topics
from reports.run.finished_run import Run
from reports.tables.table import Table
from reports.text.text_table import aligned_text, remarks_on, text_rows

MOST_METHODS = 6
COLUMNS = (
    "method", "relative_excess", "dynamics/amplitude", "penetration/surface", "cost/whole", "cost/frame",
    "gap/energy", "faster",
)  # fmt: skip
MOST_COLUMNS = 5  # of COLUMNS, without the intervals of effects


def answer(run: Run, tables: Mapping[str, Table]) -> str:
    """Return table and first sentence of page one, empty where the run has neither.

    At most eight lines: with the counts, the times and the path of the report that follow, ten.
    """
    lines, notes = [], []
    if "overview" in tables:
        table, left_out = _shortened(run, tables["overview"])
        names = [column.name for column in table.columns]
        rows = text_rows(run, table, [name for name in COLUMNS if name in names][:MOST_COLUMNS])
        lines.append(aligned_text(rows))
        notes = [remarks_on(rows), f"The report also has {', '.join(left_out)}." if left_out else ""]
    chief = [sentences[0] for _, sentences in topics(run)[:1]]
    lines.append(" ".join(filter(None, [*chief, *notes])))
    return "\n".join(filter(None, lines)).replace("\u00a0", " ")


def _shortened(run: Run, table: Table) -> tuple[Table, list[str]]:
    """Return MOST_METHODS lines of the table and the labels of the others, of which variants come first."""
    methods = [str(line[0]) for line in table.rows]
    variants = sorted(methods, key=lambda name: run.methods[name].base in methods)
    kept = set(variants[:MOST_METHODS])
    rows = tuple(line for line in table.rows if line[0] in kept)
    return replace(table, rows=rows), [run.label(name) for name in methods if name not in kept]
