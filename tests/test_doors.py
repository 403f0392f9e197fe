"""Methods, scenes, metrics and energies from outside: by path, entry point, as a program; and their check."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from tasks_by_hand import InProcess
from test_source import forget

from benchmarks import check, metric, metrics, run
from benchmarks.contract.methods import CheckMethod
from benchmarks.method import Method, MethodEntry
from benchmarks.methods import METHODS
from benchmarks.methods.program import program
from benchmarks.registry import DeclarationError
from benchmarks.request import outside
from benchmarks.request.plan import Motions, Plan
from benchmarks.request.presets import find_preset
from benchmarks.results import RunFolder
from benchmarks.runner.schedule import Schedule
from benchmarks.runner.source import code_of
from benchmarks.scenes import SCENES, of_garment
from benchmarks.tasks.cell import Cell
from benchmarks.tasks.metrics import measured
from benchmarks.tasks.task import Context
from reference_sim import Trajectory
from snug.recipe import DEFAULT, RecipeError
from snug.recipes import Training

TINY = dataclasses.replace(find_preset("smoke"), sheet_cells=3, sheet_frames=6)
SCENE = {scene.name: scene for scene in SCENES}

METHOD = """
from dataclasses import dataclass
import numpy as np
from benchmarks.method import Method, MethodEntry
from reference_sim import Trajectory
from {helper} import place

METHODS = (MethodEntry(name="{name}", label="{label}", description="exact", role="solver", files=("a.txt",)),)

@dataclass
class Exact(Method):
    def prepare(self, scene):
        self.scene = scene

    def run(self):
        scene = self.scene
        positions = np.stack([place(scene, frame) for frame in range(scene.frames)])
        return Trajectory(positions, scene.cloth.faces, np.arange(scene.frames) * scene.dt)

def make(*, models, seed):
    return Exact()
"""
HELPER = "def place(scene, frame):\n    return scene.exact[frame] + {shift}\n"
SCENE_FILE = """
import numpy as np
from benchmarks.scene import BuiltScene, Scene
from reference_sim import Cloth
from reference_sim.energies import Energy

SCENES = (Scene(name="lift", description="a sheet in a constant upward force", sizes=("sheet_frames",)),)

class Lift(Energy):
    name = "lift"

    def __init__(self, cloth):
        self.cloth, self.stencils = cloth, np.arange(cloth.vertex_count)[:, None]

    def element_energy(self, u):
        import torch

        return -(torch.as_tensor(self.cloth.masses).to(u) * u[..., 0, 1])

    def value_and_gradient(self, x):  # and no torch is needed
        return float(-self.cloth.masses @ x[:, 1]), -self.cloth.masses[:, None] * np.array([0.0, 1, 0])

    def hessian_blocks(self, x):
        return np.zeros((len(x), 3, 3))

def build(scene, assets=None, *, sheet_frames):
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
    cloth, dt = Cloth(positions, np.array([[0, 2, 1], [0, 3, 2]])), 0.1
    steps = np.arange(sheet_frames)  # by backward Euler: 1 m/s^2 upwards
    exact = positions + np.array([0.0, 1, 0]) * (dt**2 * steps * (steps + 1) / 2)[:, None, None]
    return BuiltScene(name=scene.name, cloth=cloth, energies=(Lift(cloth),), dt=dt, frames=sheet_frames,
                      settle=lambda: positions, exact=exact)
"""
METRIC_FILE = """
from benchmarks.metric import Metric

METRICS = (
    Metric(name="height/highest", unit="m", title="Highest", definition="of all vertices", table="height"),
)

def measure(roll_out):
    return {"height/highest": float(roll_out.positions[..., 1].max())}
"""
PROGRAM = """
import json, sys
import numpy as np
facts, cloth = json.load(open(sys.argv[1] + "/scene.json")), np.load(sys.argv[1] + "/cloth.npz")
n = np.arange(facts["frames"])
up = np.array([0.0, 1, 0]) * (facts["dt"] ** 2 * n * (n + 1) / 2)[:, None, None]
np.savez(sys.argv[2], positions=cloth["start_positions"] + up, seconds_per_frame=0.002)
"""
PROGRAM_FILE = """
import sys
from pathlib import Path
from benchmarks.methods import METHODS
from benchmarks.methods.program import program

SCRIPT = Path(__file__).with_name("theirs_run.py")
METHODS = (program("theirs", f"{sys.executable} -I {SCRIPT} {{scene}} {{out}}", files=("theirs_run.py",)),)
"""


@pytest.fixture(autouse=True)
def _as_before():
    """What a test has loaded from outside is forgotten."""
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        file = getattr(sys.modules[name], "__file__", None) or ""
        if not file.startswith((str(Path(run.__file__).parent.parent), sys.prefix, sys.base_prefix)):
            del sys.modules[name]
    metrics.declared.cache_clear()
    forget()


def installed(folder: Path, module: str, group: str = "methods", name: str = "packed") -> None:
    """A package of one module, as a package manager leaves it."""
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[snug_benchmark.{group}]\n{name} = {module}\n")
    (info / "top_level.txt").write_text(f"{module}\n")


# --- a run -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """A user's folder, with a package installed beside."""
    folder = tmp_path_factory.mktemp("user")
    (folder / "a.txt").write_text("weights")
    (folder / "mine.py").write_text(METHOD.format(helper="mine_helper", name="mine", label="Mine"))
    (folder / "mine_helper.py").write_text(HELPER.format(shift=0.0))
    (folder / "lift.py").write_text(SCENE_FILE)
    (folder / "height.py").write_text(METRIC_FILE)
    (folder / "theirs.py").write_text(PROGRAM_FILE)
    (folder / "theirs_run.py").write_text(PROGRAM)
    site = folder / "site"
    installed(site, "packed_method")
    (site / "packed_method.py").write_text(
        METHOD.format(helper="packed_helper", name="packed-1", label="Packed")
    )
    (site / "packed_helper.py").write_text(HELPER.format(shift=0.001))
    (site / "a.txt").write_text("weights")
    return folder


WORDS = ["--preset", "smoke", "--suite", "speed", "--scenes", "lift.py", "--metrics", "height.py"]
WORDS += ["--methods", "simulation,./mine.py,packed,theirs.py", "-o", "out"]


def command(files: Path, *more: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(files)
        patch.syspath_prepend(files / "site")
        return run.main([*WORDS, *more])


@pytest.fixture(scope="module")
def done(files) -> RunFolder:
    assert command(files) == 0
    return RunFolder(files / "out")


def test_entries_by_path_by_entry_point_and_as_a_program_are_rows_like_others(done):
    rows = {(row.method, row.metric): row for row in done.read_rows()}
    assert {method for method, _ in rows} == {"simulation", "mine", "packed-1", "theirs"}
    assert {row.scene for row in rows.values()} == {"lift"}
    off = {
        method: rows[method, "exact/distance"].value
        for method in ("simulation", "mine", "packed-1", "theirs")
    }
    assert max(off["simulation"], off["mine"], off["theirs"]) < 1e-9
    assert off["packed-1"] == pytest.approx(0.001 * 3**0.5)
    assert all((method, "energy/lift") in rows and (method, "height/highest") in rows for method in off)
    assert rows["mine", "height/highest"].unit == "m" and rows["mine", "height/highest"].value > 0.4


def test_they_stand_in_tables_and_plots(done):
    table = (done.tables / "height_by_scene.csv").read_text()
    assert table.startswith("suite,scene,method,height/highest [m],")
    assert all(f"\nspeed,lift,{method}," in table for method in ("mine", "packed-1", "theirs"))
    config = done.read_config()
    assert config["metrics"]["height/highest"]["definition"] == "of all vertices"
    assert config["methods"]["mine"]["label"] == "Mine"
    figures = {path.name for path in done.figures.glob("*.svg")}
    assert "error_against_time_lift.svg" in figures


def test_a_program_is_not_timed_and_its_own_time_is_marked(done):
    costs = {
        row.metric: row
        for row in done.read_rows()
        if row.method == "theirs" and row.metric.startswith("cost")
    }
    assert set(costs) == {"cost/frame"} and costs["cost/frame"].value == pytest.approx(2.0)
    assert costs["cost/frame"].reason == "declared by its author, not measured"
    assert done.read_config()["methods"]["theirs"]["label"] == "theirs (declared time)"
    measured = [row for row in done.read_rows() if row.method == "mine" and row.metric == "cost/frame"]
    assert [row.reason for row in measured] == [""] and measured[0].value > 0.0


def test_what_is_unchanged_is_cached_and_what_is_edited_is_done_again(done, files, capsys):
    def stale() -> set[str]:
        forget()
        assert command(files, "--dry-run") == 0
        lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  cell")]
        return {line.split(":")[0].split()[-1] for line in lines if not line.endswith(": cached")}

    (files / "mine_helper.py").write_text(HELPER.format(shift=0.0) + "# a remark\n")
    assert stale() == set()
    (files / "mine_helper.py").write_text(HELPER.format(shift=0.5))
    (files / "theirs_run.py").write_text(PROGRAM + "# of what is run elsewhere every byte counts\n")
    assert stale() == {"mine", "theirs"}
    (files / "mine_helper.py").write_text(HELPER.format(shift=0.0))
    (files / "theirs_run.py").write_text(PROGRAM)
    (files / "a.txt").write_text("other weights")
    (files / "site" / "packed_helper.py").write_text(HELPER.format(shift=0.5))
    assert stale() == {"mine", "packed-1"}


def test_installed_packages_are_listed(files, monkeypatch, capsys):
    monkeypatch.syspath_prepend(files / "site")
    assert run.main(["--list"]) == 0
    assert "packed  package packed_method 1.0, module packed_method" in capsys.readouterr().out


# --- refusals ----------------------------------------------------------------------------------------------

HEAD = "from benchmarks.method import MethodEntry\n"
ENTRY = "METHODS = (MethodEntry({}),)\n"
MAKE = "def make(**options): pass\n"
PLAIN = 'name="a", description="b"'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1\ny = )\n", "bad.py: line 2: unmatched ')'"),
        ("x = 1\n", "bad.py: declares no METHODS, a tuple of MethodEntry"),
        ("METHODS = (1,)\n", "bad.py: declares no METHODS, a tuple of MethodEntry"),
        ("METHODS = ()\n", "bad.py: METHODS is empty"),
        ("def f():\n    return 1 / 0\nf()\n", "bad.py: line 2: ZeroDivisionError: division by zero"),
        ("import sys\nsys.exit(3)\n", "bad.py: line 2: SystemExit: 3"),
        ("import nothing_there\n", "bad.py: line 1: ModuleNotFoundError"),
        (HEAD + ENTRY.format('name="a", lable="b"'), "bad.py: line 2: TypeError"),
        (HEAD + ENTRY.format(PLAIN), "bad.py: has no function make"),
        (HEAD + ENTRY.format(PLAIN + ', module="no.where"'), "method 'a': no module no.where"),
        (HEAD + ENTRY.format(PLAIN + ', files=("gone.pt",)') + MAKE, "gone.pt: no such file"),
        (HEAD + ENTRY.format(PLAIN + ', trained="zz"') + MAKE, "no training is called 'zz'"),
        (HEAD + ENTRY.format('name="a b", description="c"') + MAKE, "method 'a b': use letters"),
        (HEAD + ENTRY.format('name="snug", description="c"') + MAKE,
         "method 'snug' is declared twice, by the project itself and by "),
        (HEAD + "from random_helper import f\n", "bad.py: line 2: ModuleNotFoundError"),
        ("\udcff", "bad.py: cannot be read"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_meant_is_one_line(text, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.py").write_text(text, errors="surrogateescape")
    assert run.main(["--scenes", "free_fall", "--methods", "bad.py", "-o", "out"]) == 2
    out, error = capsys.readouterr()
    assert out == "" and error.count("\n") == 1 and words in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "word", "words"),
    [
        ("--methods", "gone.py", "gone.py: no such file"),
        ("--metrics", "energy", "energy: no such file or entry point"),
        ("--metrics", "twice.py", "metric 'energy/total' is declared twice, by the project itself and by "),
        ("--metrics", "bare.py", "metric 'mine/x' has no unit"),
        ("--scenes", "taken.py", "a case of the project has this name"),
        ("--scenes", "worn.py", "no garment is called 'toga'; there are tshirt, "),
        ("--methods", "random.py", "Python knows random as"),
        (
            "--methods",
            "packed",
            "entry point packed of snug_benchmark.methods is declared by package one 1.0 and by package two ",
        ),
        (
            "--methods",
            "snug",
            "--methods snug: is a name of the project, and the entry point of other: rename that",
        ),
    ],
)
def test_a_word_that_cannot_be_meant_is_one_line(option, word, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = METRIC_FILE.replace("height/highest", "energy/total")
    (tmp_path / "twice.py").write_text(text)
    (tmp_path / "bare.py").write_text(text.replace("energy/total", "mine/x").replace('unit="m"', 'unit=""'))
    (tmp_path / "taken.py").write_text(SCENE_FILE.replace('"lift", d', '"membrane/uniaxial", d'))
    worn = SCENE_FILE.replace('"lift", d', '"worn", garment="toga", motion="kick", d')
    (tmp_path / "worn.py").write_text(worn)
    (tmp_path / "random.py").write_text("METHODS = ()\n")
    for module, name in (("one", "packed"), ("two", "packed"), ("other", "snug")):
        installed(tmp_path / "site", module, name=name)
    monkeypatch.syspath_prepend(tmp_path / "site")
    with monkeypatch.context() as patch:
        case = dataclasses.replace(run.MEASURED[0], name="membrane/uniaxial")
        patch.setattr("benchmarks.request.selection.MEASURED", (case,))
        assert run.main(["--scenes", "free_fall", option, word, "-o", "out"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and words in error


def test_two_files_of_one_name_are_refused(tmp_path):
    for folder, name in (("one", "a"), ("other", "b")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"method_{name}.py").write_text(
            METHOD.format(helper="shared", name=name, label=name)
        )
        (tmp_path / folder / "shared.py").write_text(HELPER.format(shift=0.0))
        (tmp_path / folder / "a.txt").write_text("")
    outside.entries_of(outside.METHODS, str(tmp_path / "one" / "method_a.py"))
    with pytest.raises(DeclarationError, match=r"other/shared\.py: Python knows shared as .*one/shared\.py"):
        outside.entries_of(outside.METHODS, str(tmp_path / "other" / "method_b.py"))


# --- source, energies and trainings ------------------------------------------------------------------------


def test_modules_beside_a_file_and_in_its_package_count_and_those_installed_do_not(tmp_path):
    package = tmp_path / "cloth_package"
    (package / "deep").mkdir(parents=True)
    more = "from cloth_package.deep.more import g\ndef f(): pass\n"
    for name, text in {
        "__init__.py": "", "deep/__init__.py": "", "unused.py": "", "helper.py": more,
        "deep/methods.py": "import numpy\nfrom ..helper import f\n", "deep/more.py": "def g(): pass\n",
    }.items():  # fmt: skip
        (package / name).write_text(text)
    code = code_of(str(package / "deep" / "methods.py"))
    assert {Path(path).relative_to(tmp_path).as_posix() for path in code} == {
        "cloth_package/deep/methods.py", "cloth_package/helper.py", "cloth_package/deep/more.py",
    }  # fmt: skip


def test_an_energy_of_a_file_can_be_trained_on_once_it_is_loaded(tmp_path):
    with pytest.raises(RecipeError, match=r"unknown energy 'levity'.*import the file of your own"):
        dataclasses.replace(DEFAULT, terms=("levity",))
    (tmp_path / "levity.py").write_text(SCENE_FILE + "class Levity(Lift):\n    name = 'levity'\n")
    outside.imported(str(tmp_path / "levity.py"))
    assert dataclasses.replace(DEFAULT, terms=("strain", "levity")).terms[1] == "levity"


def test_a_method_brings_the_training_of_its_network(tmp_path):
    home = str(tmp_path / "windy.py")
    Path(home).write_text("")
    recipe = dataclasses.replace(DEFAULT, name="windy", window=4)
    entry = MethodEntry(
        name="windy", description="", module="benchmarks.methods.network", declared_in=home, needs_body=True,
        trained="windy", training=Training("snug", recipe), options={"kind": "windy"},
    )  # fmt: skip
    cell = Cell(of_garment("tshirt").scene("kick").at(TINY), entry, 0, ("garments",))
    plan = Plan(
        preset=TINY, suites=("garments",), cells=(cell,), cases=(), seeds=(0,), device="cpu", folder=tmp_path,
        command="", motions=Motions(("walk",), ("kick",)),
    )  # fmt: skip
    (task,) = (task for task in Schedule(plan).tasks() if task.kind == "network")
    assert (task.chosen, task.home, task.steps) == (Training("snug", recipe), home, TINY.steps["snug"])
    assert home in task.modules and home in Schedule(plan).cell(cell).modules
    other = dataclasses.replace(entry, name="b", training=Training("snug", DEFAULT))
    for wrong in ([entry, other], [dataclasses.replace(entry, trained="snug")]):
        with pytest.raises(DeclarationError, match="another training is called"):
            outside._check_networks(wrong)


def test_a_metric_that_raises_is_named_with_its_file(tmp_path):
    home = tmp_path / "split.py"
    home.write_text(METRIC_FILE.replace("float(", "1 / 0 + float("))
    scene = SCENE["free_fall"].at(TINY).build()
    trajectory = Trajectory(scene.exact, scene.cloth.faces, np.arange(scene.frames) * scene.dt)
    group = metric.SceneRollOuts(scene)
    group.roll_outs.append(metric.RollOut(group, METHODS[0], trajectory, suites=("speed",)))
    with pytest.raises(RuntimeError, match=r"split\.py: ZeroDivisionError: division by zero"):
        measured(group.roll_outs[0], (), (str(home),))


# --- programs ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "seconds", "words"),
    [
        ("print('one', file=sys.stderr); sys.exit('no licence')", 9, "ended with status 1: no licence"),
        ("import time; print('loading', flush=True); time.sleep(9)", 0.5, "was ended after 0.5 s: loading"),
        ("pass", 9, "has not written {out}"),
        ("import numpy as n; n.savez(out, positions=n.zeros((6, 3, 3)))", 9, "has 3 vertices"),
        ("import numpy as n; n.savez(out, vertices=n.zeros((6, 3, 3)))", 9, "holds no positions"),
        ("import numpy as n; x = n.load(scene + '/cloth.npz')['start_positions']\n"
         "n.savez(out, positions=n.stack(6 * [x]), seconds_per_frame=-1.0)", 9, "no positive number"),
    ],
)  # fmt: skip
def test_a_program_that_goes_wrong_says_so_in_its_last_line(body, seconds, words, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(f"import sys\n_, scene, out = sys.argv\n{body}\n")
    entry = program("p", f"{sys.executable} -I {script} {{scene}} {{out}}", seconds=seconds)
    method = entry.make(models=tmp_path, seed=0)
    method.prepare(SCENE["free_fall"].at(TINY).build())
    with pytest.raises(Exception) as raised:
        method.run()
    assert words in str(raised.value) and "\n" not in str(raised.value)


def test_a_command_without_its_places_is_refused(tmp_path):
    with pytest.raises(DeclarationError, match=r"has no \{out\}"):
        program("p", "run.sh {scene}")
    method = program("p", "nowhere/run.sh {scene} {out}").make(models=tmp_path, seed=0)
    method.prepare(SCENE["free_fall"].at(TINY).build())
    with pytest.raises(RuntimeError, match="cannot be started"):
        method.run()


# --- the check ---------------------------------------------------------------------------------------------


class Still(Method):
    """Does no physics and keeps the contract; each breach below changes one thing."""

    seed = 0

    def prepare(self, scene):
        self.scene = scene

    def positions(self):
        return np.repeat(np.array(self.scene.start)[None], self.scene.frames, axis=0)

    def run(self):
        times = np.arange(self.scene.frames) * self.scene.dt
        return Trajectory(self.positions(), self.scene.cloth.faces, times, status="ok")


def breach(name):
    """A method that does one thing wrong."""

    def shaped(self):
        return Still.positions(self)[:, :-1]

    def nan(self):
        positions = Still.positions(self)
        positions[-1, 0] = np.nan
        return positions

    def off(self):
        positions = Still.positions(self)
        positions[0] += 1e-3
        return positions

    def slipping(self):
        positions = Still.positions(self)
        positions[3] += 1e-3
        return positions

    def random(self):
        positions = Still.positions(self)
        positions[2:, -1] += np.random.default_rng().random(3)
        return positions

    def seeded(self):
        positions = Still.positions(self)
        positions[2:, -1] += self.seed
        return positions

    def kept(self):
        if not hasattr(self, "result"):
            self.result = Still.positions(self)
        return self.result

    def alters(self):
        positions = Still.positions(self)
        self.scene.cloth.masses.flags.writeable = True
        self.scene.cloth.masses[0] *= 2.0
        return positions

    def connects(self):
        import socket

        with socket.socket() as stream:
            stream.settimeout(0.01)
            stream.connect_ex(("127.0.0.1", 9))
        return Still.positions(self)

    def late(self):
        import threading
        import time

        positions = Still.positions(self)

        def work():
            end = time.perf_counter() + 0.3
            while time.perf_counter() < end:
                positions[-1] += 1e-6

        threading.Thread(target=work, daemon=True).start()
        return positions

    def raises(self):
        raise RuntimeError("broken on\npurpose")

    return type("Breach", (Still,), {"positions": locals()[name]})


BREACHES = {
    "shaped": "floats (6, 16, 3) are due",
    "nan": "has a position that is not finite in frame 5",
    "off": "frame 0 is 0.001 m off the scene's start: put scene.start there",
    "slipping": "a pin is 0.001 m off its place in frame 3",
    "random": "a second run gives other positions",
    "seeded": "another seed gives other positions, by 1 m: say seeded=True",
    "kept": "run() gave again what it had given before: each call of run() has to do all of the work",
    "alters": "alters the scene: cloth.masses: copy what you change",
    "connects": "connects to 127.0.0.1:9: fetch what it needs beforehand",
    "late": "positions still changed after run() had come back: wait in run() for all threads",
    "raises": "run() raises RuntimeError: broken on purpose (",
}


def look(make, tmp_path, monkeypatch, scene="hanging_sheet", **fields) -> list[str]:
    """What the check finds wrong with such a method."""
    module = type(sys)("breaches")
    module.make = make
    monkeypatch.setitem(sys.modules, "breaches", module)
    entry = MethodEntry(name="m", description="", module="breaches", **fields)
    task = CheckMethod(
        name="m", label="", inputs={}, modules=(), cell=Cell(SCENE[scene].at(TINY), entry, 0, ("speed",))
    )
    monkeypatch.setattr("benchmarks.contract.findings.code_of", lambda home: {__file__: ""})
    return task.run(Context(RunFolder(tmp_path)), {}).result["wrong"]


@pytest.mark.parametrize("name", BREACHES)
def test_the_check_names_each_breach_and_its_remedy(name, tmp_path, monkeypatch):
    def make(*, models, seed):
        method = breach(name)()
        method.seed = seed
        return method

    wrong = look(make, tmp_path, monkeypatch)
    assert len(wrong) == 1 and BREACHES[name] in wrong[0]


def test_the_check_finds_nothing_in_what_keeps_the_contract(tmp_path, monkeypatch):
    assert look(lambda *, models, seed: Still(), tmp_path, monkeypatch) == []
    wrong = look(lambda *, models: Still(), tmp_path, monkeypatch)
    assert "make() raises TypeError" in wrong[0] and "make(*, models, seed" in wrong[0]
    assert "without prepare, run" in look(lambda *, models, seed: object(), tmp_path, monkeypatch)[0]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("raise", "prepare() raises RuntimeError: broken on purpose"),
        ("hungry", "run() raises MemoryError: no room"),
        ("early", "positions still changed"),
        ("unheld", "quasi_static() raises OSError: no room left for the held poses"),
        ("crowded", "batch(): its time cannot be believed"),
        ("torn", "batch() raises RuntimeError: no two bodies"),
    ],
)
def test_the_check_catches_every_known_misbehaviour(how, words, tmp_path, monkeypatch):
    import misbehaving

    fields = {"options": {"how": how}, "batched": True}
    (wrong,) = look(misbehaving.make, tmp_path, monkeypatch, **fields)
    assert words in wrong


@pytest.mark.parametrize(("how", "words"), [("segfault", "SIGSEGV"), ("hang", "no answer within 4 s")])
def test_the_check_survives_what_dies_and_what_hangs(how, words, tmp_path, monkeypatch):
    entry = MethodEntry(
        name=how, description="", module="misbehaving", options={"how": how}, declared_in="misbehaving",
        needs_no_obstacle=True,
    )  # fmt: skip
    monkeypatch.setattr(check, "BARE", ("free_fall",))
    found = list(check.check({"methods": [entry], "scenes": [], "metrics": []}, tmp_path, 4.0))
    assert [fine for _, fine in found] == [False] and words in found[0][0]


def test_the_check_says_what_is_skipped_everywhere(tmp_path):
    entry = MethodEntry(name="m", description="", module="misbehaving", package="nowhere")
    ((line, fine),) = check.check({"methods": [entry], "scenes": [], "metrics": []}, tmp_path)
    assert not fine and "is skipped in every scene: m needs the package nowhere" in line


@pytest.fixture
def in_process(monkeypatch):
    monkeypatch.setattr(
        "benchmarks.runner.executor.LocalExecutor", lambda run, assets, workers: InProcess(run, assets)
    )


def test_the_command_checks_what_files_declare(files, in_process, tmp_path, capsys):
    assert check.main([str(files / "lift.py"), str(files / "height.py")]) == 0
    out = capsys.readouterr().out
    assert "lift: fine\n" in out and "height.py in hanging_sheet: fine\n" in out and "nothing is wrong" in out
    askew = SCENE_FILE.replace("-self.cloth.masses[:, None] *", "-2.0 * self.cloth.masses[:, None] *")
    (tmp_path / "askew.py").write_text(askew)
    (tmp_path / "loose.py").write_text(METRIC_FILE.replace("float(", "").replace(".max())", ".max(axis=1)"))
    assert check.main([str(tmp_path / "askew.py"), str(tmp_path / "loose.py")]) == 1
    out = capsys.readouterr().out
    assert "energy lift: its gradient is not the derivative of its value" in out
    assert "height/highest of simulation is a ndarray: give a float" in out and "2 to mend" in out


@pytest.mark.parametrize(
    ("word", "words"),
    [("gone.py", "gone.py: no such file"), ("empty.py", "declares none of METHODS, SCENES, METRICS")],
)
def test_the_command_refuses_in_one_line(word, words, tmp_path, monkeypatch, capsys):
    (tmp_path / "empty.py").write_text("")
    monkeypatch.chdir(tmp_path)
    assert check.main([word]) == 2
    assert words in capsys.readouterr().err
