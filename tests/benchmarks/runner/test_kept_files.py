"""Nothing damaged is believed: what a run has kept is done again where it is not as it was written."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest

from benchmarks import run
from benchmarks.provenance import digest_of_file
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner import executor
from benchmarks.runner.cache import Cache
from benchmarks.runner.loop import Runner
from benchmarks.runner.rows import rows_of
from benchmarks.runner.schedule import tasks_of
from benchmarks.runner.task import Context, Outcome, RunStopped
from tests.benchmarks.runner.tasks_by_hand import InProcess
from tests.benchmarks.runner.test_cell_tasks import TINY, plan_of
from tests.benchmarks.runner.test_failed_tasks import task

QUICK = dataclasses.replace(TINY, least_seconds=0.0)
METHODS = ("simulation", "newton-1")
# What is done again where something of newton-1, or of the simulation that all are compared with, is damaged.
CELL, METRICS = "cell hanging_sheet x newton-1", "metrics hanging_sheet x newton-1"
ALL = {CELL, METRICS, "cell hanging_sheet x simulation", "metrics hanging_sheet x simulation"}


def done(folder: Path) -> tuple[Runner, dict]:
    """All tasks of a small run there, and what does not come from the clock of its rows."""
    plan = plan_of(folder, *METHODS, scene="hanging_sheet", preset=QUICK)
    runner = Runner(tasks_of(plan), Cache(RunFolder(folder)))
    runner.run(InProcess(RunFolder(folder)))
    rows = rows_of(plan, runner.tasks, runner.outcomes)
    return runner, {
        (r.method, r.metric): (r.value, r.status, r.reason) for r in rows if not r.metric.startswith("cost/")
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("whole")
    return folder, done(folder)[1]


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 16
    path.write_bytes(data)


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])


def replace(path: Path) -> None:
    """By a whole file of the same kind."""
    other = path.with_name(path.name.replace("newton-1", "simulation"))
    shutil.copyfile(other, path)


@pytest.mark.parametrize(
    ("name", "damage", "redone"),
    [
        *(
            ("trajectories/hanging_sheet/newton-1.vtkhdf", damage, {CELL, METRICS})
            for damage in (flip, truncate, replace, Path.unlink)
        ),
        ("trajectories/hanging_sheet/newton-1.npz", flip, {METRICS}),
        ("cache/cell/hanging_sheet/newton-1.json", replace, {CELL, METRICS}),
        ("cache/cell/hanging_sheet/newton-1.json", truncate, {CELL, METRICS}),
        ("cache/metrics/hanging_sheet/newton-1.json", flip, {METRICS}),
    ],
)
def test_what_is_damaged_is_done_again_alone(whole, tmp_path, name, damage, redone):
    folder = shutil.copytree(whole[0], tmp_path / "run")
    damage(folder / name)
    runner, rows = done(folder)
    assert set(runner.reused) == ALL - redone
    assert rows == whole[1]


WORN = "trajectories/tshirt-sudden_stop"
WORDS = ["smoke:garments", "--scenes", "tshirt/sudden_stop"]
WORDS += ["--methods", "simulation,skinning,supervised,snug"]


def run_dressed(folder: Path) -> dict:
    """Run the command into `folder` and return its rows without costs and measured times."""
    assert run.main([*WORDS, "-o", str(folder)]) == 0
    rows = RunFolder(folder).read_rows()
    kept = [row for row in rows if not row.metric.startswith("cost/") and row.unit not in ("s", "ms", "MB")]
    return {(r.method, r.metric, r.seed): (r.value, r.status, r.reason, r.uncertainty) for r in kept}


@pytest.fixture(scope="module")
def dressed(tmp_path_factory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("dressed")
    return folder, run_dressed(folder)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        f"{WORN}/settled.npy", f"{WORN}/body.npy", f"{WORN}/body.vtkhdf", f"{WORN}/rest_areas.npy",
        f"{WORN}/simulation.vtkhdf", f"{WORN}/quasi-static.vtkhdf", f"{WORN}/snug.npz",
        f"{WORN}/snug-quasi-static.vtkhdf", "trajectories/tshirt-07_01/simulation.vtkhdf",
        "models/supervised-seed0.safetensors",
    ],
)  # fmt: skip
def test_every_kind_of_kept_file_is_made_again_and_the_numbers_are_the_same(dressed, tmp_path, name):
    folder = shutil.copytree(dressed[0], tmp_path / "run")
    digests = RunFolder(folder).read_config()["digests"]
    flip(folder / name)
    assert digest_of_file(folder / name) != digests[name]
    assert run_dressed(folder) == dressed[1]
    config = RunFolder(folder).read_config()
    assert set(config["digests"]) == set(digests) and RunFolder(folder).changed(config) == []


def test_what_hangs_on_a_damaged_reference_is_done_again(whole, tmp_path):
    folder = shutil.copytree(whole[0], tmp_path / "run")
    flip(folder / "trajectories/hanging_sheet/simulation.vtkhdf")
    runner, rows = done(folder)
    assert runner.reused == [CELL] and rows == whole[1]
    assert len(done(folder)[0].reused) == len(ALL)


def test_a_file_damaged_while_the_run_goes_on_stops_it_and_the_next_run_heals_it(tmp_path, monkeypatch):
    folder = RunFolder(tmp_path)
    first, second = task("first"), task("second", needs=(("network", "first"),))
    cache = Cache(folder)
    monkeypatch.setattr(executor, "_context", Context(folder), raising=False)
    monkeypatch.setattr(executor, "_verified", set())
    entry = cache.keep(first, executor.perform(first.run, {}, 1.0), {})
    assert isinstance(entry.outcome, Outcome)
    needed = {first.id: entry.outcome}
    assert executor.perform(second.run, needed, 1.0).status == "ok"
    (tmp_path / "first.txt").write_text("worst")
    assert executor.perform(second.run, needed, 1.0).status == "ok"  # compared once in each process
    executor._verified.clear()
    with pytest.raises(RunStopped, match=r"^first\.txt is damaged since this run wrote it"):
        executor.perform(second.run, needed, 1.0)
    assert cache.find(first, {}).state == "missing"
