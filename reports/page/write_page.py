"""Writing of report.html: data and roll-outs of a run in the template, one file that asks for no other."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import string
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.results.run_folder import RunFolder
from reference_sim.files.atomic_files import replacing
from reports.blocks.block import Report
from reports.page.embedded_roll_outs import Embedded, embed
from reports.page.packed_arrays import deflated
from reports.page.page_data import methods_of, plots_of, sentences_of, tables_of, unfinished_cells
from reports.page.roll_out_choice import BUDGET, RULE

HERE = Path(__file__).parent
SCRIPTS = ("data", "draw", "view", "plots", "tables", "share", "page")  # in this order
MOST_LINES = 60  # on cells that did not run; tables/unfinished.csv has all


def write_page(folder: RunFolder, report: Report, *, budget: int = BUDGET) -> Path:
    """Write report.html whole or not at all; return its path.

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
    return folder.page_path


def _page(report: Report, content: dict[str, Any], embedded: Embedded) -> str:
    data = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    blobs = {"content": deflated(data.encode()), **embedded.texts}
    return filled(
        "page.html",
        SCRIPTS,
        subtitle=html.escape(report.subtitle),
        sentences=_sentences(report),
        trouble=_trouble(report),
        left_out=html.escape(embedded.left_out(RULE)),
        blobs="\n".join(
            f'<script type="text/plain" id="{name}">{text}</script>' for name, text in blobs.items()
        ),
    )


def _sentences(report: Report) -> str:
    pairs = [(html.escape(topic), html.escape(text)) for topic, text in sentences_of(report)]
    return "\n".join(f'<p class="sentence"><b>{topic}.</b> {text}</p>' for topic, text in pairs)


def _trouble(report: Report) -> str:
    """Return markup of cells that did not run and of files that could not be read; empty without any."""
    text, wrong, lines = unfinished_cells(report)
    more = [f"and {len(lines) - MOST_LINES} more"] if len(lines) > MOST_LINES else []
    markup = _details(text, [*lines[:MOST_LINES], *more], "wrong" if wrong else "") if text else ""
    if report.run.problems:
        markup += _details("Files of this run could not be read.", report.run.problems, "wrong")
    return markup


def _details(summary: str, lines: Sequence[str], kind: str) -> str:
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return (
        f'<details class="trouble {kind}"><summary>{html.escape(summary)}</summary><ul>{items}</ul></details>'
    )


def filled(name: str, scripts: Sequence[str], **values: str) -> str:
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
