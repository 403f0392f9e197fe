"""The check of a run reports each planted defect as one finding, and none in a sound run."""

from __future__ import annotations

import dataclasses
import shutil

import pytest

from benchmarks.provenance import digest_of_file
from benchmarks.results.run_folder import RunFolder
from reports import build, check
from tests.reports.report_folder import row, run_folder

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


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> RunFolder:
    folder = run_folder(tmp_path_factory.mktemp("run"), sound_rows(), preset="smoke", commit="abc")
    assert build.main([str(folder.path)]) == 0
    return folder


@pytest.fixture
def copy(built, tmp_path) -> RunFolder:
    return RunFolder(shutil.copytree(built.path, tmp_path / "run"))


def lines(folder, capsys) -> list[str]:
    status = check.main([str(folder.path)])
    complaints = capsys.readouterr().out.splitlines()[:-1]
    assert status == (1 if complaints else 0)
    return complaints


def of_rows(rows, tmp_path, capsys) -> list[str]:
    """Without those on files of the report, which is not made."""
    complaints = lines(run_folder(tmp_path / "run", rows, preset="smoke", commit="abc"), capsys)
    return [line for line in complaints if not line.startswith("files")]


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


@pytest.mark.parametrize("complaint", DEFECTS)
def test_a_planted_defect_of_the_rows_is_found(complaint, tmp_path, capsys):
    complaints = of_rows(DEFECTS[complaint], tmp_path, capsys)
    assert any(complaint in line for line in complaints), complaints
    assert len(complaints) == 1


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
    complaints = lines(copy, capsys)
    advice = f"run python -m reports.build {copy.path}"
    assert f"files     tables/energies.csv is not what results.csv gives: {advice}" in complaints
    assert f"files     tables/cost.csv is absent: {advice}" in complaints
    assert len(complaints) == 2


def test_a_report_that_is_not_there_is_a_finding(copy, capsys):
    copy.page_path.unlink()
    copy.report_path.unlink()
    again = f"run python -m reports.build {copy.path}"
    missing = ["report.html", "report.pdf"]
    assert lines(copy, capsys) == [f"files     {name} is absent: {again}" for name in missing]


def test_a_folder_that_is_no_run_is_one_line_and_status_2(tmp_path, refused):
    assert refused("is this the folder of a run?", check.main, [str(tmp_path)]).startswith("reports.check: ")
