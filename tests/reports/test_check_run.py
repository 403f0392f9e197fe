"""What a reader would miss is found: each planted defect is one finding, and a sound run has none."""

from __future__ import annotations

import base64
import dataclasses
import re
import shutil
import zlib

import pytest
from reports.check_numbers import CONTENT, printed, strangers

from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.results.run_folder import RunFolder
from reports import build, check
from tests.reports.report_folder import declaration, row

SCENES = ("tshirt/walk", "tshirt/jump")


def sound_rows():
    """A network of two seeds, a reference and its uncertainty, a solver with repeats, a skip."""
    more = {"preset": "smoke", "commit": "abc", "hardware": "a machine"}
    rows = []
    for scene in SCENES:
        rows.append(row(scene, "simulation", "energy/total", 1.25, uncertainty=0.01, **more))
        rows += [row(scene, "snug", "energy/total", 2.0 + 0.1 * seed, seed=seed, **more) for seed in (0, 1)]
        rows += [row(scene, "snug", "cost/train", 4321.0, seed=seed, unit="s", **more) for seed in (0, 1)]
    rows += [row("tshirt/bow", "snug", "energy/total", 3.0, seed=seed, **more) for seed in (0, 1)]  # alone
    speed = {"suite": "speed", "method": "newton-4", **more}
    rows.append(row("flag", metric="cost/frame", unit="ms", value=12.5, **speed))
    rows.append(row("flag", metric="cost/spread", unit="%", value=3.0, **speed))
    skip = {"value": None, "status": "skipped", "reason": "no body here"}
    return [*rows, row("flag", "snug", "cost/frame", suite="speed", unit="ms", **skip, **more)]


def write(path, rows) -> RunFolder:
    folder = RunFolder(path)
    folder.write_rows(rows)
    folder.write_config(declaration(rows, preset="smoke", commit="abc"))
    return folder


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> RunFolder:
    folder = write(tmp_path_factory.mktemp("run"), sound_rows())
    assert build.main([str(folder.path)]) == 0
    return folder


@pytest.fixture
def copy(built, tmp_path) -> RunFolder:
    return RunFolder(shutil.copytree(built.path, tmp_path / "run"))


def lines(folder, capsys) -> list[str]:
    status = check.main([str(folder.path)])
    found = capsys.readouterr().out.splitlines()[:-1]
    assert status == (1 if found else 0)
    return [line for line in found if "report.pdf" not in line]


def of_rows(rows, tmp_path, capsys) -> list[str]:
    """Without those on files of the report, which is not made."""
    found = lines(write(tmp_path / "run", rows), capsys)
    return [line for line in found if not line.startswith(("files", "numbers"))]


def test_a_sound_run_has_no_finding(copy, capsys):
    assert lines(copy, capsys) == []


def changed(which, **values):
    return [dataclasses.replace(r, **values) if which(r) else r for r in sound_rows()]


def flag(r) -> bool:
    return r.scene == "flag"


def without(which):
    return [r for r in sound_rows() if not which(r)]


DEFECTS = {
    "unit      2 rows have none: cost/train": changed(
        lambda r: r.metric == "cost/train" and r.seed == 0, unit=""
    ),
    "energy/total has J and mJ": changed(lambda r: r.method == "snug" and r.unit == "J", unit="mJ"),
    "hardware  3 rows have no hardware: flag": changed(flag, hardware=""),
    "hardware  3 rows have no commit: flag": changed(flag, commit=""),
    "hardware  3 rows have no number of threads": changed(flag, threads=0),
    "times are of several machines: a machine, b": changed(flag, hardware="b"),
    "how sure the reference is in tshirt/walk, tshirt/jump": changed(lambda r: True, uncertainty=None),
    "spread    1 of 1 run times of suite speed were taken once": without(lambda r: r.metric == "cost/spread"),
    "spread    one seed of snug": without(lambda r: r.seed == 1),
    "seeds     snug in tshirt/walk has none of seed 1": without(lambda r: r.seed and r.scene == SCENES[0]),
    "skips     snug in tshirt/walk: stalled, without a reason": changed(
        lambda r: r.metric == "cost/train" and r.scene == SCENES[0], status="stalled"
    ),
    "no row says why tshirt/walk lacks snug": without(lambda r: r.method == "snug" and r.scene == SCENES[0]),
}


@pytest.mark.parametrize("said", DEFECTS)
def test_a_planted_defect_of_the_rows_is_found(said, tmp_path, capsys):
    found = of_rows(DEFECTS[said], tmp_path, capsys)
    assert any(said in line for line in found), found
    assert len(found) == 1


def test_a_time_that_a_program_declares_was_repeated_by_nobody_here(tmp_path, capsys):
    rows = [r for r in changed(flag, reason="as declared") if r.metric != "cost/spread"]
    assert of_rows(rows, tmp_path, capsys) == []


def test_rows_that_were_edited_are_found(copy, capsys):
    config = copy.read_config()
    copy.write_config(config | {"digests": {"results.csv": digest_of_file(copy.rows_path)}})
    assert lines(copy, capsys) == []
    copy.rows_path.write_text(copy.rows_path.read_text().replace("no body here", "no body there"))
    assert lines(copy, capsys)[0] == "files     not as the run wrote them: results.csv"


def test_tables_that_were_edited_are_found(copy, capsys):
    path = copy.tables / "energies.csv"
    path.write_text(path.read_text().replace("1.25", "1.26"))
    (copy.tables / "cost.csv").unlink()
    found = lines(copy, capsys)
    said = f"run python -m reports.build {copy.path}"
    assert f"files     tables/energies.csv is not what results.csv gives: {said}" in found
    assert f"files     tables/cost.csv is absent: {said}" in found
    assert "numbers   report.html: table energies has what tables/energies.csv has not: Total 1.25" in found
    assert any("table cost has" in line and "tables/cost.csv 0" in line for line in found)


def edited_page(folder, old: str, new: str) -> None:
    page = folder.page_path.read_text(encoding="utf-8")
    found = CONTENT.search(page)
    content = zlib.decompress(base64.b64decode(found[1])).decode()
    assert old in content
    packed = base64.b64encode(zlib.compress(content.replace(old, new).encode())).decode()
    folder.page_path.write_text(page.replace(found[1], packed), encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('["1.25",', '["1.26",', "Total 1.26"),
        ('"± 0.07"', '"± 0.08"', "Total 0.08"),
        ('["72.0 min"', '["72.2 min"', "Train 72.2 min"),
    ],
)
def test_a_number_of_the_page_that_no_csv_has_is_found(copy, capsys, old, new, said):
    edited_page(copy, old, new)
    found = lines(copy, capsys)
    assert found and all(said in line and line.startswith("numbers   report.html: table") for line in found)


def test_a_report_that_is_not_there_is_a_finding(copy, capsys):
    copy.page_path.unlink()
    assert lines(copy, capsys) == ["numbers   report.html is absent"]


def test_a_number_of_the_pdf_that_no_csv_has_is_found(copy, capsys):
    pytest.importorskip("pypdfium2", reason="pypdfium2 is not installed")
    assert check.main([str(copy.path)]) == 0
    rows = [dataclasses.replace(r, value=(r.value or 0.0) * 1.0173) for r in sound_rows() if r.value]
    other = write(copy.path.parent / "other", rows)
    build.main([str(other.path)])
    shutil.copy(other.report_path, copy.report_path)
    capsys.readouterr()
    assert check.main([str(copy.path)]) == 1
    assert re.search(r"report.pdf, page 1: in no CSV: .*1\.27", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("text", "value"),
    [("0.0201", 0.02012), ("−4.10", -4.1034), ("1,730", 1730.4), ("2.50×10⁻⁷", 2.504e-7), ("2.41 min", 144.7),
     ("3.1 h", 11200.0), ("127", 127.3)],
)  # fmt: skip
def test_a_printed_number_is_what_rounds_to_it(text, value):
    (number,) = printed(f"say {text}, or")
    assert number.text == text and number.among([value])
    assert not number.among([1.02 * value]) and not number.among([-value])


def test_a_printed_zero_is_zero():
    (number,) = printed("0")
    assert number.among([0.0]) and not number.among([1e-3])


def test_names_versions_and_dates_are_no_numbers():
    assert strangers("snug-seed1 lbfgs-40 v2.13.0 2026-11-21 in 2022, 12 of 34, x2.345", []) == []
    assert strangers("it takes 6.28 1/m and 53.0 mm, 1,234 times", [53.01]) == ["6.28", "1,234"]


def test_a_folder_that_is_no_run_is_one_line_and_status_2(built, tmp_path, capsys):
    assert check.main([str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("reports.check: ") and error.count("\n") == 1
    broken = RunFolder(shutil.copytree(built.path, tmp_path / "run"))
    broken.page_path.write_text("<html>")
    assert check.main([str(broken.path)]) == 2 and "report.html: holds no tables" in capsys.readouterr().err
