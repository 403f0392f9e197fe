"""Content of the PDF, as values that the template lays out: the report blocks and what stands around them.

It is to be read in minutes: what is long stands in tables/ and in report.html, as the protocol says.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reports.blocks import BLOCKS
from reports.blocks.block import Heading, Report
from reports.document.configuration import configuration
from reports.document.layout import lay_out
from reports.run.finished_run import Run

FILES = 4  # names of files that are not as the run wrote them
DEFINED = ("energies", "curvature", "cost", "overview")  # tables whose metrics are defined


def content(report: Report) -> dict[str, Any]:
    """Return everything the template needs, as JSON-ready values."""
    run = report.run
    sections = _sections(report)
    return {
        "title": "Neural garments versus a reference solver",
        "subtitle": report.subtitle,
        "changed": changed_files(run),
        "size": _size(run.config),
        "first": sections[0]["blocks"],
        "workers": _side_by_side(run.config),
        "configuration": configuration(run.config, run.frame),
        "sections": [section for section in sections[1:] if section["blocks"]],
        "definitions": _definitions(report),
    }


def _sections(report: Report) -> list[dict[str, Any]]:
    """Return the blocks by heading, those of page one first."""
    sections: list[dict[str, Any]] = [{"title": "", "blocks": []}]
    for block in BLOCKS:
        if isinstance(block, Heading):
            sections.append({"title": block.title, "blocks": []})
        else:
            sections[-1]["blocks"] += lay_out(report, block)
    return sections


def changed_files(run: Run) -> str:
    """Say that files are not what the run wrote: a reader of the numbers is to know it first."""
    if not run.changed:
        return ""
    more = f" and {len(run.changed) - FILES} more" if len(run.changed) > FILES else ""
    return f"Not as the run wrote them: {', '.join(run.changed[:FILES])}{more}. This report is of them."


def _size(config: Mapping[str, Any]) -> str:
    """Return the preset's description; that of a smoke test says that its numbers mean nothing."""
    values = config.get("preset_values")
    description = values.get("description") if isinstance(values, dict) else None
    return f"{description}" if description else ""


def _side_by_side(config: Mapping[str, Any]) -> str:
    count = config.get("workers")
    if not count:
        return "one thread each."
    together = "one after another" if count == 1 else f"up to {count} side by side"
    return f"{together}, one thread each."


def _definitions(report: Report) -> list[list[str]]:
    """Return (heading, definition) of every metric that is a column of DEFINED tables."""
    tables = [report.tables[name] for name in DEFINED if name in report.tables]
    printed = {column.name for table in tables for column in table.columns}
    return [
        [metric.heading, metric.definition]
        for metric in report.run.metrics.values()
        if metric.name in printed and metric.definition
    ]
