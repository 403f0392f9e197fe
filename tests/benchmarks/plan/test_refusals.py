"""Refusals of fields, options and a user's files: one line, status 2, and nothing is left behind."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import __main__, run
from benchmarks.runner.execute_plan import check_methods
from tests.benchmarks.plan.outside_files import METHOD, METRIC_FILE, SCENE_FILE, as_before
from tests.benchmarks.plan.planned import planned

_as_before = pytest.fixture(autouse=True)(as_before)

FIELDS = [  # study.toml -> line, field, and what is near it
    ("seeds = [", "not readable as TOML"),
    ("sedes = [0]", "study.toml: line 1: sedes: no field is called 'sedes'; did you mean seeds"),
    ("seeds = [-1]", "seeds: '-1': give at least one whole number"),
    ("seeds = [1, 1]", "seeds: (1, 1): give each once"),
    ("split = 'tset'", "split: 'tset': choose from test, validation"),
    ("sizes = 'huge'", "sizes: unknown preset 'huge'; choose from smoke, small, quick, paper"),
    ("[sizes]\nbase = 'smoke'\nframe = 3", "study.toml: line 3: sizes.frame: no field is called 'frame'"),
    ("[parts.garmnts]", "line 1: parts.garmnts: no part is called so; choose from garments, "),
    ("[parts.speed]\nscenes = ['flagg']", "line 2: parts.speed.scenes: unknown scene 'flagg'"),
    ("garment = { units = 'cm' }", "study.toml: line 1: garment: path is absent: give it"),
    ("like = 'folder/../study.toml'", "study.toml: is like itself"),
    ("garment = { path = 'tshirt.obj' }", "the project has scenes of that name: give the file another"),
]
WORDS = [
    ("dfault", "no study 'dfault': name one, or a file or folder with study.toml; did you mean default"),
    ("full:shapes", "no such scene meets such a method in part shapes"),
    ("latin.toml:garments", "latin.toml: not readable as TOML"),
    ("--set sizes.frames=2", "sizes.frames: 2: give 3 or more"),
    ("--set sizes.test_motions=-1", "sizes.test_motions: -1: give 1 or more"),
    ("--set=sizes.steps.snug=0", "sizes.steps.snug: 0: give 1 or more"),
    ("--set sizes.steps.snugg=1", "sizes.steps.snugg: no training is called so; did you mean snug"),
    ("--set sizes.warm_up_frames=-1", "sizes.warm_up_frames: -1: give 0 or more"),
    ("--set sizes.least_seconds=nan", "sizes.least_seconds: nan: give a number above 0"),
    ("--rollout a=b.npz --rollout a=c.npz", "--rollout: a, a: give each its own name"),
    ("--motions back.npz,up=z --motions walk.npz", "words behind a path hold for all files"),
    ("--scenes tshirt/walk", "see test_motions"),
    ("--methods sung", "did you mean snug"),
    ("--motions broken.npz", "broken.npz"),
    ("--motions short.npz", "2 frames; at least 3 are needed"),
    ("--motions walk.npz", "the name 'walk' is taken; rename the file"),
    ("--motions back.npz,up=x", "up=x: choose from y, z"),
    ("--out full", "holds no run"),
    ("--out torn", "torn/run.json: not readable"),
    ("--trained none", "no such folder"),
    ("--methods gone.py", "gone.py: no such file"),
    ("--set metrics=twice.py", "metric 'energy/total' is declared twice, by the project itself and by "),
    ("--set metrics=bare.py", "metric 'mine/x' has no unit"),
    ("--scenes worn.py", "no garment is called 'toga'; there are tshirt, "),
    ("--methods random.py", "Python knows random as"),
]
HEAD = "from benchmarks.method import MethodEntry\n"
PLAIN, MAKE = 'name="a", description="b"', "def make(**options): pass\n"


def entry(fields: str, after: str = MAKE) -> str:
    return f"{HEAD}METHODS = (MethodEntry({fields}),)\n{after}"


METHOD_FILES = [
    ("x = 1\ny = )\n", "bad.py: line 2: unmatched ')'"),
    ("METHODS = ()\n", "bad.py: declares no METHODS"),
    ("def f():\n    return 1 / 0\nf()\n", "bad.py: line 2: ZeroDivisionError: division by zero"),
    (entry('name="a", lable="b"'), "bad.py: line 2: TypeError"),
    (entry(PLAIN, ""), "bad.py: has no function make"),
    (entry(PLAIN + ', files=("gone.pt",)'), "gone.pt: no such file"),
    (entry(PLAIN + ', options={"at": open}'), "method 'a': cannot tell"),
    (entry(PLAIN + ', trained="zz"'), "no training is called 'zz'"),
    (entry(PLAIN + ', role="solvr"'), "unknown role 'solvr'; use one of reference, "),
    (entry('name="a b", description="c"'), "method 'a b': name it by at most 150 letters"),
    (entry('name="snug", description="c"'), "method 'snug' is declared twice, by the project itself and by "),
    (METHOD.replace("self.scene, _ =", "raise ValueError('other mesh') #"),
     "free_fall x still: cannot be prepared: ValueError: other mesh"),
    ("from benchmarks.methods.outside import program\nMETHODS = (program('p', 'gone {scene} {out}'),)",
     "free_fall x p: cannot be prepared: RuntimeError: the program cannot be started: no gone is here"),
    (HEAD + "METHODS = tuple(MethodEntry(name=n, description='b') for n in ('a/b', 'a-b'))\n" + MAKE,
     "free_fall x a-b and free_fall x a/b would have the same files: rename one"),
]  # fmt: skip
SCENE_FIELDS = [
    ('metrics=("energies",)', "scene 'lift': metrics=('energies',): choose from "),
    ('start_of="lift"', "scene 'lift': start_of='lift': nothing that serves"),
    ('garment="tshirt"', "scene 'lift': motion='': nothing that serves is called so"),
    ('garment="tshirt", motion="wlak"', "motion='wlak': nothing that serves is called so; did you mean"),
]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with files of a user, and folders that are no runs; no run may begin in it."""
    twice = METRIC_FILE.replace("height/highest", "energy/total")
    worn = SCENE_FILE.replace('"lift", d', '"worn", garment="toga", motion="kick", d')
    texts = {
        "full/note.txt": "a", "torn/run.json": '{"command": ', "random.py": "METHODS = ()\n",
        "broken.npz": "PK no zip", "folder/a.txt": "", "twice.py": twice, "worn.py": worn,
        "bare.py": twice.replace("energy/total", "mine/x").replace('unit="m"', 'unit=""'),
        "latin.toml": "question = '\xff'",
    }  # fmt: skip
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, "latin-1")
    for name, frames in (("back", 3), ("walk", 3), ("short", 2)):
        still = {"poses": np.zeros((frames, 72)), "trans": np.zeros((frames, 3)), "fps": 30}
        np.savez(tmp_path / f"{name}.npz", **still)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("snug.training.device.find_device", lambda name: None)
    begun = "benchmarks.runner.execute_plan.execute"
    monkeypatch.setattr(begun, lambda *_, **__: pytest.fail("the run was begun"))
    return tmp_path


@pytest.mark.parametrize(("text", "message"), FIELDS)
def test_a_wrong_field_is_refused_with_its_place(text, message, folder, refused):
    (folder / "study.toml").write_text(text)
    refused(message, run.main, ["study.toml", "-o", "out"])


@pytest.mark.parametrize(("words", "message"), WORDS)
def test_a_wrong_word_is_refused_by_its_option(words, message, folder, refused):
    refused(message, run.main, words.split())


@pytest.mark.parametrize(("text", "message"), METHOD_FILES)
def test_a_file_that_cannot_be_meant_is_one_line(text, message, folder, refused):
    (folder / "bad.py").write_text(text)
    refused(message, run.main, ["--scenes", "free_fall", "--methods", "bad.py", "-o", "out"])


@pytest.mark.parametrize(("fields", "message"), SCENE_FIELDS)
def test_what_a_scene_names_and_nobody_knows_is_one_line(fields, message, folder, refused):
    (folder / "named.py").write_text(SCENE_FILE.replace('sizes=("sheet_frames",)', fields))
    refused(message, run.main, ["--scenes", "named.py", "-o", "out"])


def test_a_scene_that_raises_is_left_to_its_own_task(folder):
    (folder / "named.py").write_text(SCENE_FILE.replace("Cloth(", "gone("))
    (folder / "mine.py").write_text(METHOD)
    assert check_methods(planned("--scenes", "named.py", "--methods", "mine.py")) is None


def test_an_unknown_command_is_named(refused):
    refused("benchmarks: no command 'scor': choose from score", __main__.main, ["scor"])
