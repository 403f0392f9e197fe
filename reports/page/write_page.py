"""Data of the page besides roll-outs: methods, plots, sentences and tables, as plain values."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import math
import string
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.results.run_folder import RunFolder
from reference_sim.files.atomic_files import replacing
from reports.blocks import BLOCKS, Report, TableBlock
from reports.figures.plotting import style
from reports.finished_run import Run
from reports.page.embedded_roll_outs import BUDGET, Embedded, deflate, embed
from reports.sentences import headline
from reports.statistics.effects import Effect
from reports.statistics.means_and_spreads import Mean, value_of
from reports.statistics.pareto import ERRORS, error_points, noise_floor, run_time, time_label
from reports.tables.table import Cell, Column, Table, column_texts, remarks_below


def methods_of(run: Run) -> dict[str, dict[str, Any]]:
    """Return method -> label, role, colour, and the family of those that differ by one number."""
    return {
        name: {
            "label": method.label, "role": method.role, "colour": style(run, name).colour,
            "family": method.family if method.level is not None else "", "level": method.level,
        }
        for name, method in run.methods.items()
    }  # fmt: skip


def plots_of(run: Run) -> dict[str, dict[str, Any]]:
    """Return scene -> the points of its plots of error against run time, where there are two or more."""
    cells = run.cells("speed", "garments")
    plots = {}
    for scene, rows in cells.groupby("scene", sort=False):
        panels = {name: panel for name in ERRORS if (panel := _panel(run, rows, name))}
        if panels:
            time = run_time(rows)
            plots[str(scene)] = {
                "time": time_label(time),
                "reference": value_of(rows, run.reference, time),
                "panels": panels,
            }
    return plots


def _panel(run: Run, rows: pd.DataFrame, metric: str) -> dict[str, Any] | None:
    points = [] if metric not in run.metrics else error_points(run, rows, metric)
    if len(points) < 2:
        return None
    return {
        "title": run.metrics[metric].heading, "definition": run.metrics[metric].definition,
        "band": noise_floor(run, rows, metric),
        "points": [[p.method, p.time, p.error, p.time_spread, p.error_spread] for p in points],
    }  # fmt: skip


def tables_of(report: Report) -> list[dict[str, Any]]:
    """Return the tables, under the report's headings or as other metrics; cells are texts that sort."""
    group = "Answer"
    groups: dict[str, str] = {}
    for block in BLOCKS:
        if isinstance(block, str):
            group = block
        elif isinstance(block, TableBlock) and block.name in report.tables:
            groups[block.name] = group
    groups |= {name: "Other metrics" for name in report.tables if name not in groups}
    return [
        {
            "group": group,
            "title": name.replace("_", " ").capitalize(),
            **table_data(report.run, report.tables[name]),
        }
        for name, group in groups.items()
    ]


def table_data(run: Run, table: Table) -> dict[str, Any]:
    """Return a table as the page's script shows it; the run declares its metrics and methods."""
    texts = [column_texts(run, column, cells) for column, cells in zip(table.columns, zip(*table.rows))]
    lines = [list(line) for line in zip(*texts)]
    rows = [[_cell(text, cell) for text, cell in zip(line, row)] for line, row in zip(lines, table.rows)]
    return {
        "name": table.name, "caption": table.caption or table.name, "note": remarks_below(table, lines),
        "columns": [_column(run, column) for column in table.columns], "rows": rows,
    }  # fmt: skip


def _column(run: Run, column: Column) -> dict[str, Any]:
    metric = run.metrics.get(column.name)
    definition = metric.definition if metric else ""
    better = metric.lower_is_better if metric else None
    if better is not None:
        definition += f"; {'lower' if better else 'higher'} is better"
    return {
        "title": column.title,
        "unit": column.unit_above,
        "words": column.text,
        "definition": definition,
    }


def _cell(text: dict[str, str], cell: Cell) -> str | list[Any]:
    """Return a text that sorts by itself, or a number as [text, value, spread, mark]."""
    value = cell.shown if isinstance(cell, Effect) else cell.value if isinstance(cell, Mean) else cell
    if isinstance(value, str):
        return text["text"]
    number = None
    if value is not None and not math.isnan(value):
        # The last digits of a mean differ between processors; a page that is kept must not.
        number = float(f"{max(min(float(value), 1e300), -1e300):.12g}")
    return [text["text"], number, text["spread"], text["mark"]]


HERE = Path(__file__).parent
SCRIPTS = ("data", "draw", "view", "plots", "tables", "share", "page")  # in this order


def write_page(folder: RunFolder, report: Report, *, budget: int = BUDGET) -> None:
    """Write report.html whole or not at all.

    budget: [bytes] of the page; roll-outs that do not fit are left out, and named.
    """
    run = report.run
    content: dict[str, Any] = {
        "methods": methods_of(run),
        "plots": plots_of(run),
        "tables": tables_of(report),
        "curves": {name: [metric.title, metric.unit] for name, metric in run.metrics.items()},
    }
    fixed = len(_page(report, content, Embedded()).encode())
    embedded = embed(folder, run, budget - fixed)
    content["scenes"] = embedded.scenes
    page = _page(report, content, embedded)
    with replacing(folder.page_path) as temporary:
        temporary.write_text(page, encoding="utf-8", newline="\n")


def _page(report: Report, content: dict[str, Any], embedded: Embedded) -> str:
    data = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    blobs = {"content": deflate(data.encode()), **embedded.texts}
    sentences = {topic: html.escape(text) for topic, text in headline(report.run)}
    verdict, remarks = sentences.pop("Verdict", ""), sentences.items()
    return fill_page(
        "page.html",
        SCRIPTS,
        subtitle=html.escape(report.subtitle),
        verdict=f'<p class="verdict">{verdict}</p>' if verdict else "",
        remarks="\n".join(f'<p class="sentence"><b>{topic}.</b> {text}</p>' for topic, text in remarks),
        left_out=html.escape(embedded.remark),
        blobs="\n".join(
            f'<script type="text/plain" id="{name}">{text}</script>' for name, text in blobs.items()
        ),
    )


def fill_page(name: str, scripts: Sequence[str], **values: str) -> str:
    """Return a template of this folder with its style, these scripts in their order, and values."""
    style = (HERE / "page.css").read_text(encoding="utf-8")
    code = "".join((HERE / f"{script}.js").read_text(encoding="utf-8") for script in scripts)
    script = f"'use strict';(() => {{\n{code}}})();"
    return string.Template((HERE / name).read_text(encoding="utf-8")).substitute(
        style=style,
        script=script,
        style_hash=_policy_hash(style),
        script_hash=_policy_hash(script),
        **values,
    )


def _policy_hash(text: str) -> str:
    """Return the hash for the policy that lets a browser run this text and no other."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
