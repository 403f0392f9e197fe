"""Page one of a run as lines for a terminal."""

from __future__ import annotations

from collections.abc import Mapping

from reports.blocks.page_one_sentences import headline
from reports.run.finished_run import Run
from reports.tables.table import Table
from reports.text.text_table import aligned_text, remarks_on, text_rows


def answer(run: Run, tables: Mapping[str, Table]) -> str:
    """Return table and sentences of page one, empty where the run has neither."""
    rows = text_rows(run, tables["overview"]) if "overview" in tables else []
    parts = ["\n".join(filter(None, [aligned_text(rows), remarks_on(rows)]))] if rows else []
    sentences = [f"{topic}: {sentence}" for topic, sentence in headline(run)]
    return "\n\n".join([*parts, *(["\n".join(sentences)] if sentences else [])]).replace("\u00a0", " ")
