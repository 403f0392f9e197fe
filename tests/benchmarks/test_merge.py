"""Runs of several machines in one folder: what has to be equal is, and times are of one machine."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
import torch

from benchmarks.fingerprint.digest import digest_of_file
from benchmarks.merge import MergeError, joined_rows, merge, of_machines
from benchmarks.results.row import DECLARED, Row
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.cache import Cache
from benchmarks.tasks.task import Outcome, Task
from snug.networks.tensor_file import write_tensors

CONFIG = {
    "preset": "smoke", "preset_values": {"frames": 20}, "split": "test", "body": "of the package",
    "garment": "tailored", "seeds": [0], "suites": ["garments"], "started": "2026-01-01T10:00:00+00:00",
    "finished": "2026-01-01T11:00:00+00:00", "hardware": {"processor": "A"}, "command": "run A",
    "motions": {"train tshirt": ["walk"], "frames": {"walk": 20}},
    "metrics": {"energy/total": {"title": "Total", "unit": "J"},
        "cost/frame": {"title": "Frame", "unit": "ms", "of": "machine"}},
    "methods": {"snug": {"label": "SNUG"}},
    "scenes": {"tshirt/kick": {"role": "test"}}, "cases": {}, "test_looks": [{"rows": "1"}],
    "tasks": {"training": {"snug seed 0 (tshirt)": {"seconds": 3.0}}},
}  # fmt: skip
TIMED = frozenset(("cost/frame", "cost/spread", "cost/train"))


def row(metric: str, value: float | None, unit: str = "J", **fields) -> Row:
    given = {"method": "snug", "seed": 0, "hardware": "A", **fields}
    return Row(suite="garments", scene="tshirt/kick", metric=metric, unit=unit, value=value, **given)


class Run(Task):
    kind = "cell"
    stage = "cells"


class Train(Task):
    kind = "network"
    stage = "training"


def cell(name: str, machine: str, **inputs) -> Task:
    given = {"scene": "kick", "machine": machine, **inputs}
    return Run(name=name, label=name, inputs=given, code=("benchmarks/results",))


@pytest.fixture
def folder(tmp_path):
    """Writes the folder of a run, with a file of each cell."""

    def made(name: str, rows: list[Row], *, cells=("kick",), changes=None, **inputs) -> Path:
        run = RunFolder(tmp_path / name)
        (run.path / "trajectories").mkdir(parents=True)
        run.write_rows(rows)
        digests = {run.rows_path.name: digest_of_file(run.rows_path)}
        for title in cells:
            file = run.path / "trajectories" / f"{title}.npy"
            file.write_text(f"{title} of {name}")
            kept = Cache(run).keep(cell(title, name, **inputs), Outcome(files=(run.relative(file),)), {})
            digests |= kept.outcome.digests
        run.write_config(CONFIG | {"digests": digests} | (changes or {}))
        return run.path

    return made


def test_seeds_of_two_machines_are_one_run(folder, tmp_path):
    one = folder("one", [row("energy/total", 1.0), row("cost/frame", 2.0, "ms")], cells=("a", "b"))
    two = folder(
        "two", [row("energy/total", 3.0, seed=1, hardware="B"),
                row("cost/frame", 5.0, "ms", seed=1, hardware="B")],
        cells=("b", "c"),
        changes={"seeds": [1], "suites": ["speed"], "test_looks": [{"rows": "1"}, {"rows": "2"}],
                 "finished": "2026-01-02T11:00:00+00:00", "methods": {"pbns": {"label": "PBNS"}},
                 "tasks": {"training": {"snug seed 1 (tshirt)": {"seconds": 4.0}}}},
    )  # fmt: skip
    out = RunFolder(tmp_path / "both")
    written = merge([one, two], out.path)
    config, rows = out.read_config(), out.read_rows()
    assert len(rows) == len(written) == 4
    assert config["seeds"] == [0, 1] and config["suites"] == ["garments", "speed"]
    assert list(config["methods"]) == ["snug", "pbns"] and "started" not in config
    assert config["finished"].startswith("2026-01-02") and len(config["test_looks"]) == 2
    assert list(config["tasks"]["training"]) == ["snug seed 0 (tshirt)", "snug seed 1 (tshirt)"]
    assert [run["hardware"] for run in config["merged"]] == [{"processor": "A"}] * 2
    assert [(r.seed, r.metric, r.value) for r in rows if r.passed and r.value] == [
        (0, "energy/total", 1.0), (0, "cost/frame", 2.0), (1, "energy/total", 3.0),
    ]  # fmt: skip
    assert rows[3].status == "skipped" and rows[3].reason == "5 ms on B; other times are of A"
    files = {path.name: path.read_text() for path in out.trajectories.iterdir()}
    assert files == {"a.npy": "a of one", "b.npy": "b of one", "c.npy": "c of two"}
    assert not out.changed(config) and not out.cache.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["both", "one", "two"]


def test_energies_of_frames_are_those_of_all_runs(folder, tmp_path):
    runs = [folder("one", [row("energy/total", 1.0)]), folder("two", [row("energy/total", 2.0, seed=1)])]
    for seed, (run, terms, values) in enumerate(zip(runs, ("strain", "strain,bending"), ("1", "2,3"))):
        path = RunFolder(run).frame_energies_path
        path.write_text(f"scene,method,seed,seconds,{terms}\ntshirt/kick,snug,{seed},0.1,{values}\n")
        config = RunFolder(run).read_config()
        config["digests"][path.name] = digest_of_file(path)
        RunFolder(run).write_config(config)
    merge(runs, tmp_path / "both")
    both = RunFolder(tmp_path / "both")
    assert both.frame_energies_path.read_text().splitlines() == [
        "scene,method,seed,seconds,strain,bending", "tshirt/kick,snug,0,0.1,1,", "tshirt/kick,snug,1,0.1,2,3",
    ]  # fmt: skip
    assert not both.changed(both.read_config())
    assert both.read_config()["digests"][both.frame_energies_path.name]


def test_nobody_goes_on_in_a_merged_folder_or_merges_it_again(folder, tmp_path, capsys):
    from benchmarks import run

    one, two = folder("one", [row("energy/total", 1.0)]), folder("two", [row("energy/total", 1.0)])
    out = tmp_path / "both"
    merge([one, two], out)
    assert run.main(["--dry-run", "-o", str(out)]) == 2
    assert "is merged of several runs" in capsys.readouterr().err
    with pytest.raises(MergeError, match="is merged already"):
        merge([one, out], tmp_path / "more")


@pytest.mark.parametrize(
    ("changes", "inputs", "message"),
    [
        ({"preset": "quick"}, {}, "another preset in"),
        ({"preset_values": {"frames": 21}}, {}, "another preset values in"),
        ({"body": ["mine.npz", "1"]}, {}, "another body in"),
        ({"garment": ["cape.obj", {}]}, {}, "another garment in"),
        ({"motions": {"train tshirt": ["run"]}}, {}, "another train tshirt among motions of"),
        ({"motions": {"frames": {"walk": 21}}}, {}, "another walk among frames among motions of"),
        ({"scenes": {"tshirt/kick": {"role": "validation"}}}, {}, "another role among tshirt/kick among"),
        ({}, {"scene": "punch"}, "cell kick: another scene in"),
        ({}, {"speed": 1}, None),
    ],
)
def test_runs_of_other_inputs_are_refused_by_name(folder, tmp_path, changes, inputs, message):
    one = folder("one", [row("energy/total", 1.0)])
    two = folder("two", [row("energy/total", 1.0)], changes=changes, **inputs)
    if message is None:
        merge([one, two], tmp_path / "both")
        return
    with pytest.raises(MergeError, match=message) as refused:
        merge([one, two], tmp_path / "both")
    assert "\n" not in str(refused.value) and str(two) in str(refused.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one", "two"]


def test_two_networks_of_one_name_are_refused(folder, tmp_path):
    """Processors of two kinds train two networks of one seed, and no row need tell."""
    folders = [folder(name, [row("energy/total", 1.0)]) for name in ("one", "two")]

    def trained(path: Path, weight: float, seconds: float) -> None:
        file = path / "models/snug.safetensors"
        file.parent.mkdir(exist_ok=True)
        write_tensors(file, {"weight": torch.full((2,), weight)}, {"seconds": seconds})
        network = Train(name="snug", label="snug seed 0", inputs={}, code=())
        kept = Cache(RunFolder(path)).keep(network, Outcome(files=("models/snug.safetensors",)), {})
        config = RunFolder(path).read_config()
        RunFolder(path).write_config(config | {"digests": config["digests"] | kept.outcome.digests})

    trained(folders[0], 1.0, seconds=5.0)
    trained(folders[1], 1.5, seconds=5.0)
    with pytest.raises(MergeError, match="network snug seed 0: other weights in"):
        merge(folders, tmp_path / "both")
    trained(folders[1], 1.0, seconds=6.0)
    merge(folders, tmp_path / "both")


def test_runs_of_other_code_are_refused_by_the_name_of_the_folder(folder, tmp_path, monkeypatch):
    one = folder("one", [row("energy/total", 1.0)])
    monkeypatch.setattr("benchmarks.runner.cache.software", lambda *_: {"benchmarks/results": "other"})
    two = folder("two", [row("energy/total", 1.0, seed=1)], cells=("other",))
    other = r"cell other: another benchmarks/results in .*run both by the same code"
    with pytest.raises(MergeError, match=other):
        merge([one, two], tmp_path / "both")


@pytest.mark.parametrize("what", ["file", "entry", "no cache", "twice", "no run", "taken", "outside"])
def test_what_cannot_be_merged_is_named(folder, tmp_path, what):
    import shutil

    one, two = folder("one", [row("energy/total", 1.0)]), folder("two", [row("energy/total", 1.0)])
    names, message = [one, two], {"file": "kick.npy: is not as the run wrote it", "entry": "damaged",
        "no cache": "has no cache", "twice": "two or more different", "no run": "no such file",
        "taken": "name a new folder", "outside": "which lies outside of the folder"}[what]  # fmt: skip
    if what == "file":
        (two / "trajectories" / "kick.npy").write_text("else")
    elif what == "entry":
        path = next((two / "cache").rglob("*.json"))
        path.write_text(path.read_text().replace("ok", "no"))
    elif what == "no cache":
        shutil.rmtree(two / "cache")
    elif what == "outside":
        (tmp_path / "letter").write_text("dear")
        config = RunFolder(two).read_config()
        config["digests"]["../letter"] = digest_of_file(tmp_path / "letter")
        RunFolder(two).write_config(config)
    elif what == "taken":
        (tmp_path / "both").mkdir()
        (tmp_path / "both" / "letter").write_text("dear")
    names = [one, one] if what == "twice" else [one, tmp_path / "none"] if what == "no run" else names
    with pytest.raises(ValueError, match=message):
        merge(names, tmp_path / "both")


def test_numbers_that_differ_are_refused_by_their_cell():
    one, two = row("energy/total", 1.0), row("energy/total", 1.0 + 1e-15)
    with pytest.raises(MergeError, match=r"tshirt/kick x snug seed 0 / energy/total: value 1.0 in a, 1.0000"):
        joined_rows({"a": [one], "b": [two]}, TIMED)
    with pytest.raises(MergeError, match="status ok in a, failed in b"):
        failed = row("cost/frame", None, "ms", status="failed", reason="died")
        joined_rows({"a": [row("cost/frame", 2.0, "ms", hardware="B")], "b": [failed]}, TIMED)
    with pytest.raises(MergeError, match=r"cost/memory: value 2.0 in a, 3.0 in b"):
        joined_rows({"a": [row("cost/memory", 2.0, "MB")], "b": [row("cost/memory", 3.0, "MB")]}, TIMED)


def test_what_one_run_knows_more_of_is_kept():
    known = row("energy/total", 1.0, uncertainty=0.1, hardware="B", commit="2")
    assert joined_rows({"a": [row("energy/total", 1.0)], "b": [known]}, TIMED) == [known]
    assert joined_rows({"a": [known], "b": [row("energy/total", 1.0)]}, TIMED) == [known]
    skipped = row("energy/total", None, status="skipped", reason="a package is missing")
    assert (
        joined_rows({"a": [skipped], "b": [known]}, TIMED)
        == joined_rows({"a": [known], "b": [skipped]}, TIMED)
        == [known]
    )


def test_times_are_of_the_first_machine_that_measured_them():
    a, b = row("cost/frame", 2.0, "ms"), row("cost/frame", 3.0, "ms", hardware="B")
    assert joined_rows({"a": [a], "b": [b]}, TIMED) == [a] and joined_rows({"b": [b], "a": [a]}, TIMED) == [b]
    spread = row("cost/spread", 7.0, "%", hardware="B")
    skipped = dataclasses.replace(spread, hardware="A", value=None, status="skipped", reason="not asked for")
    # Not B's beside A's times.
    assert joined_rows({"a": [a, skipped], "b": [b, spread]}, TIMED) == [a, skipped]
    trained = row("cost/train", 9.0, "s", hardware="B with an accelerator")
    assert joined_rows({"a": [a], "b": [b, trained]}, TIMED) == [a, trained]
    power = [row("mine/power", value, "W", hardware=where) for value, where in ((5.0, "A"), (6.0, "B"))]
    assert joined_rows({"a": power[:1], "b": power[1:]}, TIMED | {"mine/power"}) == power[:1]
    twin = row("cost/frame", 4.0, "ms", method="pbns")  # the same machine again: its times stand beside
    assert joined_rows({"a": [a], "c": [twin]}, TIMED) == [a, twin]
    clip = dataclasses.replace(b, suite="speed")  # a suite that one machine alone has timed
    assert joined_rows({"a": [a], "b": [clip]}, TIMED) == [a, clip]


def test_times_of_engines_are_of_a_machine_though_their_cases_declare_no_metric():
    timed = of_machines({"metrics": {}})
    a, b = row("engine/time", 3.1, "ms"), row("engine/time", 3.12, "ms", hardware="B")
    assert joined_rows({"a": [a], "b": [b]}, timed) == [a]
    with pytest.raises(MergeError, match="engine/distance"):
        joined_rows({"a": [row("engine/distance", 1.0, "%")], "b": [row("engine/distance", 2.0, "%")]}, timed)


def test_a_declared_time_is_of_no_machine():
    declared = row("cost/frame", 2.2, "ms", method="mine", reason=DECLARED)
    measured = row("cost/frame", 3.0, "ms", hardware="B")
    assert joined_rows({"a": [declared], "b": [measured]}, TIMED) == [declared, measured]
    assert joined_rows({"b": [measured], "a": [declared]}, TIMED) == [measured, declared]
