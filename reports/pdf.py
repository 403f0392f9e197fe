"""The PDF: its content as values that the template lays out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from textwrap import shorten
from typing import Any

import pandas as pd
import typst

from benchmarks.results.run_folder import RunFolder
from reference_sim.files.atomic_files import replacing
from reports.blocks import BLOCKS, Report, TableBlock
from reports.figures.plotting import Figure, escape
from reports.finished_run import Run
from reports.sentences import headline
from reports.tables.table import CellText, Table, column_texts, remarks_below

# Of run.json, which has all.
SHOWN = (
    "command", "preset", "protocol", "split", "seeds", "clock", "workers", "commit", "started", "finished",
    "hardware", "versions",
)  # fmt: skip
MOST_LETTERS = 420  # letters of a value


def configuration(config: Mapping[str, Any], frame: pd.DataFrame) -> list[list[str]]:
    """Return names and values of what run.json says of how a run was made; motions are the rows'."""
    pairs = {name.capitalize(): _text(config[name]) for name in SHOWN if config.get(name)}
    pairs["Motions"] = ", ".join(sorted(set(frame["motion"]) - {""}))
    pairs["Numbers"] = ", ".join(sorted(set(frame["dtype"]) - {""}))
    return [
        [title, shorten(text, MOST_LETTERS, placeholder="…")] for title, text in pairs.items() if text
    ]


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{name.replace('_', ' ')} {_text(item)}" for name, item in value.items())
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


Values = dict[str, Any]  # of one block, as JSON takes them
UNBROKEN = 8  # rows of a table that stays on one page, as that of page one
FEW = 5  # up to so many columns share a table's width evenly


def lay_out(report: Report, block: Figure | TableBlock) -> list[Values]:
    """Return the values of a block, none where the report has no content for it."""
    if isinstance(block, Figure):
        if not (picture := report.pictures.get(block.name)):
            return []
        return [
            {
                "kind": "figure",
                "path": f"figures/{picture.path.name}",
                "caption": picture.caption,
                "width": picture.width,
            }
        ]
    if block.name not in report.tables:
        return []
    table = block.cut_table(report.tables[block.name])
    return [lay_out_table(report.run, table)] if table.rows else []


def lay_out_table(run: Run, table: Table) -> Values:
    """Return the values of a table."""
    heads = [k for k, column in enumerate(table.columns) if column.name in table.grouped_by]
    places = [k for k in range(len(table.columns)) if k not in heads]
    columns = [table.columns[k] for k in places]
    cells = [
        column_texts(run, column, [row[k] for row in table.rows]) for k, column in zip(places, columns)
    ]
    lines = [list(line) for line in zip(*cells)]
    groups: dict[str, list[list[CellText]]] = {}
    for row, line in zip(table.rows, lines):
        groups.setdefault(" · ".join(str(row[k]) for k in heads), []).append(line)
    # Columns of numbers share evenly; with texts among them each takes what it needs.
    widths = ["1.4fr" if len(columns) <= FEW else "2.4fr", *["1fr"] * (len(columns) - 1)]
    if any(column.text for column in columns[1:]):
        widths = ["auto"] * len(columns)
    return {
        "kind": "table",
        "caption": table.caption,
        "note": remarks_below(table, lines),
        "columns": [
            {"title": column.title, "unit": column.unit_above, "left": column.text, "width": width}
            for column, width in zip(columns, widths)
        ],
        "groups": [{"title": title, "rows": rows} for title, rows in groups.items()],
        "breakable": len(table.rows) > UNBROKEN,
    }


DEFINED = ("energies", "curvature", "cost", "overview")  # tables whose metrics are defined


def content(report: Report) -> dict[str, Any]:
    """Return everything the template needs, as JSON-ready values."""
    run, config = report.run, report.run.config
    sections: list[dict[str, Any]] = [{"title": "", "blocks": []}]  # page one has no heading
    for block in BLOCKS:
        if isinstance(block, str):
            sections.append({"title": block, "blocks": []})
        else:
            sections[-1]["blocks"] += lay_out(report, block)
    workers = config.get("workers") or 1
    sentences = dict(headline(run))
    return {
        "title": "Neural garments versus a reference solver",
        "subtitle": report.subtitle,
        "warnings": ". ".join([*run.warnings, ""]).strip(),
        "verdict": sentences.pop("Verdict", ""),
        "sentences": list(sentences.items()),
        "first": sections[0]["blocks"],
        "workers": f"up to {workers} side by side" if workers > 1 else "one after another",
        "configuration": configuration(config, run.frame),
        "sections": [section for section in sections[1:] if section["blocks"]],
        "definitions": _definitions(report),
    }


def _definitions(report: Report) -> list[list[str]]:
    """Return (heading, definition) of every metric that is a column of DEFINED tables."""
    tables = [report.tables[name] for name in DEFINED if name in report.tables]
    printed = {column.name for table in tables for column in table.columns}
    return [
        [metric.heading, metric.definition]
        for metric in report.run.metrics.values()
        if metric.name in printed and metric.definition
    ]


TEMPLATE = Path(__file__).parent / "report.typ"


def write_pdf(folder: RunFolder, report: Report) -> Path:
    """Write report.pdf with fonts of the typesetter alone and the run's own date; return its path."""
    config = report.run.config
    finished = config.get("finished") or config.get("started")
    values = json.dumps(content(report), ensure_ascii=False, allow_nan=False)
    compiler = typst.Compiler(
        TEMPLATE.read_bytes(),
        root=str(folder.path),
        ignore_system_fonts=True,
        sys_inputs={"content": escape(values)},
    )
    with replacing(folder.report_path) as temporary:
        stamp = int(datetime.fromisoformat(str(finished)).timestamp()) if finished else 0
        compiler.compile(output=str(temporary), format="pdf", timestamp=stamp)
    return folder.report_path
