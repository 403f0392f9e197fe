"""Page of entries: tables that sort, in one file that asks for no other."""

from __future__ import annotations

import json
import string
from collections.abc import Sequence
from pathlib import Path

from reports.page.page_data import table_data
from reports.page.write_page import HERE, policy_hash
from reports.tables.entries import Scored
from reports.tables.table import Table

SCRIPTS = ("tables", "entries")  # in this order


def entries_page(path: Path, tables: Sequence[tuple[Table, Sequence[Scored]]]) -> str:
    """Return the markup of the page.

    Args:
        path: where it will be; links lead from it to pages of runs.
        tables: of reports.tables.entries.entries_tables.
    """
    content = []
    for table, scored in tables:
        data = table_data(scored[0].run, table)
        for row, entry in zip(data["rows"], scored):
            if link := entry.link(path):
                row[0] = [row[0], row[0], "", "", link]
        content.append(data)
    style = (HERE / "page.css").read_text(encoding="utf-8")
    code = "".join((HERE / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS)
    script = f"'use strict';(() => {{\n{code}}})();"
    template = string.Template((HERE / "entries.html").read_text(encoding="utf-8"))
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return template.substitute(
        style=style,
        script=script,
        style_hash=policy_hash(style),
        script_hash=policy_hash(script),
        content=text.replace("<", "\\u003c"),  # no text of an entry ends the element
    )
