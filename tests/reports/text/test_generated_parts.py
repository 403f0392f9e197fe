"""The parts of the documents that are generated are what the published runs give."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

from benchmarks.results.run_folder import RunFolder
from reports.docs import documents, main
from reports.statistics.outcomes import PUBLISHED
from reports.statistics.paper_claims import EXPLORATORY
from reports.text.published_parts import BEGIN, END, evaluation_rows, fill, published_part

JUDGED = "quick, paper_text, ablations, equal_data"  # as in the documents: what has been judged is kept


def test_a_number_that_was_changed_by_hand_is_found_and_mended(tmp_path, capsys):
    part = published_part("table overview of quick; method, relative_excess")
    (tmp_path / "docs").mkdir()
    readme = tmp_path / "README.md"
    right = f"A\n{BEGIN.format('table overview of quick; method, relative_excess')}\n{part}\n{END}\nB\n"
    readme.write_text(right.replace("| Skinning alone | 100 ", "| Skinning alone | 99 "), encoding="utf-8")
    assert readme.read_text(encoding="utf-8") != right
    (document,) = documents(tmp_path)
    assert document == (readme, readme.read_text(encoding="utf-8"), right)


def test_a_part_without_an_end_and_a_part_of_no_form_are_refused(tmp_path):
    with pytest.raises(ValueError, match="needs an"):
        fill(BEGIN.format("front of quick"), lambda request: "")
    with pytest.raises(ValueError, match="known: docstring"):
        published_part("everything of quick")
    for request in (
        "table nothing of quick", "table overview of quick; colour", "options of benchmarks.run; --seed",
        "table overview of quick, paper_text; method; snug, nobody",
        "table energies of quick; method; snugg", "table paper_table_1 of quick",
    ):  # fmt: skip
        with pytest.raises(KeyError):
            published_part(request)


def test_the_command_checks_and_says_so(monkeypatch, tmp_path, capsys):
    page, other = tmp_path / "page.md", tmp_path / "other.md"
    same = (other, "text", "text")
    monkeypatch.setattr("reports.docs.documents", lambda: iter([(page, "text", "text"), same]))
    assert main(["--check"]) == 0 and capsys.readouterr().err == ""
    monkeypatch.setattr("reports.docs.documents", lambda: iter([(page, "text", "text\n"), same]))
    assert main(["--check"]) == 1 and not page.exists()
    assert capsys.readouterr().err.startswith(f"{page}: not what the published runs give")
    assert main([]) == 0 and page.read_text(encoding="utf-8") == "text\n" and not other.exists()


@pytest.mark.slow
def test_claims_are_judged_by_the_first_run_that_can_and_times_by_one_that_had_its_machine_to_itself():
    alone = published_part("claims exploratory of quick").splitlines()[2:]
    both = published_part(f"claims exploratory of {JUDGED}").splitlines()[2:]
    assert len(alone) == len(both) == len(EXPLORATORY)
    cells = [(before.split(" | "), after.split(" | ")) for before, after in zip(alone, both, strict=True)]
    judged = [(before, after) for before, after in cells if before[2:] != after[2:]]  # but for labels
    assert all(before[-2] == "not measured" for before, _ in judged)
    assert {after[-1] for _, after in judged} == {"paper_text |", "ablations |", "equal_data |"}
    assert any("[MB]: " in after[1] and after[-1] == "ablations |" for _, after in judged)
    assert not [1 for _, after in judged if re.search(r"\[m?s\]: ", after[1]) and after[-1] == "ablations |"]


def test_runs_alike_in_protocol_split_and_test_set_evaluations_share_a_row(tmp_path):
    number = {"protocol": {"number": "1.0"}}
    for name, config in {
        "b": {"split": "test", "test_looks": [{}]} | number,
        "a": {"split": "test", "test_looks": [{}]} | number,
        "later": {"split": "test", "test_looks": [{}, {}], "protocol": {"number": "1.1"}},
        "c": {"split": "validation", "test_looks": []} | number,
    }.items():
        (tmp_path / name).mkdir()
        RunFolder(tmp_path / name).write_config(config)
    (tmp_path / "pictures").mkdir()
    assert evaluation_rows(tmp_path)[1:] == [
        ("1.0", "test", "1", "`a`, `b`"),
        ("1.0", "validation", "0", "`c`"),
        ("1.1", "test", "2", "`later`"),
    ]


def test_table_1_of_the_paper_is_of_the_frames_of_its_own_clips():
    frames = pd.read_csv(PUBLISHED / "paper_text" / "frame_energies.csv")
    frames = frames[frames["scene"].str.contains("/01_01_|/07_02")]
    means = frames.groupby("method")[["strain", "bending", "inertia"]].mean()
    rows = [
        line.split(" | ") for line in published_part("table paper_table_1 of paper_text").split("\n")[2:5]
    ]
    assert [row[0].strip("| ") for row in rows] == [*means]
    for row, term in zip(rows, means):
        here, paper = np.array([cell.strip(" |") for cell in row[1:]], float).reshape(2, 3)
        assert here[:2] == pytest.approx(means.loc[["pbns-paper", "snug-paper"], term].to_numpy(), rel=2e-3)
        for pbns, snug, ratio in (here, paper):
            assert ratio == pytest.approx(snug / pbns, abs=6e-3)
