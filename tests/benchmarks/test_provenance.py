"""A task's dependencies: all that its code imports is among them, and what decides no result is not."""

from __future__ import annotations

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from benchmarks import provenance
from benchmarks.declarations import DeclarationError
from benchmarks.provenance import _files_of, digest, find_module, imported_beside, software
from benchmarks.runner import schedule
from tests.project.test_layers import LAYERS, imports

FILES = {
    "snug/network.py": '"""Words."""\nimport torch\n\n\ndef f():\n    import nowhere, snug\n    return 1\n',
    "snug/train.py": "a command",
    "snug/body/__init__.pyi": "# says where names come from\nfrom .a import f\n",
    "snug/NOTICE.md": "prose",
    "snug/data/body.npz": "weights",
    "snug/trained/snug-tshirt.safetensors": "a network, which counts where it is read",
    "snug/__pycache__/kernel.nbi": "compiled",
    "reference_sim/cloth.py": "import os\nimport numpy as np\nfrom scipy import sparse\n",
}


def write(root: Path, path: str, text: str) -> None:
    """Write a file anew."""
    (root / path).parent.mkdir(parents=True, exist_ok=True)
    (root / path).write_text(text)
    forget()


def forget() -> None:
    """Let nothing be known of files that were read."""
    provenance._content.cache_clear()
    provenance._read.cache_clear()


@pytest.fixture
def project(tmp_path, monkeypatch):
    """The folder of a small project."""
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    for path, text in FILES.items():
        write(tmp_path, path, text)
    return tmp_path


# --- the project's own code --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "text", "counts"),
    [
        ("snug/network.py", FILES["snug/network.py"].replace("1", "2"), True),
        ("snug/another.py", "", True),
        ("snug/data/body.npz", "other weights", True),
        ("snug/body/__init__.pyi", "from .b import f\n", True),
        ("snug/body/__init__.pyi", "from .a import f\n", False),
        ("snug/network.py", FILES["snug/network.py"].replace("Words", "More words") + "\n# more\n", False),
        ("reference_sim/cloth.py", "import numpy\nx = 1\n", False),
        *((path, "another", False) for path in (list(FILES)[1], list(FILES)[3], *list(FILES)[5:7])),
    ],
)
def test_statements_and_data_of_a_folder_count_and_words_commands_and_networks_do_not(
    project, path, text, counts
):
    before = software("snug")
    write(project, path, text)
    assert (software("snug") != before) is counts


def test_packages_that_the_code_imports_count_and_a_place_within_another_is_no_part(project):
    parts = software("snug/data", "snug", "reference_sim/cloth.py")
    packages = {f"package {name}" for name in ("numpy", "scipy", "torch", "nowhere")}
    assert set(parts) == {"snug", "reference_sim/cloth.py"} | packages
    assert parts["package nowhere"] == "absent" and parts["package torch"].startswith("torch ")
    with pytest.raises(DeclarationError, match=r"snug/nothing: no such folder or file"):
        software("snug/nothing")


# --- files of users ----------------------------------------------------------------------------------------

MINE = "import numpy, absent_package\ndef make():\n    import helper\n    from deep.inner import solver\n"
BESIDE = {
    "mine.py": MINE, "helper.py": "", "unused.py": "half a line (", "deep/__init__.py": "",
    "deep/inner/solver.py": "", "deep/inner/__init__.py": "", "plain/module.py": "",
}  # fmt: skip
NOT_BESIDE = {"other/place/module.py": "", "mine.txt": "", ".hidden/a.py": "", "deep/data/a.json": ""}


@pytest.fixture
def home(tmp_path):
    for name, text in (BESIDE | NOT_BESIDE).items():
        write(tmp_path, name, text)
    return tmp_path / "mine.py"


@pytest.mark.parametrize("name", [*BESIDE, *NOT_BESIDE])
def test_a_users_file_counts_with_the_modules_beside_it(home, name):
    before = software(str(home))
    assert set(before) == {str(home), "package absent_package", "package numpy"}
    write(home.parent, name, "CHANGED = True\n" + (BESIDE | NOT_BESIDE)[name])
    after = software(str(home))
    assert [part for part in before if after.get(part) != before[part]] == [str(home)] * (name in BESIDE)


def test_what_a_users_file_imports_from_beside_it_is_told_from_packages(home):
    assert imported_beside(str(home)) == {
        "helper": home.parent / "helper.py", "deep": home.parent / "deep" / "__init__.py",
    }  # fmt: skip


@pytest.mark.parametrize("installed", [False, True])
def test_a_file_in_a_package_counts_with_it_and_one_installed_without_what_lies_beside(
    home, monkeypatch, installed
):
    monkeypatch.setattr(provenance, "_distributions", lambda: {"deep": ["deep"]} if installed else {})
    solver = str(home.parent / "deep" / "inner" / "solver.py")
    before = software(solver)
    write(home.parent, "helper.py", "CHANGED = True\n")
    assert (software(solver) == before) is installed
    before = software(solver)
    write(home.parent, "deep/__init__.py", "CHANGED = True\n")
    assert software(solver) != before


# --- what tasks declare ------------------------------------------------------------------------------------

# What tasks import and what decides no result: names, files and their formats, origin, sizes that are inputs.
CARRYING = (
    "benchmarks/plan/cell.py", "benchmarks/declarations.py",
    "benchmarks/presets.py", "benchmarks/provenance.py", "benchmarks/results", "benchmarks/runner/task.py",
    "benchmarks/training.py", "snug/trained", *provenance.NO_RESULT,
)  # fmt: skip
TASKS = {
    "simulation": (schedule.TRUTH, *schedule.RUNS, *schedule.SOLVERS, *schedule.NETWORKS),
    "network": ("benchmarks/methods", *schedule.RUNS, *schedule.SOLVERS, *schedule.NETWORKS),
    "training": schedule.TRAINING,
    "metrics": (*schedule.METRICS, *schedule.RUNS, *schedule.DRESSING),
    "case": schedule.CASES,
}


def file_behind(name: str) -> str:
    """Return the file of ours that has a dotted name, or that defines it."""
    try:
        return find_module(name)
    except DeclarationError:
        return find_module(name.rpartition(".")[0])


@pytest.mark.parametrize("task", TASKS)
def test_what_a_task_declares_holds_all_that_it_imports(task):
    root = provenance.ROOT
    assert all((root / place).exists() for place in provenance.NO_RESULT)
    declared = {file.relative_to(root).as_posix() for place in TASKS[task] for file in _files_of(place)}
    missing = set()
    for path in sorted(name for name in declared if name.endswith(".py")):
        for _, name in imports(ast.parse((root / path).read_text(encoding="utf-8"))):
            if name.split(".")[0] in LAYERS:
                needed = file_behind(name)
                if needed not in declared and not needed.startswith(CARRYING):
                    missing.add(f"{path} imports {needed}")
    assert sorted(missing) == []


@pytest.mark.parametrize(
    ("path", "stale"),
    [
        ("reference_sim/minimise/newton.py", set(TASKS)),
        ("snug/training/train_network.py", set(TASKS)),
        ("benchmarks/metrics/curvature.py", {"metrics", "case"}),
        ("benchmarks/scenes/sheets.py", set(TASKS) - {"training"}),
        ("benchmarks/plan/make_plan.py", set()),
        ("benchmarks/runner/schedule.py", set()),
        ("snug/train.py", set()),
        ("reports/build.py", set()),
    ],
)
def test_a_change_makes_stale_what_it_may_move(path, stale):
    files = {task: {f for place in code for f in _files_of(place)} for task, code in TASKS.items()}
    assert {task for task in files if provenance.ROOT / path in files[task]} == stale


def test_digests_tell_values_apart():
    @dataclasses.dataclass
    class Pair:
        a: np.ndarray
        b: str

    one = Pair(np.arange(3.0), "x")
    assert digest(one) == digest(Pair(np.arange(3.0), "x"))
    others = [Pair(np.arange(3.0) + 1e-16, "y"), Pair(np.arange(3), "x"), Pair(np.arange(3.0)[:, None], "x")]
    assert len({digest(value) for value in (one, *others)}) == 4
    with pytest.raises(TypeError, match="object"):
        digest({"a": object()})
