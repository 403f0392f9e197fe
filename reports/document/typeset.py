"""Typesetting of report.pdf: the template with the content of a run."""

from __future__ import annotations

import json
from pathlib import Path

import typst

from benchmarks.results.run_folder import RunFolder
from reference_sim.files.atomic_files import replacing
from reports.blocks.block import Report
from reports.document.configuration import moment
from reports.document.content import content
from reports.figures.plotting import printable

TEMPLATE = Path(__file__).parent / "report.typ"


def write_pdf(folder: RunFolder, report: Report) -> Path:
    """Write report.pdf with fonts of the typesetter alone and the run's own date; return its path."""
    config = report.run.config
    finished = moment(config.get("finished")) or moment(config.get("started"))
    values = json.dumps(content(report), ensure_ascii=False, allow_nan=False)
    compiler = typst.Compiler(
        TEMPLATE.read_bytes(),
        root=str(folder.path),
        ignore_system_fonts=True,
        sys_inputs={"content": printable(values)},
    )
    with replacing(folder.report_path) as temporary:
        stamp = int(finished.timestamp()) if finished else 0
        compiler.compile(output=str(temporary), format="pdf", timestamp=stamp)
    return folder.report_path
