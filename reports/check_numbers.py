"""Whether the numbers of the report are those of the run's CSV files."""

from __future__ import annotations

import base64
import csv
import json
import math
import re
import tempfile
import zlib
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from benchmarks.results.json_file import ResultsError
from benchmarks.results.run_folder import RunFolder
from reports.run.configuration import moment
from reports.run.rows import Run
from reports.tables import paper
from reports.tables.dictionary import dictionary
from reports.tables.tables import make_tables

CONTENT = re.compile(r'<script type="text/plain" id="content">([^<]*)</script>')
NUMBER = re.compile(
    r"(?<![\w.])([−-]?)(\d{1,3}(?:,\d{3})+|\d+)(\.\d+)?(?:×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?(?: (s|min|h)\b)?(?![\w.]*\d)"
)
RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
SECONDS = {"min": 60.0, "h": 3600.0}  # a duration is printed in one of them
LEAST = 3  # significant digits of a number of the PDF that is looked for
SHOWN = 6  # numbers in a line


@dataclass(frozen=True)
class Printed:
    """A number as it is printed, and between which two it was before it was rounded."""

    text: str
    low: float
    high: float
    digits: int

    @property
    def year(self) -> bool:
        """Of four digits without a comma, as the report prints no other number."""
        return len(self.text) == 4 and self.text.isdigit()

    def among(self, numbers: Sequence[float]) -> bool:
        """Whether one of the numbers, in order, is printed so."""
        place = bisect_left(numbers, self.low)
        return place < len(numbers) and numbers[place] <= self.high


def printed(text: str) -> Iterator[Printed]:
    """The numbers in a text, of durations in seconds: "−0.0134", "1,730", "2.50×10⁻⁷", "2.41 min"."""
    for found in NUMBER.finditer(text):
        sign, whole, fraction, power, unit = found.groups(default="")
        scale = 10.0 ** int(power.translate(RAISED) or 0) * SECONDS.get(unit, 1.0)
        value = float(whole.replace(",", "") + fraction) * scale * (-1.0 if sign else 1.0)
        half = 0.5 * 10.0 ** -max(len(fraction) - 1, 0) * scale * (1.0 + 1e-6) + 1e-9 * abs(value)
        half = half if value else 0.0  # what is printed as 0 is 0
        digits = len((whole + fraction).replace(",", "").replace(".", "").lstrip("0"))
        yield Printed(found[0].strip(), value - half, value + half, digits)


def tables_as_made(folder: RunFolder, run: Run) -> Iterator[str]:
    """Tables on disk that are not what results.csv gives."""
    with tempfile.TemporaryDirectory() as temporary:
        made = [table.write_csv(Path(temporary)) for table in (*make_tables(run).values(), dictionary(run))]
        for path in made:
            there = folder.tables / path.name
            if not there.is_file() or there.read_bytes() != path.read_bytes():
                state = "is not what results.csv gives" if there.is_file() else "is absent"
                yield f"tables/{path.name} {state}: run python -m reports.build {folder.path}"


def numbers_of_pages(folder: RunFolder) -> Iterator[str]:
    """Of report.html cell by cell, of report.pdf among all."""
    if folder.page_path.is_file():
        yield from _of_page(folder)
    else:
        yield "report.html is absent"
    if not folder.report_path.is_file():
        yield "report.pdf is absent"
    elif find_spec("pypdfium2"):
        yield from _of_pdf(folder)


def _of_page(folder: RunFolder) -> Iterator[str]:
    """Each line of its tables beside the same line of the CSV."""
    found = CONTENT.search(folder.page_path.read_text(encoding="utf-8"))
    try:
        content = json.loads(zlib.decompress(base64.b64decode(found[1] if found else "")))
        tables = {str(table["name"]): (table["columns"], table["rows"]) for table in content["tables"]}
    except (ValueError, KeyError, TypeError, zlib.error):
        raise ResultsError(f"{folder.page_path}: holds no tables of this project") from None
    for name, (columns, rows) in tables.items():
        path = folder.tables / f"{name}.csv"
        lines = _lines(path) if path.is_file() else []
        if len(lines) != len(rows):
            yield f"report.html: table {name} has {len(rows)} lines, tables/{name}.csv {len(lines)}"
            continue
        wrong = [
            f"{column['title']} {number.text}"
            for row, numbers in zip(rows, lines)
            for column, cell in zip(columns, row)
            if isinstance(cell, list)  # a number; a text is none
            for number in printed(f"{cell[0]}; {cell[2]}".replace("×", "", 1 if cell[0][:1] == "×" else 0))
            if not number.among(numbers)
        ]
        if wrong:
            yield f"report.html: table {name} has what tables/{name}.csv has not: {_listed(wrong)}"


def _of_pdf(folder: RunFolder) -> Iterator[str]:
    """Each number of so many digits beside all of the run's CSV files and run.json, and the paper's own."""
    from pypdfium2 import PdfDocument

    known = known_numbers(folder)
    for place, page in enumerate(PdfDocument(folder.report_path), 1):
        text = page.get_textpage().get_text_range()
        if wrong := strangers(text, known):
            yield f"report.pdf, page {place}: in no CSV: {_listed(wrong)}"


def strangers(text: str, known: Sequence[float]) -> list[str]:
    """The numbers of a text that are not among the known ones, in order; years and short numbers are none."""
    return [n.text for n in printed(text) if n.digits >= LEAST and not n.year and not n.among(known)]


def known_numbers(folder: RunFolder) -> list[float]:
    """Those of all CSV files and of words in them, of run.json, how long the run took, and of the paper."""
    paths = [*folder.tables.glob("*.csv"), folder.rows_path]
    known = {number for path in paths for line in _lines(path, words=True) for number in line}
    config = folder.read_config()
    start, end = moment(config.get("started")), moment(config.get("finished"))
    if start and end and (start.tzinfo is None) == (end.tzinfo is None):
        known.add((end - start).total_seconds())
    known.update(_numbers_in(config))
    known.update(_numbers_in(paper.PRINTED))
    return sorted(known)


def _lines(path: Path, *, words: bool = False) -> list[list[float]]:
    """The numbers of each line of a CSV, in order; also those in its texts."""
    with path.open(newline="", encoding="utf-8") as stream:
        return [sorted(_floats(cells, words)) for cells in list(csv.reader(stream))[1:]]


def _floats(cells: Iterable[str], words: bool) -> Iterator[float]:
    for cell in cells:
        try:
            value = float(cell)
        except ValueError:
            yield from ((n.low + n.high) / 2.0 for n in printed(cell) if words)
            continue
        if math.isfinite(value):
            yield value


def _numbers_in(value: Any) -> Iterator[float]:
    """All numbers in JSON values and their texts."""
    if isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _numbers_in(inner)
    elif isinstance(value, str):
        yield from ((n.low + n.high) / 2.0 for n in printed(value))
    elif isinstance(value, int | float):
        yield float(value)


def _listed(texts: Sequence[str]) -> str:
    more = f" and {len(texts) - SHOWN} more" if len(texts) > SHOWN else ""
    return ", ".join(texts[:SHOWN]) + more
