"""Tables for a paper and the dictionary of results.csv: complete, escaped, and the numbers of the report."""

from __future__ import annotations

import csv
import dataclasses
import re

import pytest
from matplotlib.mathtext import MathTextParser

from benchmarks.results import run_folder as results
from benchmarks.results.run_folder import RunFolder
from reports.run.finished_run import make_run
from reports.run.reading import read_run, read_run_with_trainings
from reports.tables import latex, make_tables, write_tables
from reports.tables.dictionary import dictionary
from tests.reports.report_folder import all_rows, declaration, row, run_folder

TOP = r"\begin{tabular}[t]{@{}r@{}}"
NASTY = r"a_b & 50 % $x$ #1 {c} ~ ^ \input{/etc/passwd} <b> мантия"


def rows_of():
    rows = [r for r in all_rows() if r.suite != "speed" and r.method != "supervised"]
    rows += [row("tshirt/walk", "snug", "energy/strain", 0.21, seed=1)]
    rows += [row("tshirt/walk", "pbns", "cost/train", 4000.0, unit="s")]
    rows += [row("tshirt/walk", NASTY, "energy/strain", 2.5e-7, uncertainty=1e-8)]
    rows += [row("tshirt/walk", "newton-4", "energy/strain", -1234.0, status="stalled")]
    return rows


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> RunFolder:
    folder = RunFolder(tmp_path_factory.mktemp("run"))
    folder.write_rows(rows_of())
    config = declaration(rows_of())
    config["methods"][NASTY] = {"label": NASTY}
    config["metrics"]["energy/collision"]["title"] = "Touch_ing, 5 %"
    folder.write_config(config)
    folder.tables.mkdir()
    (folder.tables / "of_before.tex").touch()
    run = read_run_with_trainings(folder)
    write_tables(folder.tables, run, make_tables(run))
    return folder


def body_of(path) -> list[list[str]]:
    text = path.read_text(encoding="utf-8")
    lines = text.partition("\\midrule\n")[2].partition("\\bottomrule")[0].splitlines()
    return [line.removesuffix(" \\\\").split(" & ") for line in lines]


def test_the_papers_tables_are_there_and_no_older_ones(made):
    names = {path.name for path in made.tables.glob("*.tex")}
    assert names == {"energies.tex", "curvature.tex", "cost.tex"}


def test_every_row_of_the_csv_is_in_the_tex_with_its_number_spread_and_mark(made):
    with (made.tables / "energies.csv").open(newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    rows = {cells[1]: cells for cells in body_of(made.tables / "energies.tex") if "input" not in cells[1]}
    assert len(rows) == len(lines) - 1
    assert rows["Simulation"][2:4] == ["$0.150$", "$0.0150$"]
    strain = next(line for line in lines if line["method"] == "snug")
    value, spread = float(strain["energy/strain [J]"]), float(strain["energy/strain_spread"])
    below = rf"\\ \tiny $\pm$ ${spread:.2f}$"
    assert (
        rows["SNUG"][2] == rf"{TOP}${value:.3f}{{}}^{{\ast}}${below}\end{{tabular}}"
    )  # one scene with seed 1
    assert rows["Newton, 4 iterations"][2] == r"$-1{,}234{}^{\ast\dagger}$"
    assert rows["Newton, 4 iterations"][3] == "--"
    cost = {cells[1]: cells for cells in body_of(made.tables / "cost.tex")}
    assert "$66.7$~min" in cost["PBNS"]


def test_headings_are_stacked_and_no_wider_than_a_word_or_two(made):
    for path in made.tables.glob("*.tex"):
        row = path.read_text(encoding="utf-8").partition("\\toprule\n")[2].partition(" \\\\\n")[0]
        heads = [re.sub(r"\\shortstack\[r\]\{(.*)\}", r"\1", head) for head in row.split(" & ")]
        lines = [line for head in heads for line in head.split("\\\\ ")]
        assert len(lines) > len(heads) > 2, path.name
        assert all(len(line) <= 12 or " " not in line for line in lines), lines
    assert "{[s]}" not in (made.tables / "cost.tex").read_text(encoding="utf-8")  # the cells say it


def test_names_are_escaped_and_powers_are_powers(made):
    text = (made.tables / "energies.tex").read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if "passwd" in line)
    name = r"a\_b \& 50 \% \$x\$ \#1 \{c\} \textasciitilde \space \textasciicircum \space "
    assert name + r"\textbackslash input\{/etc/passwd\}" in line and "мантия" in line
    assert r"}$2.50\times 10^{-7}{}^{\ast}$\\ \tiny $\pm$ $1\times 10^{-8}$\end{tabular}" in line


def test_all_math_is_math_and_nothing_else_is_special(made):
    parse = MathTextParser("agg").parse
    for path in made.tables.glob("*.tex"):
        text = path.read_text(encoding="utf-8").partition("\n")[2]
        for math in re.findall(r"(?<!\\)\$.*?(?<!\\)\$", text):
            parse(math.replace("{,}", ","))
        rest = re.sub(r"(?<!\\)\$.*?(?<!\\)\$", "", text)
        rest = rest.replace(" & ", "").replace("\\&", "")
        assert not re.search(r"(?<!\\)[$%#_&^±†×]", rest), path.name
        assert re.sub(r"\\[{}]", "", rest).count("{") == re.sub(r"\\[{}]", "", rest).count("}")


def read_dictionary(folder) -> dict[tuple[str, str], dict[str, str]]:
    with (folder.tables / "dictionary.csv").open(newline="", encoding="utf-8") as stream:
        return {(line["kind"], line["name"]): line for line in csv.DictReader(stream)}


def test_the_dictionary_has_every_column_and_what_every_row_holds(made):
    entries, rows = read_dictionary(made), made.read_rows()
    columns = [name for kind, name in entries if kind == "column"]
    assert columns == list(results.COLUMNS) == [f.name for f in dataclasses.fields(results.Row)]
    cases = read_run(made).config["cases"]
    for r in rows:
        kind, name = ("case", f"{r.scene} {r.metric}") if r.scene in cases else ("metric", r.metric)
        assert entries[kind, name]["unit"] == r.unit
    assert entries["metric", "energy/strain"]["definition"] == "definition of energy/strain"
    assert entries["metric", "energy/strain"]["better"] == "lower"
    assert ("metric", "check") not in entries and all(line["definition"] for line in entries.values())


def test_two_columns_of_one_heading_keep_their_own_numbers(tmp_path):
    rows = [
        row("tshirt/walk", "snug", f"energy/{name}", value) for name, value in (("strain", 1.0), ("own", 5.0))
    ]
    config = declaration(rows)
    config["metrics"]["energy/own"]["title"] = config["metrics"]["energy/strain"]["title"]
    run = make_run(config, rows)
    (line,) = [line for line in latex.latex(run, make_tables(run)["energies"]).splitlines() if "SNUG" in line]
    assert "1.00" in line and "5.00" in line


def test_a_table_that_the_run_has_not_is_not_written(tmp_path):
    folder = run_folder(tmp_path, [row("tshirt/walk", "snug", "energy/strain", 1.0)])
    run = read_run(folder)
    latex.write_latex(run, make_tables(run), folder.tables)
    assert [path.name for path in folder.tables.iterdir()] == ["energies.tex"]
    assert len(dictionary(run).rows) == len(results.COLUMNS) + 1
