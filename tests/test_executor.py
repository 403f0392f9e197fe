"""Workers: results in order, a failure as a value, records of what has ended."""

from __future__ import annotations

import dataclasses
import os
import signal

from benchmarks import workers
from benchmarks.records import Records, Work
from benchmarks.results import RunFolder
from benchmarks.workers import Failure, Job, run_jobs


def add(wardrobe, tell, a, b):
    tell(1)
    return wardrobe, a + b


def test_workers_give_results_in_order_and_a_failure_as_a_value():
    jobs = [Job("one", add, (1, 2), 1), Job("two", add, (1, "x"), 1), Job("three", add, (3, 4), 1)]
    first, second, third = run_jobs(jobs, "held", title="adding", unit="sum")
    assert first == ("held", 3) and third == ("held", 7)
    assert isinstance(second, Failure) and second.label == "two" and "TypeError" in second.reason


def die_telling(wardrobe, tell):
    workers._progress._wlock.acquire()  # as in the midst of a report
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_worker_that_was_killed_while_it_reported_keeps_no_other_waiting():
    jobs = [Job("dies", die_telling, (), 1), Job("tells", add, (3, 4), 1)]
    died, told = run_jobs(jobs, "held", title="adding", unit="sum", workers=1)
    assert isinstance(died, Failure) and "SIGKILL" in died.reason and told == ("held", 7)


@dataclasses.dataclass
class Written:
    value: int
    files: tuple[str, ...]


def write(wardrobe, tell, folder, value):
    (folder / f"{value}.txt").write_text("x")
    return Written(value, (f"{value}.txt",))


def test_a_worker_records_what_it_has_done_and_where_it_lies(tmp_path):
    records = Records(RunFolder(tmp_path))
    works = [Work("data", f"w{value}", {"value": value}, {}) for value in range(2)]
    jobs = [Job(w.name, write, (tmp_path, k), 1, work=w, records=records) for k, w in enumerate(works)]
    run_jobs(jobs, None, title="writing", unit="file", workers=1)
    assert [records.find(work).result["value"] for work in works] == [0, 1]
    assert records.find(works[0]).state == "finished"
    assert records.find(Work("data", "w0", {"value": 5}, {})).why == "value"
    (tmp_path / "0.txt").unlink()
    gone = records.find(works[0])
    assert (gone.state, gone.why) == ("missing", "0.txt is gone")
    records.path(works[1]).write_text("{")
    assert records.find(works[1]).state == "missing"


def test_a_network_that_was_put_in_place_of_the_trained_one_is_stale(tmp_path):
    records = Records(RunFolder(tmp_path))
    model = tmp_path / "models" / "snug.safetensors"
    model.parent.mkdir()
    model.write_bytes(b"trained")
    work = Work("network", "snug", {}, {})
    records.keep(work, {}, seconds=1.0, files=[model])
    assert records.find(work).state == "finished"
    model.write_bytes(b"another")
    assert (
        records.find(work).state == "stale"
        and records.find(work).remark == "kept though models/snug.safetensors changed"
    )
