"""The paper's tables of a run in LaTeX, the numbers as the PDF prints them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from textwrap import wrap

import pandas as pd

from reference_sim.files.atomic_files import replacing
from reports.run.finished_run import Run
from reports.tables.cell_texts import column_texts, remarks_below
from reports.tables.paper_values import PRINTED
from reports.tables.table import Table

HEAD = "% Needs \\usepackage{booktabs} and LuaLaTeX or XeLaTeX for names not Latin; as wide as two columns.\n"
FEW = 9  # columns that fit in the larger letters
LINE = 11  # letters of a heading's line
NUMBER = "\n"  # between a heading and the number of its column
MARKS = {"*": r"\ast", "†": r"\dagger", "‡": r"\ddagger", "§": r"\S"}
_POWER = re.compile("×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_PLAIN = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
_NUMBER = re.compile(r"(-?[\d,.]+(?:\\times 10\^\{-?\d+\})?)")


def write_latex(run: Run, tables: Mapping[str, Table], folder: Path) -> None:
    """Write <folder>/<name>.tex of the tables that the paper has, each whole or not at all."""
    for name in PRINTED:
        if name in tables:
            with replacing(folder / f"{name}.tex") as temporary:
                temporary.write_text(latex(run, tables[name]), encoding="utf-8", newline="\n")


def latex(run: Run, table: Table) -> str:
    """Return a table environment: names escaped, each number with its spread or uncertainty and marks."""
    columns = [
        column_texts(run, column, [row[place] for row in table.rows], [])
        for place, column in enumerate(table.columns)
    ]
    named = [f"{c.title} [{c.unit_above}]" if c.unit_above else c.title for c in table.columns]
    heads = [f"{head}{NUMBER}{place}" for place, head in enumerate(named)]  # two metrics may have one heading
    cells = {
        head: [cell["text"] if column.text else _cell(cell) for cell in texts]
        for head, column, texts in zip(heads, table.columns, columns)
    }
    texts = [head for head, column in zip(heads, table.columns) if column.text]
    styled = pd.DataFrame(cells).style.hide(axis="index")
    styled = styled.format(escape="latex", subset=texts)
    styled = styled.format_index(_stacked, escape="latex", axis="columns")
    # Without the table's note, which is on the paper's own numbers in the PDF.
    lines = [list(line) for line in zip(*columns)]
    note = remarks_below(Table(table.name, table.columns, table.rows), lines)
    kinds = "".join("l" if column.text else "r" for column in table.columns)
    text = styled.to_latex(
        column_format=kinds, hrules=True, position_float="centering", caption=_plain(table.caption),
        label=f"tab:{table.name}", environment="table*",
    )  # fmt: skip
    size, gap = ("footnotesize", 3) if len(heads) <= FEW else ("scriptsize", 2)
    text = text.replace("\\centering\n", f"\\centering\n\\{size}\\setlength{{\\tabcolsep}}{{{gap}pt}}\n")
    return HEAD + (text.replace(r"\end{table*}", f"\\par {_plain(note)}\n\\end{{table*}}") if note else text)


def _stacked(head: str) -> str:
    """Return a heading of short lines, its unit on the last: columns are as wide as their numbers."""
    head = head.partition(NUMBER)[0]
    title, _, unit = head.partition(" [")
    lines = [*wrap(title, LINE, break_long_words=False), *([f"{{[{unit}}}"] if unit else [])]
    return r"\shortstack[r]{" + r"\\ ".join(lines) + "}" if len(lines) > 1 else head


def _cell(cell: Mapping[str, str]) -> str:
    text, marks = _math(cell["text"]), "".join(MARKS.get(mark, mark) for mark in cell["mark"])
    if marks:
        text = f"{text.removesuffix('$')}{'' if text.endswith('$') else '$'}{{}}^{{{marks}}}$"
    if cell["spread"]:  # below the number: beside it a table would be too wide for a page
        text += rf"\\ \tiny $\pm$ {_math(cell['spread'].removeprefix('± '))}"
        text = rf"\begin{{tabular}}[t]{{@{{}}r@{{}}}}{text}\end{{tabular}}"
    return text


def _math(text: str) -> str:
    """Return a number as "2.50×10⁻⁷" or "1,730 s" with its digits in math, its unit not."""
    plain = _POWER.sub(lambda power: rf"\times 10^{{{power[1]}}}", text.strip())
    match = _NUMBER.match(plain.translate(_PLAIN))
    if not match:
        return "--" if plain == "–" else plain.replace("∞", r"$\infty$")
    return f"${match[1].replace(',', '{,}')}$" + plain[match.end() :].replace(" ", "~")


def _plain(text: str) -> str:
    """Return a text of the report itself, with the few signs replaced that LaTeX reads otherwise."""
    for sign, instead in (("%", r"\%"), ("±", r"$\pm$"), *((m, f"$^{{{x}}}$") for m, x in MARKS.items())):
        text = text.replace(sign, instead)
    return text
