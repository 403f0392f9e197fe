"""Data sets: built by sequence, and learned from without being in memory."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks import dataset
from benchmarks.datasets import build as build_dataset
from benchmarks.fingerprint.digest import damaged
from benchmarks.tasks import ground_truth
from reference_sim.trajectory.trajectory import Trajectory
from snug import train as train_command
from snug.motion.library import make_motion
from snug.networks.dressed_body import DressedBody
from snug.networks.tensor_file import TensorFileError
from snug.recipes.named import RECIPE_OF_KIND
from snug.training.checkpoint import Checkpoint
from snug.training.losses.vertex_targets import TargetError
from snug.training.simulated_data import INDEX, MISSING, DataSet, DataSetError, settings_of
from snug.training.train_network import train_network
from snug.training.training_loop import Interrupted
from tests.benchmarks.runner.tasks_by_hand import InProcess
from tests.project.own_memory import children, needs_proc, own_memory
from tests.snug.training.dressing import tube_dress

FRAMES = 18  # two windows of the supervised network


@pytest.fixture(scope="module")
def tube(tmp_path_factory) -> Path:
    """The tube of the other tests as a garment of one's own."""
    path = tmp_path_factory.mktemp("garment") / "tube.obj"
    garment = tube_dress().garment
    lines = ["v {!r} {!r} {!r}".format(*map(float, point)) for point in garment.rest_positions]
    lines += ["f {} {} {}".format(*face) for face in garment.faces + 1]
    path.write_text("\n".join(lines))
    np.savez(path.with_name("tube.weights.npz"), weights=garment.skinning_weights)
    return path


class Here(InProcess):
    """Simulates in this process; stops as by Ctrl-C after `most` sequences."""

    most, done = 1_000_000, 0

    def __init__(self, plan, folder, assets) -> None:
        super().__init__(folder, assets)

    def together(self, ready, bar):
        for one in super().together(ready, bar):
            Here.done += 1
            yield one
            if Here.done >= Here.most:
                raise KeyboardInterrupt


def draped(scene, entry, folder) -> Trajectory:
    """In place of a simulation: the garment skinned to the body, and times as a clock shows them."""
    worn = scene.dressed
    positions = DressedBody(worn.body, worn.garment).skinned(worn.motion)
    clock = np.full(len(positions), time.perf_counter())
    times = np.arange(len(positions)) / worn.motion.fps
    return Trajectory(positions, worn.garment.faces, times, clock, status="converged")


make_once = cache(make_motion)  # half a second for each command otherwise


@pytest.fixture
def here(monkeypatch):
    """No processes and no simulation."""
    monkeypatch.setattr(build_dataset, "executor_of", Here)
    monkeypatch.setattr(ground_truth, "simulated", draped)
    monkeypatch.setattr(build_dataset, "embedded_motions", lambda names: [*map(make_once, names)])
    monkeypatch.setattr(Here, "done", 0)
    return Here


def words(tube: Path, out: Path, *more: str) -> list[str]:
    given = ["--sequences", "3", "--frames", str(FRAMES), "--settle", "2", "--garment", str(tube)]
    return ["build", *given, *more, "-o", str(out)]


@pytest.fixture(scope="module")
def built(tube, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("data") / "three"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build_dataset, "executor_of", Here)
        patch.setattr(ground_truth, "simulated", draped)
        assert dataset.main(words(tube, out)) == 0
    return out


@pytest.fixture
def mine(built, tmp_path) -> Path:
    """A copy to damage."""
    return Path(shutil.copytree(built, tmp_path / "mine"))


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
    found = DataSet.read(built)
    assert [line.name for line in found.sequences] == ["07_01", "02_01", "02_02"]
    assert all(line.usable and line.status == "converged" and line.seconds > 0 for line in found.sequences)
    for line, motion in zip(found.sequences, found.motions(), strict=True):
        whole = Trajectory.load(built / line.trajectory)
        stored = found.targets()[line.name]
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


def _index(folder: Path, change) -> None:
    index = json.loads((folder / INDEX).read_text())
    change(index)
    (folder / INDEX).write_text(json.dumps(index))


@pytest.mark.parametrize(
    ("more", "said"),
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
def test_what_is_no_part_of_the_data_set_is_refused(mine, tube, here, more, said, refused):
    before = (mine / INDEX).read_bytes()
    refused(said, dataset.main, [*words(tube, mine), *more])
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
    ("change", "said"),
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
def test_a_broken_index_is_refused_in_a_line(mine, change, said):
    _index(mine, change)
    with pytest.raises(DataSetError, match=said) as caught:
        DataSet.read(mine)
    assert str(mine) in str(caught.value) and "\n" not in str(caught.value)


def test_a_motion_of_other_length_is_refused(mine):
    _index(mine, lambda index: index["sequences"][0].update(frames=7))
    with pytest.raises(DataSetError, match="18 frames, 7 by dataset"):
        DataSet.read(mine).motions()


# --- learning from it --------------------------------------------------------------------------------------


def taught(built: Path, kind: str, *, stored: bool, steps: int = 3, **options):
    """A network of the data set, from the files or from memory."""
    found = DataSet.read(built)
    trajectories: dict = found.targets()
    if not stored:
        trajectories = {
            line.name: Trajectory.load(built / line.trajectory).positions for line in found.sequences
        }
    return train_network(
        kind, tube_dress(), found.motions(), steps=steps, seed=0, recipe=RECIPE_OF_KIND[kind],
        trajectories=trajectories, progress=False, every=1, **options,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["supervised", "tailornet"])
def test_files_teach_the_same_as_memory_to_the_last_bit(built, kind):
    there, stored = (taught(built, kind, stored=stored) for stored in (False, True))
    for name, tensor in there.network.state_dict().items():
        assert tensor.equal(stored.network.state_dict()[name]), name
    assert [row["loss"] for row in there.history] == [row["loss"] for row in stored.history]


def test_a_training_from_files_goes_on_only_with_the_same_files(built, mine, tmp_path):
    checkpoint = Checkpoint(path=tmp_path / "c.safetensors", resume=True)
    count = iter(range(10))
    with pytest.raises(Interrupted):
        taught(
            built, "supervised", stored=True, steps=4, checkpoint=checkpoint, stop=lambda: next(count) == 1
        )
    whole, resumed = taught(built, "supervised", stored=True, steps=4), None
    _index(mine, lambda i: i["sequences"][0]["digests"].update({i["sequences"][0]["vertices"]: "0"}))
    with pytest.raises(TensorFileError, match="another data"):
        taught(mine, "supervised", stored=True, steps=4, checkpoint=checkpoint)
    resumed = taught(built, "supervised", stored=True, steps=4, checkpoint=checkpoint)
    for name, tensor in whole.network.state_dict().items():
        assert tensor.equal(resumed.network.state_dict()[name]), name


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda x: x.__setitem__((5, 7, 1), np.nan) or x, "'02_01' is not finite at frame 5"),
        (lambda x: x[:-1], "expected \\(18, 150, 3\\) of float32"),
        (lambda x: x.astype(float), "of float64, expected"),
        (lambda x: np.array(["a", None], dtype=object), "02_01"),
        (lambda x: None, "02_01"),
    ],
)
@pytest.mark.parametrize("kind", ["supervised", "tailornet"])
def test_vertices_that_are_not_as_the_index_says_are_named(mine, kind, damage, said):
    path = mine / DataSet.read(mine).sequences[1].vertices
    found = damage(np.load(path))
    path.write_bytes(path.read_bytes()[:-9]) if found is None else np.save(path, found)
    with pytest.raises(TargetError, match=said):
        taught(mine, kind, stored=True)


def test_the_command_learns_from_a_data_set(built, tube, tmp_path, capsys):
    out = tmp_path / "m.safetensors"
    given = ["--dataset", str(built), "--steps", "2", "-o", str(out)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(signal, "signal", lambda *_: None)
        assert train_command.main([*given, "--model", "supervised", "--garment", str(tube)]) == 0
        assert out.is_file() and "3 motions, 54 frames, recipe supervised" in capsys.readouterr().out
        assert train_command.main([*given, "--vertices", "300"]) == 2
        assert "another garment: tube there, tshirt here" in capsys.readouterr().err
    for words, said in (
        (["--model", "supervised"], "learns from simulations; add --dataset DIR"),
        (["--dataset", "x", "--motions", "y"], "leave out --motions"),
        (["--dataset", "x", "--model", "tailornet", "--recipe", "paper"], "leave out --recipe"),
        (["--dataset", str(tmp_path)], "no such file"),
    ):
        assert train_command.main(words) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1


def test_settings_tell_garments_and_bodies_apart():
    import dataclasses

    dressed = tube_dress()
    own = settings_of(dressed.body, dressed.garment)
    moved = dressed.garment.rest_positions.copy()
    moved[3, 1] += 1e-5
    larger = dataclasses.replace(dressed.body, template=1.01 * dressed.body.template)
    others = {
        "mesh": settings_of(dressed.body, dataclasses.replace(dressed.garment, rest_positions=moved)),
        "body": settings_of(larger, dressed.garment),
    }
    for name, other in others.items():
        assert [key for key in own if own[key] != other[key]] == [name]
    rounded = dataclasses.replace(dressed.garment, rest_positions=dressed.garment.rest_positions + 1e-12)
    assert settings_of(dressed.body, rounded) == own


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
