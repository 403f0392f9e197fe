"""The report as a list of blocks: headings, figures and tables in their order.

The PDF and the page walk the same BLOCKS, below the sentences of page one. A block without content is
left out. Blocks before the first heading make page one.
A new figure is a function of reports.figures.charts and a line here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from textwrap import shorten

import pandas as pd

from reports.figures.charts import energy_series, error_of_page_one, excess_by_motion
from reports.figures.plotting import Figure, Picture
from reports.finished_run import Run
from reports.pictures import draw_methods, worst_frame
from reports.tables.table import Table

ROWS, COLUMNS = 12, 9  # of a printed table; columns of numbers; the CSV has all
OF_GARMENT = 7  # rows of each garment
LETTERS = 90  # of a reason at the end of its rows


@dataclass(frozen=True)
class Report:
    """Material of a report: the run, its tables and its pictures, both by name."""

    run: Run
    tables: Mapping[str, Table]
    pictures: Mapping[str, Picture]

    @property
    def subtitle(self) -> str:
        """Study, sizes, commit or version, and day of the run."""
        config = self.run.config
        study = (config.get("study") or {}).get("name")
        parts = [f"study {study}"] if study else []
        parts += [f"sizes {config['preset']}"] if config.get("preset") else []
        if made_by := str(config.get("commit") or ""):  # an installed package knows its version alone
            parts += [made_by if made_by.startswith("version ") else f"commit {made_by}"]
        parts += [str(config["started"])[:10]] if config.get("started") else []
        return " · ".join(parts)


@dataclass(frozen=True)
class TableBlock:
    """A table; the PDF prints at most so many rows, and none with a cell among `left_out`."""

    name: str
    limit: int = ROWS
    left_out: tuple[str, ...] = ()

    def cut_table(self, table: Table) -> Table:
        """Return the first columns, and of rows the first of each group; a note says where the others are."""
        rows = [row for row in table.rows if not set(row) & set(self.left_out)]
        heads = [k for k, column in enumerate(table.columns) if column.name in table.grouped_by]
        groups = pd.Series([" · ".join(str(row[k]) for k in heads) for row in rows], dtype=str)
        order = groups.groupby(groups).cumcount().sort_values(kind="stable")
        minimum = OF_GARMENT * groups.nunique() * (table.grouped_by == ("garment",))
        rows = [rows[line] for line in sorted(order.index[: max(self.limit, minimum)])]
        numbers = [k for k, column in enumerate(table.columns) if not column.text]
        places = [k for k in range(len(table.columns)) if k not in numbers[COLUMNS:]]
        counts = {"rows": len(table.rows) - len(rows), "columns": len(table.columns) - len(places)}
        rest = " and ".join(f"{count} more {unit}" for unit, count in counts.items() if count)
        remark = f"{rest} are in tables/{table.name}.csv. " if rest else ""
        reason = next((k for k, column in enumerate(table.columns) if column.name == "reason"), None)
        if reason is not None:
            rows = [(*row[:reason], shorten(str(row[reason]), LETTERS, placeholder="…")) for row in rows]
        return replace(
            table,
            columns=tuple(table.columns[k] for k in places),
            rows=tuple(tuple(row[k] for k in places) for row in rows),
            note=(remark + table.note).strip(),
        )


# A text is a heading; it stands only where a block below it has content.
BLOCKS: tuple[str | Figure | TableBlock, ...] = (
    TableBlock("paper_table_1"),
    TableBlock("paper_table_2", limit=24),
    Figure("frames", draw_methods),
    Figure("error_against_time", error_of_page_one),
    TableBlock("overview"),
    "The paper's tables",
    TableBlock("energies"),
    TableBlock("table_1"),
    TableBlock("curvature"),
    TableBlock("table_2", limit=24),
    TableBlock("cost"),
    "Findings",
    TableBlock("relative_excess"),
    Figure("excess_by_motion", excess_by_motion),
    TableBlock("excess_by_time_step"),
    Figure("worst_frame", worst_frame),
    TableBlock("errors_in_spreads"),
    TableBlock("findings", left_out=("exploratory", "inconclusive: one seed")),
    TableBlock("ablation_effects"),
    "Dynamics",
    TableBlock("dynamics"),
    Figure("energy_series", energy_series),
    "Body shapes",
    TableBlock("shapes"),
    "Validation",
    TableBlock("validation", left_out=("pass", "reported")),
    "Stress",
    TableBlock("extremes", left_out=("converged",)),
    "Cells that failed or were skipped",
    TableBlock("unfinished"),
)

FIGURES = tuple(block for block in BLOCKS if isinstance(block, Figure))
