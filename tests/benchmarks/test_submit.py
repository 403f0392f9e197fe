"""Entries: what is wrong is named, scores are the same bytes twice, and a changed entry is refused."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.presets import find_preset
from benchmarks.results.protocol import NUMBER
from benchmarks.results.run_folder import RunFolder
from benchmarks.scenes import find_scene
from benchmarks.submit import entry as entries
from benchmarks.submit.__main__ import main
from benchmarks.submit.entry import read_entry
from benchmarks.submit.scores import KEPT, write
from snug.motion.library import TEST
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
        patch.setattr(entries, "PRESET", find_preset("smoke"))
        patch.setattr(entries, "SCENES", (SCENE,))
        yield


def write_roll_out(path: Path, *, lifted: float = 0.0) -> None:
    scene = find_scene(SCENE).at(find_preset("smoke")).build()
    wave = np.sin(9.0 * scene.start[:, [2, 0, 1]])
    positions = np.stack([scene.start + 1e-3 * frame * wave for frame in range(scene.frames)])
    positions[3, 7, 1] += lifted
    np.savez(path, positions=positions.astype(np.float32))


@pytest.fixture
def entry(tmp_path):
    folder = tmp_path / "waving"
    folder.mkdir()
    (folder / "entry.toml").write_text(TEXT)
    write_roll_out(folder / f"{SCENE}.npz")
    return folder


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scored") / "waving"
    folder.mkdir()
    (folder / "entry.toml").write_text(TEXT)
    write_roll_out(folder / f"{SCENE}.npz")
    assert main(["score", str(folder)]) == 0
    return folder


@pytest.fixture
def copy(scored, tmp_path):
    return Path(shutil.copytree(scored, tmp_path / "waving"))


def test_scoring_twice_gives_the_same_bytes(scored, entry, capsys):
    assert main(["score", str(entry)]) == 0
    for name in ("results.csv", "run.json"):
        assert (entry / "scores" / name).read_bytes() == (scored / "scores" / name).read_bytes()
    assert main(["score", str(entry)]) == 0
    assert "rows, as recorded" in capsys.readouterr().out


def test_on_another_processor_energies_are_compared(copy, monkeypatch, capsys):
    """The simulation is chaotic: there it parts from the recorded one, and so do distances from it."""

    def scaled(row, factor):
        return row if row.value is None else dataclasses.replace(row, value=factor * row.value)

    recorded = RunFolder(copy / "scores").read_rows()
    mine = [row.method == "waving" and row.metric.startswith("energy/") for row in recorded]
    rows = [
        row if own else scaled(row, 1.0005 if row.metric == "energy/total" else 1.02)
        for row, own in zip(recorded, mine)
    ]
    config = {name: value for name, value in RunFolder(copy / "scores").read_config().items() if name in KEPT}
    write(read_entry(copy)[0], rows, config)
    assert main(["score", str(copy)]) == 1
    monkeypatch.setattr("benchmarks.submit.scores.processor_name", lambda: "another")
    capsys.readouterr()
    assert main(["score", str(copy)]) == 0
    assert "rows, energies as recorded, on another processor" in capsys.readouterr().out
    for processor, method, metric in (
        ("a third", "waving", "energy/strain"), ("a fourth", "simulation", "energy/total"),
    ):  # fmt: skip
        wrong = [scaled(row, 1.01) if (row.method, row.metric) == (method, metric) else row for row in rows]
        write(read_entry(copy)[0], wrong, config)
        monkeypatch.setattr("benchmarks.submit.scores.processor_name", lambda name=processor: name)
        assert main(["score", str(copy)]) == 1
        assert f"{method} in {SCENE}, {metric}: " in capsys.readouterr().out


def test_scores_are_those_of_a_run_without_clock_and_machine(scored):
    rows = RunFolder(scored / "scores").read_rows()
    mine = {row.metric: row for row in rows if row.method == "waving"}
    assert mine["energy/strain"].value > 0 and mine["gap/energy"].value > 0
    assert mine["cost/frame"].value == 2.5 and "declared" in mine["cost/frame"].reason
    assert {row.protocol for row in rows} == {NUMBER} and {row.commit + row.hardware for row in rows} == {""}
    assert {row.method for row in rows if row.value is not None} == {"simulation", "waving"}


def test_one_vertex_moved_is_refused(copy, capsys):
    write_roll_out(copy / f"{SCENE}.npz", lifted=1e-6)
    for action in ("check", "score"):
        assert main([action, str(copy)]) == 1
        assert f"{SCENE}.npz: is not the file that was scored" in capsys.readouterr().out


def test_one_vertex_moved_and_its_digest_written_anew_is_refused(copy, capsys):
    write_roll_out(copy / f"{SCENE}.npz", lifted=1e-3)
    path = copy / "scores" / "run.json"
    config = json.loads(path.read_text())
    config["entry"] = read_entry(copy)[0].digests()
    path.write_text(json.dumps(config))
    assert main(["check", str(copy)]) == 0
    assert main(["score", str(copy)]) == 1
    assert f"waving in {SCENE}, energy/strain: " in capsys.readouterr().out
    assert main(["score", str(copy), "--replace"]) == 0


def test_scores_of_another_name_are_refused(copy, capsys):
    assert main(["check", str(copy.rename(copy.with_name("other")))]) == 1
    assert "no scores of 'other': give the folder its old name" in capsys.readouterr().out


@pytest.mark.parametrize("name", [".weights", "__weights__/net.pt", "notes.md", "scores/weights.npz"])
def test_a_file_that_was_not_there_when_it_was_scored_is_refused(copy, name, capsys):
    (copy / name).parent.mkdir(exist_ok=True)
    (copy / name).write_bytes(b"weights")
    assert main(["check", str(copy)]) == 1
    assert f"{name}: was not there when it was scored" in capsys.readouterr().out


def test_metadata_changed_after_scoring_are_refused(copy, capsys):
    (copy / "entry.toml").write_text(TEXT.replace("2.5", "0.1"))
    assert main(["check", str(copy)]) == 1
    assert "entry.toml: milliseconds is not what was scored" in capsys.readouterr().out


def test_scores_of_another_protocol_are_refused(copy, monkeypatch, capsys):
    monkeypatch.setattr(entries, "NUMBER", "1.1")
    (copy / "entry.toml").write_text(TEXT.replace(NUMBER, "1.1"))
    assert main(["score", str(copy)]) == 1
    assert f"scores of protocol {NUMBER}, this is 1.1" in capsys.readouterr().out


def test_scores_edited_by_hand_are_refused(copy, capsys):
    path = copy / "scores" / "results.csv"
    path.write_text(path.read_text().replace("energy/strain,J,", "energy/strain,J,1", 1))
    assert main(["check", str(copy)]) == 1
    assert "results.csv: is not as it was written" in capsys.readouterr().out


def test_scores_that_are_gone_are_named_beside_the_other_faults(copy, capsys):
    (copy / "scores" / "results.csv").unlink()
    write_roll_out(copy / f"{SCENE}.npz", lifted=1e-6)
    assert main(["check", str(copy)]) == 1
    output = capsys.readouterr().out
    assert "results.csv: no such file" in output and f"{SCENE}.npz: is not the file that was scored" in output


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (f'protocol = "{NUMBER}"', 'protocol = "0.9"', f"protocol = '0.9': this is protocol {NUMBER}"),
        ('title = "Waving"\n', "", "field 'title' is absent"),
        ('title = "Waving"', "title = 3", "title = 3: give a text"),
        ("milliseconds = 2.5", "milliseconds = -1", "milliseconds = -1: give a number above 0"),
        ("milliseconds = 2.5", "milliseconds = true", "milliseconds = True: give a number above 0"),
        ("milliseconds = 2.5", "milliseconds = nan", "milliseconds = nan: give a number above 0"),
        ("seeds = [0]", "seeds = [0, 1]", "roll-outs of one seed"),
        ("seeds = [0]", 'seeds = ["a"]', "give whole numbers"),
        ("seeds = [0]", "seeds = [0]\ncolour = 1", "unknown field 'colour'"),
        ("{scene}.npz", "a.npz", "has no {scene}"),
        ("{scene}.npz", "../{scene}.npz", "lies outside of the entry's folder"),
        ('roll_outs = "{scene}.npz"', "", "give either roll_outs"),
        ('roll_outs = "{scene}.npz"', 'program = "absent.py"', "absent.py: no such file"),
        ("seeds = [0]", 'seeds = [0]\nscenes = ["tshirt/walk"]', "scenes has 'tshirt/walk': choose from"),
    ],
)
def test_a_fault_is_one_line_with_file_and_remedy(entry, capsys, old, new, fault):
    (entry / "entry.toml").write_text(TEXT.replace(old, new))
    assert main(["check", str(entry)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 and fault in lines[0] and str(entry) in lines[0]


def test_a_roll_out_that_does_not_fit_is_named(entry, capsys):
    path = entry / f"{SCENE}.npz"
    positions = np.load(path)["positions"]
    positions[4, 2] = np.nan
    np.savez(path, positions=positions[:, :-1])
    assert main(["check", str(entry)]) == 1
    out = capsys.readouterr().out
    assert f"{path}: vertex 2 of frame 4 is not finite" in out and f"{path}: has 48 vertices" in out
    path.unlink()
    assert main(["score", str(entry)]) == 1
    assert f"{path}: no such file: add it" in capsys.readouterr().out


def hand_in_program(entry: Path, name: str, text: str) -> None:
    """Let a program take the place of the roll-outs. name: of its file, which Python has not met."""
    (entry / "entry.toml").write_text(TEXT.replace("roll_outs", "program").replace("{scene}.npz", name))
    (entry / name).write_text(text)


def test_a_program_of_another_name_is_refused(entry, capsys):
    hand_in_program(
        entry,
        "named_otherwise.py",
        "from benchmarks import MethodEntry\n"
        "METHODS = (MethodEntry(name='theirs', description='a method'),)\n"
        "def make(*, models, seed): ...\n",
    )
    assert main(["check", str(entry)]) == 1
    assert (
        "declares method 'theirs': one of the folder's name, 'waving', is expected" in capsys.readouterr().out
    )


def test_a_program_that_fails_within_a_scene_is_not_scored(entry, capsys):
    """Its mean over the frames, or scenes, that are left would be of the easier ones."""
    hand_in_program(
        entry,
        "waving_badly.py",
        "import numpy as np\n"
        "from benchmarks import Method, MethodEntry\n"
        "from reference_sim import Trajectory\n"
        "METHODS = (MethodEntry(name='waving', description='a method'),)\n"
        "class Waving(Method):\n"
        "    def run(self):\n"
        "        scene = self.scene\n"
        "        positions = np.stack([scene.start] * scene.frames)\n"
        "        positions[5:] = np.nan\n"
        "        return Trajectory(positions, scene.cloth.faces, np.arange(scene.frames) * scene.dt)\n"
        "    def prepare(self, scene):\n"
        "        self.scene = scene\n"
        "def make(*, models, seed):\n"
        "    return Waving()\n",
    )
    assert main(["score", str(entry)]) == 2
    assert f"{SCENE}, seed 0: diverged" in capsys.readouterr().err and not (entry / "scores").exists()


def test_what_is_no_entry_has_status_2(tmp_path, refused):
    refused("no such file", main, ["check", str(tmp_path)])
    (tmp_path / "entry.toml").write_text("title =")
    refused("not readable as TOML", main, ["check", str(tmp_path)])
    refused("judge", main, ["judge", str(tmp_path)])


@pytest.fixture
def full_size(monkeypatch):
    monkeypatch.setattr(entries, "PRESET", find_preset("quick"))
    monkeypatch.setattr(entries, "SCENES", tuple(f"tshirt/{motion}" for motion in TEST[:8]))


@pytest.mark.parametrize("path", FOLDERS, ids=lambda path: path.name)
def test_every_entry_here_is_as_it_was_scored(full_size, path):
    assert main(["check", str(path)]) == 0
    assert RunFolder(path / "scores").config_path.is_file()


@pytest.mark.slow  # minutes: each entry's scenes are simulated
@pytest.mark.parametrize("path", FOLDERS, ids=lambda path: path.name)
def test_every_entry_here_is_scored_again(full_size, path, capsys):
    assert main(["score", str(path)]) == 0
    assert "rows, " in (shown := capsys.readouterr().out) and "as recorded" in shown
