"""Results as text: tables of documents, page one in a terminal, generated parts of documents."""

from __future__ import annotations

import re
from dataclasses import replace

import pandas as pd
import pytest

from benchmarks.external.roll_out_files import KEYS
from benchmarks.results.row import Row
from benchmarks.results.run_folder import RunFolder
from reports.build import build_row
from reports.docs import documents, main
from reports.statistics.effects import EXCESS, Effect
from reports.statistics.means_and_spreads import Mean
from reports.tables.table import METHOD, REMARKS, Column, Table
from reports.text.for_your_paper import latex, write_paper_table
from reports.text.published_parts import BEGIN, END, docstring_rows, fill, published_part
from reports.text.text_table import remarks_on, text_rows
from snug.body.smpl_files import SYNONYMS
from snug.motion.files import ARRAY_NAMES
from tests.reports.report_folder import row, run_folder, run_of

RUN = run_of([row("a/b", "snug", "energy/total")])


def small_table() -> Table:
    effect = Effect(value=1.5, scale=EXCESS, second=0.0, error=0.2, motions=20)
    mean = Mean(value=0.25, spread=0.01, seeds=3, full_count=0)
    excess, total = Column("excess", "Excess", "%"), Column("total", "Total", "J")
    columns = METHOD, excess, total, Column("none", "None")
    return Table("t", columns, (("snug", effect, mean, None), ("skinning", None, None, None)))


def test_an_interval_has_a_column_of_its_own_and_empty_columns_are_left_out():
    head, snug, skinning = text_rows(RUN, small_table())
    assert head == ["Method", "Excess [%]", "Interval", "Total [J]"]
    assert snug[0] == "SNUG" and " to " in snug[2] and "±" not in snug[3] and snug[3] == "0.250"
    assert skinning == ["skinning", "–", "–", "–"]
    assert remarks_on([["*"], ["1.5*†"], ["2"]]) == f"{REMARKS['*']} {REMARKS['†']}"


@pytest.mark.parametrize(
    ("module", "names"),
    [
        ("snug.body.smpl_files", [name for names in SYNONYMS.values() for name in names]),
        ("snug.motion.files", ARRAY_NAMES),
        ("benchmarks.external.roll_out_files", KEYS),
    ],
)
def test_tables_of_files_have_every_array_that_is_read(module, names):
    table = " ".join(cell for row in docstring_rows(module) for cell in row)
    assert not [name for name in names if f"`{name}`" not in table]


def test_a_number_that_was_changed_by_hand_is_found_and_mended(tmp_path, monkeypatch, capsys):
    request = "table overview of quick; method, relative_excess"
    right = f"A\n{BEGIN.format(request)}\n{published_part(request)}\n{END}\nB\n"
    wrong = right.replace("| Skinning alone | 100 ", "| Skinning alone | 99 ")
    (tmp_path / "docs").mkdir()
    readme = tmp_path / "README.md"
    readme.write_text(wrong, encoding="utf-8")
    monkeypatch.setattr("reports.docs.documents", lambda: documents(tmp_path))
    assert main(["--check"]) == 1 and readme.read_text(encoding="utf-8") == wrong != right
    assert capsys.readouterr().err.startswith(f"{readme}: not what the published runs give")
    assert main([]) == 0 and readme.read_text(encoding="utf-8") == right
    capsys.readouterr()
    assert main(["--check"]) == 0 and capsys.readouterr().err == ""


def test_a_part_without_an_end_and_a_part_of_no_form_are_refused():
    with pytest.raises(ValueError, match="needs an"):
        fill(BEGIN.format("front of quick"), lambda request: "")
    with pytest.raises(ValueError, match="known: docstring"):
        published_part("everything of quick")
    with pytest.raises(ValueError, match="'front of' names nothing"):
        published_part("front of")
    with pytest.raises(ImportError, match="nope"):
        published_part("docstring of snug.nope")
    for request in (
        "table nothing of quick", "table overview of quick; colour", "metrics of benchmarks; colour",
        "table overview of quick, paper_text; method; snug, nobody",
        "table energies of quick; method; snugg", "table paper_table_1 of quick",
    ):  # fmt: skip
        with pytest.raises(KeyError, match=request.split()[-1]):
            published_part(request)


HOSTILE = r"50% off_{a} & #1 [b] ~^ \x"


def rows_for_a_paper(**fields) -> list[Row]:
    """Rows of five motions and two seeds of SNUG between simulation and skinning, each with its numbers."""
    energy = {"simulation": 1.0, "skinning": 11.0, "snug": 2.0}
    rows = [
        row(f"tshirt/m{k}", name, "energy/total", value * (k + 1) ** (0.1 * seed), seed=seed, **fields)
        for k in range(5) for name, value in energy.items() for seed in range(1 + (name == "snug"))
    ]  # fmt: skip
    fields |= {"unit": "%", "method": "snug"}
    rows += [row(f"tshirt/m{k}", metric="penetration/surface", value=0.5 + k, **fields) for k in range(5)]
    return [*rows, row("tshirt/m0", metric="cost/frame", value=0.25, **fields | {"unit": "ms"})]


def test_the_table_for_a_paper_has_intervals_counts_protocol_and_columns_of_the_run_alone(tmp_path):
    run = run_of(rows_for_a_paper(protocol="2.0"), commit="abc123")
    write_paper_table(RunFolder(tmp_path), replace(run, protocol="2.0"))
    lines = pd.read_csv(tmp_path / "for_your_paper.csv", na_values="-").set_index("method")
    assert list(lines.index) == ["simulation", "skinning", "snug"]
    snug = lines.loc["snug"]
    assert (snug["sources"], snug["seeds"]) == (5, 2)
    assert snug["relative_excess [%]"] == pytest.approx(10, 0.2)
    assert snug["relative_excess_low"] < snug["relative_excess [%]"] < snug["relative_excess_high"]
    assert snug["penetration/surface [%]"] == 2.5
    assert snug["penetration/surface_low"] == pytest.approx(0.537, 1e-2)
    assert snug["cost/frame [ms]"] == 0.25 and not {"distance/rms [mm]", "own_excess [%]"} & set(lines)
    assert "Protocol 2.0; cite: Neural garments" in snug["caption"] and "abc123" in snug["caption"]
    assert "intervals" in snug["caption"]
    one_motion = [r for r in rows_for_a_paper() if r.scene == "tshirt/m0"]
    write_paper_table(RunFolder(tmp_path), run_of(one_motion))
    assert "intervals" not in (tmp_path / "for_your_paper.csv").read_text(encoding="utf-8")


def test_a_mean_that_lacks_roll_outs_has_a_mark_and_the_mark_its_meaning(tmp_path):
    last = {"simulation": 1.0, "skinning": 11.0, "snug": -99.0}  # it fell off
    rows = [*rows_for_a_paper(), *(row("tshirt/m5", m, "energy/total", x) for m, x in last.items())]
    rows.append(row("tshirt/m1", "skinning", "penetration/surface", 4.0, unit="%"))
    text = build_row(run_folder(tmp_path, rows).path)
    assert "| 4.0* |" in text and re.search(r"\| 1\d\* \|", text) and text.endswith(REMARKS["*"])
    tex = (tmp_path / "for_your_paper.tex").read_text(encoding="utf-8")
    assert "& 4.0* &" in tex and REMARKS["*"] in tex
    marks = pd.read_csv(tmp_path / "for_your_paper.csv")["lacking"]
    assert list(marks) == ["-", "penetration/surface", "relative_excess"]


def test_the_latex_of_the_table_for_a_paper_is_sound_whatever_names_hold(tmp_path):
    run = run_of(rows_for_a_paper())
    methods = {**run.methods, "snug": replace(run.methods["snug"], label=HOSTILE)}
    write_paper_table(RunFolder(tmp_path), replace(run, methods=methods))
    text = (tmp_path / "for_your_paper.tex").read_text(encoding="utf-8")
    assert text.isascii() and (text.count("$") - text.count(r"\$")) % 2 == 0
    assert re.findall(r"\\begin\{(.*?)\}", text) == re.findall(r"\\end\{(.*?)\}", text)[::-1]
    plain = re.sub(r"\\[\\&%$#_{}]|\\[a-z]+", "", text)
    assert plain.count("{") == plain.count("}") and not set(plain) & set("#_^~\\")
    assert plain.count("%") == 1 and plain.startswith("% Needs")  # the one comment
    body = text[text.index(r"\toprule") :].split("\\\\[4pt]\n")[:-1]
    assert len(body) == 4 and {re.sub(r"\\&", "", line).count("&") for line in body} == {5}
    assert latex(HOSTILE) == (
        r"50\% off\_\{a\} \& \#1 {[}b{]} \textasciitilde{}\textasciicircum{} \textbackslash{}x"
    )


def test_times_stand_as_published_and_as_measured():
    head, *rows = (
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in published_part("times of quick, other_networks; tailornet, snug, ncs").splitlines()
    )
    assert head[0] == "Method" and all(len(row) == len(head) for row in rows)
    names = [row[0] for row in rows[1:]]
    assert names[:5] == ["TailorNet"] * 3 + ["SNUG", "Neural Cloth Simulation"]
    assert "HyperBones" in names[5:]
    by_name = {row[0]: row for row in rows}
    assert by_name["SNUG"][1] == "2.2" and "table 3" in by_name["SNUG"][3]
    assert all(float(cell) > 0 for cell in by_name["SNUG"][4:6])
    assert by_name["HyperBones"][4:] == ["–"] * 3
    assert all(row[3] != "–" for row in rows[1:] if row[1] != "–")  # no time without its source
