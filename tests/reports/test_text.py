"""Results as text: tables of documents, page one in a terminal, generated parts of documents."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.declarations import attributes_of
from benchmarks.external.roll_out_files import KEYS
from benchmarks.results.row import COLUMNS, Row
from reports.docs import documents, main
from reports.statistics.effects import EXCESS, Effect
from reports.statistics.means_and_spreads import Mean
from reports.tables.table import METHOD, Column, Table
from reports.text.published_parts import (
    BEGIN,
    END,
    docstring_rows,
    fill,
    published_part,
)
from reports.text.text_table import remarks_on, text_rows
from snug.body.smpl_files import SYNONYMS
from snug.motion.files import ARRAY_NAMES
from tests.reports.report_folder import row, run_of

RUN = run_of([row("a/b", "snug", "energy/total")])


def small_table() -> Table:
    effect = Effect(value=1.5, scale=EXCESS, second=0.0, error=0.2, motions=20)
    mean = Mean(value=0.25, spread=0.01, seeds=3, asked=0)
    columns = (
        METHOD,
        Column("excess", "Excess", "%"),
        Column("total", "Total", "J"),
        Column("none", "None"),
    )
    return Table("t", columns, (("snug", effect, mean, None), ("skinning", None, None, None)))


def test_an_interval_has_a_column_of_its_own_and_empty_columns_are_left_out():
    head, snug, skinning = text_rows(RUN, small_table())
    assert head == ["Method", "Excess [%]", "Interval", "Total [J]"]
    assert snug[0] == "SNUG" and " to " in snug[2] and "±" not in snug[3] and snug[3] == "0.250"
    assert skinning == ["skinning", "–", "–", "–"]


def test_a_mean_over_fewer_roll_outs_is_marked_and_the_mark_explained():
    fewer = replace(small_table(), rows=(("snug", None, Mean(0.25, None, seeds=3, asked=3), None),))
    rows = text_rows(RUN, fewer)
    assert rows[1] == ["SNUG", "0.250*"]
    assert remarks_on(rows).startswith("* A mean over fewer") and remarks_on(rows[:1]) == ""


def test_the_docstring_of_rows_has_each_of_their_columns_once():
    assert sorted(name for names in attributes_of(Row) for name in names.split(", ")) == sorted(COLUMNS)


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


def test_a_part_without_an_end_and_a_part_of_no_form_are_refused(tmp_path):
    with pytest.raises(ValueError, match="needs an"):
        fill(BEGIN.format("front of quick"), lambda request: "")
    with pytest.raises(ValueError, match="known: docstring"):
        published_part("everything of quick")
    for request in (
        "table nothing of quick", "table overview of quick; colour", "metrics of benchmarks; colour",
        "table overview of quick, paper_text; method; snug, nobody",
        "table energies of quick; method; snugg", "table paper_table_1 of quick",
    ):  # fmt: skip
        with pytest.raises(KeyError):
            published_part(request)
