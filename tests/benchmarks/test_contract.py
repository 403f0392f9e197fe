"""The check of the contract: each breach is named with its remedy, and what keeps it passes."""

from __future__ import annotations

import sys
from contextlib import nullcontext

import numpy as np
import pytest

from benchmarks import check
from benchmarks.contract import ContractError, check_derivatives
from benchmarks.method import Method, MethodEntry
from benchmarks.plan.cell import Cell
from benchmarks.results.run_folder import RunFolder
from benchmarks.runner.task import Context, failure
from benchmarks.validation.equilibrium import DeadLoad
from reference_sim import Trajectory
from tests.benchmarks.plan.outside_files import METRIC_FILE, SCENE, SCENE_FILE, TINY, as_before
from tests.benchmarks.runner.tasks_by_hand import InProcess, small_scene

MISBEHAVING = "tests.benchmarks.runner.misbehaving"

_as_before = pytest.fixture(autouse=True)(as_before)


class Still(Method):
    """Does no physics and keeps the contract; `breach` is a line that changes one thing."""

    seed, breach = 0, ""

    def prepare(self, scene):
        self.scene = scene

    def run(self):
        x = np.repeat(np.array(self.scene.start)[None], self.scene.frames, axis=0)
        names = {"x": x, "self": self, "np": np}
        exec(self.breach, names)
        times = np.arange(self.scene.frames) * self.scene.dt
        return Trajectory(names["x"], self.scene.cloth.faces, times, status="ok")


ALTERS = "m = self.scene.cloth.masses; m.flags.writeable = True; m[0] *= 2.0"
BREACHES = {
    "x = x[:, :-1]": "floats (6, 16, 3) are due",
    "x[-1, 0] = np.nan": "has a position that is not finite in frame 5",
    "x[0] += 1e-3": "frame 0 is off the scene's start: put scene.start there",
    "x[3] += 1e-3": "a pin is off its place in frame 3",
    "x[2:, -1] += np.random.default_rng().random(3)": "a second run gives other positions",
    "x[2:, -1] += self.seed": "another seed gives other positions, by 1 m: say seeded=True",
    "x = self.__dict__.setdefault('x', x)": "each call of run() has to do all of the work",
    ALTERS: "alters the scene: cloth.masses: copy what you change",
    "raise RuntimeError('broken on\\npurpose')": "RuntimeError: broken on purpose (",
}


def look(make, tmp_path, monkeypatch, scene="hanging_sheet", **fields) -> str:
    """Return why the checked run of a method of `make` has failed, empty where it has not."""
    module = type(sys)("breaches")
    module.make = make
    monkeypatch.setitem(sys.modules, "breaches", module)
    entry = MethodEntry(name="m", description="", module="breaches", declared_in=__file__, **fields)
    cell = Cell(SCENE[scene].at(TINY), entry, 0, ("speed",))
    context = Context(RunFolder(tmp_path))
    try:
        outcome = check.run_checked(cell, 0.02, context, {})
    except Exception as error:
        outcome = failure(error)
    return outcome.reason


@pytest.mark.parametrize("breach", BREACHES)
def test_the_check_names_each_breach_and_its_remedy(breach, tmp_path, monkeypatch):
    def make(*, models, seed):
        method = Still()
        method.seed, method.breach = seed, breach
        return method

    wrong = look(make, tmp_path, monkeypatch)
    assert BREACHES[breach] in wrong and ";" not in wrong.partition(BREACHES[breach])[2]


def test_the_check_finds_nothing_in_what_keeps_the_contract(tmp_path, monkeypatch):
    assert look(lambda *, models, seed: Still(), tmp_path, monkeypatch) == ""

    class Finer(Still):
        def run(self):
            positions = np.zeros((self.scene.frames, 4, 3))
            times = np.arange(self.scene.frames) * self.scene.dt
            return Trajectory(positions, np.array([[0, 1, 2], [0, 2, 3]]), times, status="ok")

    assert look(lambda *, models, seed: Finer(), tmp_path, monkeypatch, other_mesh=True) == ""
    assert "TypeError" in look(lambda *, models: Still(), tmp_path, monkeypatch)
    assert "AttributeError" in look(lambda *, models, seed: object(), tmp_path, monkeypatch)


METHOD_FILE = """import numpy as np
from benchmarks import Method, MethodEntry
from reference_sim import Trajectory

METHODS = (MethodEntry(name="still", description="a method", role="solver"),)

class Still(Method):
    def prepare(self, scene):
        self.scene = scene

    def run(self):
        positions = np.repeat(np.array(self.scene.start)[None], self.scene.frames, axis=0)
        return Trajectory(positions, self.scene.cloth.faces, np.arange(len(positions)) * self.scene.dt)

def make(*, models, seed):
    return Still()
"""
BOUND = """if scene.cloth.vertex_count != 49:
            raise ValueError(f"bound to 49 vertices, not {scene.cloth.vertex_count}")
        self.scene = scene"""
JUDGED = """
def series(roll_out):
    return {"height/all": roll_out.positions[..., 1]}

def judge(roll_out, values):
    return """
TWICE, ARRAY = "-2.0 * self.cloth.masses[:, None] *", METRIC_FILE.replace("float(", "")
FILES = {
    "lifted": SCENE_FILE,
    "highest": METRIC_FILE,
    "narrow": "import numpy\n" + METRIC_FILE.replace("float(", "numpy.float32("),  # as a run takes it
    "none": METRIC_FILE + JUDGED + "None",
    "lost": METRIC_FILE + JUDGED + "('diverged', 'lost')",
    "bound": METHOD_FILE.replace("self.scene = scene", BOUND),
    "askew": SCENE_FILE.replace("-self.cloth.masses[:, None] *", TWICE),
    "loose": ARRAY.replace(".max())", ".max(axis=1)"),
    "word": METRIC_FILE + JUDGED + "'lost'",
    "taken": METHOD_FILE.replace('"still"', '"snug"'),
    "empty": "",
}


@pytest.fixture
def checked(monkeypatch, tmp_path, capsys):
    """Return what the command prints of a file with that name in FILES, and its exit status."""
    monkeypatch.setattr(check, "Executor", lambda run, assets, workers: InProcess(run, assets))

    def run(name, *options):
        (path := tmp_path / f"{name}.py").write_text(FILES[name])
        status = check.main([str(path), *options])
        return capsys.readouterr().out, status

    return run


@pytest.mark.parametrize("name", ["highest", "narrow", "none", "lost"])
def test_the_command_finds_nothing_in_metrics_that_can_be_measured(name, checked):
    assert checked(name)[1] == 0


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("askew", "energy lift: its gradient is not the derivative of its value"),
        ("loose", "loose.py: TypeError: height/highest is array("),
        ("word", "word.py: ValueError: judge() gives 'lost': expected None, or a status"),
        ("bound", "bound to 49 vertices, not 25"),
    ],
)
def test_the_command_names_what_is_wrong_in_a_file(name, fault, checked):
    out, status = checked(name)
    assert status == 1 and fault in out and " to mend" in out


def test_the_command_checks_scenes_and_methods_in_the_scene_that_they_are_bound_to(checked):
    assert checked("lifted") == ("lift: fine\nnothing is wrong\n", 0)
    bound = checked("bound", "--scene", "hanging_sheet", "--set", "sizes=smoke")
    assert bound == ("still in hanging_sheet: fine\nnothing is wrong\n", 0)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("empty", (), "declares none of METHODS, SCENES, METRICS"),
        ("highest", ("--scene", "hanging_sheet"), "declares none of METHODS"),
        ("taken", (), "method 'snug' is declared twice"),
        ("bound", ("--scene", "hanging"), "unknown scene 'hanging'"),
    ],
)
def test_the_check_refuses_what_a_run_refuses(name, options, message, tmp_path, refused):
    (tmp_path / f"{name}.py").write_text(FILES[name])
    refused(message, check.main, [str(tmp_path / f"{name}.py"), *options])


@pytest.mark.parametrize(("factor", "fine"), [(1.0, True), (0.999, False)])
def test_a_wrong_gradient_is_found_however_many_vertices_do_not_feel_it(factor, fine):
    sheet = small_scene("hanging_sheet", cells=40)
    forces = np.zeros_like(sheet.start)
    forces[7, 1] = 0.01

    class Pulled(DeadLoad):
        def value_and_gradient(self, x):
            value, gradient = super().value_and_gradient(x)
            return value, factor * gradient

    wrong = pytest.raises(ContractError, match="gradient is not the derivative of its value")
    with nullcontext() if fine else wrong:
        check_derivatives(Pulled(sheet.cloth, forces), sheet)
