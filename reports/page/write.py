"""report.html: content and roll-outs of a run put into the template, one file that asks for no other."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import string
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.results.run_folder import RunFolder
from reference_sim.files.atomic_files import replacing
from reports.document.document import subtitle
from reports.page.choice import BUDGET, RULE
from reports.page.content import methods_of, plots_of, tables_of, trouble_of
from reports.page.pack import deflated
from reports.page.roll_outs import Embedded, Reader, embed
from reports.run.rows import Run
from reports.tables.table import Table

HERE = Path(__file__).parent
SCRIPTS = ("data", "draw", "view", "plots", "tables", "page")  # in this order: each uses those before
MOST_SAID = 60  # lines on what did not run; tables/unfinished.csv has all


def write_page(
    folder: RunFolder, run: Run, tables: Mapping[str, Table], problems: list[str], read: Reader,
    *, budget: int = BUDGET,
) -> Path:  # fmt: skip
    """Write report.html whole or not at all.

    read: as in embed(); it adds what cannot be read to the problems. budget: [bytes] of the page; roll-outs
    that do not fit are left out, and named.
    """
    content: dict[str, Any] = {
        "methods": methods_of(run),
        "plots": plots_of(run),
        "tables": tables_of(run, tables.values()),
        "curves": {name: [metric.title, metric.unit] for name, metric in run.metrics.items()},
        "reference": run.reference,
    }
    fixed = len(_page(run, tables, problems, content, Embedded()).encode())
    embedded = embed(folder, run, budget - fixed, read)
    content["scenes"] = embedded.scenes
    page = _page(run, tables, problems, content, embedded)
    path = folder.page_path
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8", newline="\n")
    return path


def _page(
    run: Run,
    tables: Mapping[str, Table],
    problems: Sequence[str],
    content: dict[str, Any],
    embedded: Embedded,
) -> str:
    style = (HERE / "page.css").read_text(encoding="utf-8")
    code = "".join((HERE / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS)
    script = f"'use strict';(() => {{\n{code}}})();"
    data = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    blobs = {"content": deflated(data.encode()), **embedded.texts}
    template = string.Template((HERE / "page.html").read_text(encoding="utf-8"))
    return template.substitute(
        style=style,
        script=script,
        style_hash=_hash(style),
        script_hash=_hash(script),
        subtitle=html.escape(subtitle(run.config)),
        trouble=_trouble(run, tables, problems),
        left_out=html.escape(embedded.left_out(RULE)),
        blobs="\n".join(
            f'<script type="text/plain" id="{name}">{text}</script>' for name, text in blobs.items()
        ),
    )


def _trouble(run: Run, tables: Mapping[str, Table], problems: Sequence[str]) -> str:
    """Markup of what did not run and what could not be read; empty where all is well."""
    text, wrong, lines = trouble_of(run, tables)
    more = [f"and {len(lines) - MOST_SAID} more"] if len(lines) > MOST_SAID else []
    found = _details(text, [*lines[:MOST_SAID], *more], "wrong" if wrong else "") if text else ""
    if problems:
        found += _details("Files of this run could not be read.", problems, "wrong")
    return found


def _details(summary: str, lines: Sequence[str], kind: str) -> str:
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return (
        f'<details class="trouble {kind}"><summary>{html.escape(summary)}</summary><ul>{items}</ul></details>'
    )


def _hash(text: str) -> str:
    """For the policy that lets a browser run this text and no other."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
