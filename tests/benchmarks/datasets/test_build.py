"""Data sets are built by sequence: what was interrupted, damaged or added alone is made."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks import dataset
from benchmarks.datasets import build as build_dataset
from benchmarks.fingerprint.digest import damaged
from reference_sim.trajectory import Trajectory
from snug.training.simulated_data import INDEX, MISSING, DataSet, DataSetError
from tests.benchmarks.datasets.data_by_hand import FRAMES, changed_index, words
from tests.project.own_memory import children, needs_proc, own_memory
from tests.snug.training.dressing import tube_dress


def flip(path: Path) -> None:
    """Another bit in the middle."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def digests(folder: Path) -> dict[str, dict[str, str]]:
    return {line.name: dict(line.digests) for line in DataSet.read(folder).sequences}


def complaints(folder: Path) -> dict[str, str]:
    """Sequence -> which of its files is damaged or gone."""
    lines = DataSet.read(folder).sequences
    every = {line.name: damaged(folder, line.digests) for line in lines}
    return {name: complaint for name, complaint in every.items() if complaint}


def test_the_index_says_what_there_is(built):
    data_set = DataSet.read(built)
    assert [line.name for line in data_set.sequences] == ["07_01", "02_01", "02_02"]
    assert all(line.usable and line.status == "converged" and line.seconds > 0 for line in data_set.sequences)
    for line, motion in zip(data_set.sequences, data_set.motions(), strict=True):
        whole = Trajectory.load(built / line.trajectory)
        stored = data_set.targets()[line.name]
        assert stored.shape == whole.positions.shape == (line.frames, 150, 3) and motion.frames == FRAMES
        seen = whole.positions[3:7] - tube_dress().pelvis(motion)[3:7, None]
        assert np.array_equal(stored.read(slice(3, 7), ""), seen.astype(np.float32))
    assert complaints(built) == {}
    assert not list(built.rglob("*.part*"))


def test_a_flipped_bit_is_found_and_its_sequence_alone_is_made_again(mine, tube, here, capsys):
    before, index = digests(mine), (mine / INDEX).read_text()
    flip(mine / DataSet.read(mine).sequences[1].trajectory)
    (mine / DataSet.read(mine).sequences[2].motion).unlink()
    assert complaints(mine) == {
        "02_01": "trajectories/tube-02_01/simulation.vtkhdf is damaged",
        "02_02": "trajectories/tube-02_02/motion.npz is gone",
    }
    (command,) = DataSet.read(mine).commands
    assert command.split() == ["python", "-m", "benchmarks.dataset", *words(tube, mine)[:-2]]
    assert dataset.main(words(tube, mine)) == 0
    assert here.done == 2 and digests(mine) == before and complaints(mine) == {}
    assert "3 of 3 sequences to learn from, 54 frames" in capsys.readouterr().out
    stripped = [[{**line, "seconds": 0} for line in json.loads(text)["sequences"]]
                for text in (index, (mine / INDEX).read_text())]  # fmt: skip
    assert stripped[0] == stripped[1]


def test_what_was_interrupted_goes_on(built, tube, here, tmp_path, monkeypatch):
    out = tmp_path / "cut"
    monkeypatch.setattr(here, "most", 1)
    assert dataset.main(words(tube, out)) == 130
    assert [line.status for line in DataSet.read(out).sequences] == ["converged", MISSING, MISSING]
    monkeypatch.setattr(here, "most", 100)
    assert dataset.main(words(tube, out)) == 0 and here.done == 3
    assert digests(out) == digests(built)


def test_sequences_that_only_leaves_out_stay_missing(tube, here, tmp_path):
    assert dataset.main([*words(tube, tmp_path / "new"), "--only", "failed"]) == 1  # it is not whole
    assert [line.status for line in DataSet.read(tmp_path / "new").sequences] == [MISSING] * 3


def test_halves_are_the_whole_and_nothing_is_simulated_again(built, tube, here, tmp_path, monkeypatch):
    for name, more in (("one", ["--sequences", "2"]), ("two", ["--from", "2"])):
        monkeypatch.setattr(build_dataset.provenance, "processor_name", lambda name=name: name)
        assert dataset.main(words(tube, tmp_path / "both", *more)) == 0
    both, done = tmp_path / "both", here.done
    assert digests(both) == digests(built) and done == 3
    assert [line.hardware.split()[0] for line in DataSet.read(both).sequences] == ["one", "one", "two"]
    for more in ([], ["--from", "2"]):  # and nothing is forgotten
        assert dataset.main(words(tube, both, *more)) == 0 and here.done == done
        assert digests(both) == digests(built)


def test_what_another_build_ends_while_this_one_makes_ready_is_kept(tube, here, tmp_path, monkeypatch):
    out, open_assets = tmp_path / "both", build_dataset.open_assets

    def beside(*given, **named):
        monkeypatch.setattr(build_dataset, "open_assets", open_assets)
        assert dataset.main(words(tube, out, "--sequences", "2")) == 0
        return open_assets(*given, **named)

    monkeypatch.setattr(build_dataset, "open_assets", beside)
    assert dataset.main(words(tube, out, "--from", "2")) == 0
    assert [line.usable for line in DataSet.read(out).sequences] == [True, True, True]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--settle", "5"], "another settle_frames: 2 there, 5 here"),
        (["--method", "fast-lbfgs-10"], "another method"),
        (["--method", "snug"], "--method snug: no solver is called so"),
        (["--method", "xpbd-1000"], "no solver is called so"),
        (["--frames", "2"], "--frames 2: give a whole number from 3"),
        (["--sequences", "0"], "--sequences 0: give"),
        (["--from", "3"], "--from 3: give a whole number below 3"),
        (["--garment", "toga"], "no garment is called 'toga'"),
        (["--only", "new"], "unknown state 'new'"),
    ],
)
def test_what_is_no_part_of_the_data_set_is_refused(mine, tube, here, more, message, refused):
    before = (mine / INDEX).read_bytes()
    refused(message, dataset.main, [*words(tube, mine), *more])
    assert here.done == 0 and (mine / INDEX).read_bytes() == before


def test_a_folder_of_other_things_is_refused(tube, tmp_path, refused):
    (tmp_path / "letter.txt").write_text("dear")
    refused("holds no data set", dataset.main, words(tube, tmp_path))


def test_more_sequences_are_mixed_from_the_given_ones(tube, tmp_path):
    options = dataset.make_parser().parse_args(words(tube, tmp_path, "--sequences", "36"))
    motions = build_dataset.choose_sequences(options)
    assert list(motions)[-3:] == ["05_14", "mixed_0", "mixed_1"] and len(motions) == 36
    more = dataset.make_parser().parse_args(words(tube, tmp_path, "--sequences", "40", "--from", "34"))
    later = build_dataset.choose_sequences(more)
    assert list(later) == [f"mixed_{number}" for number in range(6)]
    assert np.array_equal(later["mixed_1"].poses, motions["mixed_1"].poses)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda i: i.pop("format"), "no index of a data set"),
        (lambda i: i.update(format=9), "format '9'; this version reads 1"),
        (lambda i: i.update(sequences=3), "no index of a data set"),
        (lambda i: i["sequences"].append(i["sequences"][0]), "two sequences have one name"),
        (lambda i: i["sequences"][0].update(frames="8"), "frames is '8'"),
        (lambda i: i["sequences"][0].update(motion="../m.npz"), "lies outside of the folder"),
        (lambda i: i["sequences"][0].update(trajectory="/t.vtkhdf"), "lies outside of the folder"),
        (lambda i: i["sequences"][0].update(digests={}), "no digest of its files"),
        (lambda i: i["sequences"][0].update(colour="red"), "no index of a data set"),
        (lambda i: i.update(settings=[]), "no index of a data set"),
    ],
)
def test_a_broken_index_is_refused_in_a_line(mine, change, message):
    changed_index(mine, change)
    with pytest.raises(DataSetError, match=message) as caught:
        DataSet.read(mine)
    assert str(mine) in str(caught.value) and "\n" not in str(caught.value)


def test_a_motion_of_other_length_is_refused(mine):
    changed_index(mine, lambda index: index["sequences"][0].update(frames=7))
    with pytest.raises(DataSetError, match="18 frames, 7 by dataset"):
        DataSet.read(mine).motions()


# --- many sequences ----------------------------------------------------------------------------------------

MANY = 60


@pytest.mark.slow
@needs_proc
def test_many_sequences_survive_a_kill_and_take_no_more_memory(tube, tmp_path):
    """python -m benchmarks.dataset build with two workers, killed half-way and begun again."""
    out = tmp_path / "many"
    command = [sys.executable, "-m", "benchmarks.dataset", *words(tube, out)]
    command += ["--sequences", str(MANY), "--workers", "2"]
    entries = out / "cache" / "sequence"
    memory: dict[int, list[tuple[int, int]]] = {}
    for most in (MANY // 2, 2 * MANY):
        running = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
        while running.poll() is None and (done := len(list(entries.glob("*/*.json")))) < most:
            for pid in (running.pid, *children(running.pid)):
                memory.setdefault(pid, []).append((done, own_memory(pid)))
            time.sleep(0.2)
        if running.poll() is None:
            running.kill()
        assert running.wait() == (0 if most > MANY else -signal.SIGKILL)
    assert complaints(out) == {}
    assert len(DataSet.read(out).usable) == MANY
    for pid, seen in memory.items():
        done, kilobytes = np.array(seen, float).T
        assert kilobytes.max() < 1.2e6, f"process {pid} takes {kilobytes.max() / 1e3:.0f} MB"
        if pid == running.pid:  # it knows of all of them; workers still warm up, each by its first hundred
            late = done > done[0] + 3
            assert np.polyfit(done[late], kilobytes[late], 1)[0] < 100, "kB a sequence"
    deadline = time.monotonic() + 10.0
    while (left := [pid for pid in memory if own_memory(pid)]) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not left
