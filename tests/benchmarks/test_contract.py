"""The check of the contract: each breach is named with its remedy, and what keeps it passes."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from benchmarks import check
from benchmarks.check import ContractError, check_derivatives
from benchmarks.validation.equilibrium import DeadLoad
from tests.benchmarks.plan.outside_files import METHOD, METRIC_FILE, SCENE_FILE, as_before
from tests.benchmarks.runner.tasks_by_hand import InProcess, small_scene

_as_before = pytest.fixture(autouse=True)(as_before)

IN_SHEET = ("--scene", "hanging_sheet", "--set", "sizes=smoke")
FINER = "return Trajectory(np.zeros((10, 3, 3)), np.array([[0, 1, 2]]), np.arange(10) * scene.dt)"
BREACHES = {  # a line of run(): what is said of it
    "x = x[:, :-1]": "floats (10, 49, 3) are due",
    "x = x[:-1]": "gives 9 of 10 frames",
    "x[-1, 0] = np.nan": "has a position that is not finite in frame 9",
    "x[0] += 1e-3": "frame 0 is off the scene's start: put scene.start there",
    "x[3] += 1e-3": "a pin is off its place in frame 3",
    "x[2:, -1] += np.random.default_rng().random(3)": "a second run gives other positions",
    "x[2:, -1] += self.seed": "another seed gives other positions, by 1 m: say seeded=True",
    "x = self.__dict__.setdefault('x', x)": "each call of run() has to do all of the work",
    "m = scene.cloth.masses; m.flags.writeable = True; m[0] *= 2": "alters the scene: cloth.masses: copy",
    "raise RuntimeError('broken on\\npurpose')": "RuntimeError: broken on purpose (",
}
JUDGED = """
def series(roll_out):
    return {"height/all": roll_out.positions[..., 1]}

def judge(roll_out, values):
    return """
TWICE, ARRAY = "-2.0 * self.cloth.masses[:, None] *", METRIC_FILE.replace("float(", "")
FILES = {  # a file: what is wrong with it
    METHOD: "",
    METHOD.replace('"solver"', '"solver", other_mesh=True').replace("pass", FINER): "",
    **{METHOD.replace("pass", line): fault for line, fault in BREACHES.items()},
    SCENE_FILE: "",
    SCENE_FILE.replace(
        "-self.cloth.masses[:, None] *", TWICE
    ): "lift: its gradient is not the derivative",
    SCENE_FILE.replace("), 0.1", "), 33.3"): "dt 33.3: give the duration of a frame in seconds, above 0",
    SCENE_FILE.replace("dt=dt", "dt=dt, warm_up=1"): "warm_up 1: give 2 frames or more",
    SCENE_FILE.replace("(Lift(cloth),)", "2 * (Lift(cloth),)"): "energy 'lift' is declared twice",
    METRIC_FILE: "",
    "import numpy\n" + METRIC_FILE.replace("float(", "numpy.float32("): "",  # as a run takes it
    METRIC_FILE + JUDGED + "('diverged', 'lost')": "",
    METRIC_FILE + JUDGED + "'lost'": "ValueError: judge() gives 'lost': expected None, or a status",
    METRIC_FILE + JUDGED + "('skipped', 'x')": "judge() gives ('skipped', 'x'): expected None",
    METRIC_FILE + JUDGED + "('ok', '')": "judge() gives ('ok', ''): expected None",
    METRIC_FILE.replace("float(", "exec('raise MemoryError(7)') or ("): ": wrong\n  MemoryError: 7",
    METRIC_FILE.replace("float(", "float('nan') * ("): "height/highest is not finite: leave it out",
    ARRAY.replace(".max())", ".max(axis=1)"): "TypeError: height/highest is array(",
}


@pytest.fixture
def file(tmp_path, monkeypatch):
    """Return the path of a file of that text, which Python has not met; checks run here."""
    monkeypatch.setattr(check, "Executor", lambda run, assets, workers: InProcess(run, assets))

    def write(text):
        (path := tmp_path / f"file_{abs(hash(text))}.py").write_text(text)
        return str(path)

    return write


@pytest.mark.parametrize("number", range(len(FILES)))
def test_the_command_names_what_is_wrong_in_a_file_and_its_remedy(number, file, capsys):
    text, fault = list(FILES.items())[number]
    status = check.main([file(text), *(IN_SHEET if "METHODS" in text else ())])
    out = capsys.readouterr().out
    assert status == bool(fault) and fault in out and ";" not in out[out.index(fault) :]
    assert ("1 to mend" if fault else ": fine\nnothing is wrong") in out


def test_a_method_is_checked_in_three_scenes_and_one_that_is_bound_to_a_mesh_where_it_is(file, capsys):
    bound = "assert scene.cloth.vertex_count == 49, 'bound to 49 vertices'"
    assert check.main([file(METHOD.replace("self.scene, _ =", f"{bound}; self.scene, _ ="))]) == 1
    out = capsys.readouterr().out
    assert out.count("bound to 49 vertices") == 3 and "still in tshirt/kick: wrong" in out
    assert check.main([file(METHOD), "--set", "sizes=smoke"]) == 2


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
