"""Entries: what is wrong is named, scores are the same bytes twice, and a changed entry is refused."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks import submit
from benchmarks.presets import find_preset
from benchmarks.provenance import commit, digest
from benchmarks.results.protocol import NUMBER
from benchmarks.results.run_folder import RunFolder
from benchmarks.scenes import find_scene
from benchmarks.submit import main
from snug.motion.library import TEST
from tests.benchmarks.plan.outside_files import METHOD
from tests.benchmarks.runner.tasks_by_hand import run_in_this_process

SUBMISSIONS = Path(__file__).resolve().parents[2] / "submissions"
FOLDERS = sorted(path.parent for path in SUBMISSIONS.glob("*/entry.toml"))
SCENE = "hanging_sheet"
TEXT = f"""title = "Waving"
authors = "nobody"
description = "a sheet that waves"
url = "here"
training_data = "none"
hardware = "a processor"
protocol = "{NUMBER}"
milliseconds = 2.5
seeds = [0]
roll_outs = "{{scene}}.npz"
"""


@pytest.fixture(scope="module", autouse=True)
def small():
    """One small scene stands for the eight, and every task is run in this process."""
    with pytest.MonkeyPatch.context() as patch:
        run_in_this_process(patch)
        patch.setattr(submit, "PRESET", find_preset("smoke"))
        patch.setattr(submit, "SCENES", (SCENE,))
        yield


def write_entry(folder: Path) -> Path:
    folder.mkdir()
    (folder / "entry.toml").write_text(TEXT)
    scene = find_scene(SCENE).at(find_preset("smoke")).build()
    wave = np.sin(9.0 * scene.start[:, [2, 0, 1]])
    positions = np.stack([scene.start + 1e-3 * frame * wave for frame in range(scene.frames)])
    np.savez(folder / f"{SCENE}.npz", positions=positions.astype(np.float32))
    return folder


@pytest.fixture
def entry(tmp_path):
    return write_entry(tmp_path / "waving")


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    folder = write_entry(tmp_path_factory.mktemp("scored") / "waving")
    assert main(["score", str(folder)]) == 0
    return folder


def test_scores_are_those_of_a_run_without_clock_and_machine_and_the_same_bytes_twice(scored, entry):
    rows = RunFolder(scored / "scores").read_rows()
    mine = {row.metric: row for row in rows if row.method == "waving"}
    assert mine["energy/strain"].value > 0 and mine["gap/energy"].value > 0
    assert mine["cost/frame"].value == 2.5 and "declared" in mine["cost/frame"].reason
    assert {(row.protocol, row.commit, row.hardware) for row in rows} == {(NUMBER, "", "")}
    assert {row.method for row in rows if row.value is not None} == {"simulation", "waving"}
    for _ in range(2):
        assert main(["score", str(entry)]) == 0
        for name in ("results.csv", "run.json"):
            assert (entry / "scores" / name).read_bytes() == (scored / "scores" / name).read_bytes()


def test_a_roll_out_has_a_hash_and_one_that_copies_frames_is_refused(scored, tmp_path, refused):
    config = RunFolder(scored / "scores").read_config()
    positions = np.load(scored / f"{SCENE}.npz")["positions"]
    assert config["roll_outs"] == {f"{SCENE}-seed0": digest(positions.astype(float))}
    assert config["commit"] == commit() and len(config["date"]) == 10
    assert (scored / "scores" / submit.PICTURE).stat().st_size > 500
    shutil.copytree(scored, tmp_path / "waving")
    for name, way, frames in (
        ("again", "in order", positions),
        ("back", "in reverse", positions[::-1]),
        ("frozen", "one of them held", np.repeat(positions[3:4], len(positions), axis=0)),
    ):
        np.savez(write_entry(tmp_path / name) / f"{SCENE}.npz", positions=frames)
        refused(
            f"its frames are those of waving {SCENE}-seed0, {way}", main, ["check", str(tmp_path / name)]
        )
        shutil.rmtree(tmp_path / name)
    write_entry(tmp_path / "own")
    np.savez(
        tmp_path / "own" / f"{SCENE}.npz", positions=positions + [0.0, 0.02, 0.0] * positions[:, ::-1]
    )
    assert main(["check", str(tmp_path / "own")]) == 0


@pytest.mark.parametrize("name", [f"{SCENE}.npz", "scores/results.csv", ".weights"])
def test_a_file_that_is_not_as_it_was_scored_is_refused(scored, tmp_path, name, refused):
    copy = Path(shutil.copytree(scored, tmp_path / "waving"))
    with (copy / name).open("ab") as file:
        file.write(b"\n")
    refused(f"not as it was scored: {name}: put it right", main, ["check", str(copy)])


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (f'"{NUMBER}"', '"0.9"', f"entry.toml: line 7: protocol: '0.9': this is protocol {NUMBER}"),
        ('title = "Waving"\n', "", "title is absent: give it"),
        ("milliseconds = 2.5", "milliseconds = nan", "milliseconds: nan: give a number above 0"),
        ("{scene}.npz", "../{scene}.npz", "lies outside of the entry's folder"),
        ("seeds = [0]", f"seeds = [0]\nscenes = ['{SCENE}', '{SCENE}']", "give each once"),
        ("seeds = [0]", "seeds = [0, 1]", "seeds: (0, 1): give one where roll-outs are files"),
        ("seeds = [0]", f"seeds = [{'9' * 309}]", "a whole number beyond 64 bits"),
        ("seeds = [0]", "#" * (1 << 20), "at most 1048576 are read"),
        ("seeds = [0]", 'seeds = [0]\nscenes = ["tshirt/walk"]', "('tshirt/walk',): choose from"),
    ],
)
def test_a_fault_is_one_line_with_file_and_remedy(entry, refused, old, new, fault):
    (entry / "entry.toml").write_text(TEXT.replace(old, new))
    refused(fault, main, ["check", str(entry)])


@pytest.mark.parametrize(
    ("name", "make", "fault"),
    [
        (f"{SCENE}.npz", lambda path: path.symlink_to("/etc/hosts"), "is a link out of the entry's"),
        ("part", lambda path: path.symlink_to("/etc"), "is a link out of the entry's folder"),
        (f"{SCENE}.npz", os.mkfifo, "is no regular file"),
        ("entry.toml", os.mkfifo, "is no regular file"),
    ],
)
def test_links_out_of_the_folder_and_pipes_are_refused(entry, refused, name, make, fault):
    (entry / name).unlink(missing_ok=True)
    make(entry / name)
    assert name in refused(fault, main, ["check", str(entry)])


@pytest.mark.parametrize(
    ("name", "spoilt", "fault"),
    [
        ("theirs", "pass", "declares method 'theirs': one of the folder's name, 'waving', is expected"),
        # Its mean over the frames, or scenes, that are left would be of the easier ones.
        ("waving", "x[5:] = np.nan", f"{SCENE}: seed 0: diverged"),
    ],
)
def test_a_program_of_another_name_or_that_fails_within_a_scene_is_not_scored(
    entry, capsys, name, spoilt, fault
):
    file = f"{name}_program.py"  # which Python has not met
    text = METHOD.replace('"still"', f'"{name}"').replace("pass", spoilt)
    (entry / "entry.toml").write_text(TEXT.replace("roll_outs", "program").replace("{scene}.npz", file))
    (entry / file).write_text(text)
    assert main(["score", str(entry)]) == 2
    assert fault in capsys.readouterr().err and not (entry / "scores").exists()


@pytest.fixture
def full_size(monkeypatch):
    monkeypatch.setattr(submit, "PRESET", find_preset("quick"))
    monkeypatch.setattr(submit, "SCENES", tuple(f"tshirt/{motion}" for motion in TEST[:8]))


@pytest.mark.parametrize("path", FOLDERS, ids=lambda path: path.name)
def test_every_entry_here_is_as_it_was_scored(full_size, path):
    assert RunFolder(path / "scores").config_path.is_file()
    if f'protocol = "{NUMBER}"' not in (path / "entry.toml").read_text():
        pytest.skip("scored by an earlier protocol: made again with the published runs")
    assert main(["check", str(path)]) == 0


@pytest.mark.slow  # minutes: each entry's scenes are simulated
@pytest.mark.parametrize("path", FOLDERS, ids=lambda path: path.name)
def test_every_entry_here_is_scored_again(full_size, path, tmp_path):
    """The simulation is chaotic: on another processor it parts from the recorded one, and so do distances."""
    again = Path(shutil.copytree(path, tmp_path / path.name))
    assert main(["score", str(again)]) == 0
    energies = [
        {
            (row.method, row.scene, row.seed, row.metric): row.value
            for row in RunFolder(folder / "scores").read_rows()
            if row.metric == "energy/total" or (row.metric[:7], row.method) == ("energy/", path.name)
        }
        for folder in (path, again)
    ]
    assert energies[1] == pytest.approx(energies[0], rel=1e-3, abs=1e-9)
