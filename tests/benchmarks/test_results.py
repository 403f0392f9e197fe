"""The result files: what is written is read back, broken files are named, nothing half-written stays."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.results import run_folder
from benchmarks.results.row import COLUMNS, ResultsError, Row
from benchmarks.results.run_folder import RunFolder
from reports.finished_run import read_run

ROWS = [
    Row("garments", "dressed/walk", "snug", 0, "energy/strain", "J", 0.1 + 0.2, terms="strain+gravity"),
    Row("garments", "dressed/walk", "pbns", 0, "energy/inertia", "J", None, "skipped", 'no "v", at all'),
    Row("validation", "free_fall", "simulation", 3, "check", "m", 1e-17, expected=0.0, tolerance=1e-12),
    Row(
        "garments", "dressed/walk", "snug", 0, "energy/strain", "J", 0.1, uncertainty=1e-17,
        moved=(("simulation-refrozen", -0.1), ("simulation-dt/2", 1e-17)), seeded=True, level=0.3,
    ),
    Row("extremes", "stiff", "simulation", 0, "outcome", "weights", float("nan"), "failed", "=line\ntwo"),
]  # fmt: skip


def test_rows_come_back_digit_for_digit_and_no_text_of_them_is_a_formula(tmp_path):
    folder = RunFolder(tmp_path / "run")
    folder.write_rows(ROWS)
    *back, last = folder.read_rows()
    assert back == ROWS[:-1]
    assert last.reason == "'=line two" and last.value != last.value
    assert sorted(path.name for path in folder.path.iterdir()) == ["results.csv"]


def test_no_table_mixes_rows_of_two_protocols(tmp_path):
    folder = RunFolder(tmp_path)
    folder.write_config({"preset": "quick"})
    folder.write_rows([dataclasses.replace(ROWS[k], protocol=n) for k, n in ((0, "1.0"), (2, "1.1"))])
    with pytest.raises(ResultsError, match=r"results\.csv: rows of protocols 1\.0 and 1\.1 do not stand"):
        read_run(folder)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"status": "fine"}, "status 'fine'"),
        ({"value": None}, "finite value"),
        ({"value": None, "status": "skipped"}, "reason"),
        ({"status": "skipped", "reason": "why"}, "no value"),
    ],
)
def test_a_row_that_says_nothing_true_is_refused(changes, word):
    with pytest.raises(ResultsError, match=word):
        dataclasses.replace(ROWS[0], **changes)


ABSENT = "no such file; is this the folder of a run"
COLUMN_LINE, HEAD = ",".join(COLUMNS) + "\n", "scene,method,seed,seconds,strain,total\n"


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [
        ("results.csv", None, ABSENT),
        ("results.csv", COLUMN_LINE + "1,2\n", "line 2: .*shorter"),
        (
            "results.csv",
            COLUMN_LINE + "s,c,m,zero,x,J,1,ok,,,,,,,,,,,1,,,,,,,,,false,\n",
            "line 2: .*'zero'",
        ),
        ("results.csv", COLUMN_LINE + "\xff\xfe", "line .*utf-8"),
        ("run.json", "{", "not readable as JSON"),
        ("run.json", '{"preset": "smoke"}', "written by an earlier version .* new folder"),
        ("frame_energies.csv", "scene,method,seed,seconds\n", "the columns should be scene,method,seed"),
        ("frame_energies.csv", HEAD + "kick,snug,0,0.1,1,2\nkick,snug,0,0.2,high,2\n", "high"),
    ],
)
def test_a_file_that_is_absent_or_broken_is_named(tmp_path, name, text, word):
    folder, path = RunFolder(tmp_path / "run"), tmp_path / "run" / name
    if text is not None:
        path.parent.mkdir()
        path.write_bytes(text.encode("latin-1"))
    read = {
        "results.csv": folder.read_rows, "run.json": folder.read_config,
        "frame_energies.csv": lambda: run_folder.read_frame_energies(path),
    }[name]  # fmt: skip
    with pytest.raises(ResultsError, match=word) as refused:
        read()
    assert str(refused.value).startswith(f"{path}: ") and len(str(refused.value)) < 900
    assert text is not None or not folder.path.exists()


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    folder = RunFolder(tmp_path)
    folder.write_rows(ROWS[:1])

    def rows():
        yield ROWS[1]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        folder.write_rows(rows())
    assert folder.read_rows() == ROWS[:1]
    assert [path.name for path in tmp_path.iterdir()] == ["results.csv"]
