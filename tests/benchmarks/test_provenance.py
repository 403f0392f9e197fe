"""A task's dependencies: all that its code imports is among them, and what decides no result is not."""

from __future__ import annotations

import ast
import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import provenance
from benchmarks.declarations import DeclarationError
from benchmarks.provenance import PACKAGES, digest, files_of, find_imports, find_module, software
from benchmarks.runner import schedule
from tests.project.test_layers import LAYERS, imports

FILES = {
    "snug/network.py": "import torch\n",
    "snug/data/body.npz": "weights",
    "snug/NOTICE.md": "prose",
    "snug/trained/snug-tshirt.safetensors": "a network, which counts where it is read",
    "snug/__pycache__/kernel.nbi": "compiled",
    "reference_sim/cloth.py": "import os\n",
}
MINE = "import numpy, absent_package\ndef make():\n    import helper\n    from deep.inner import solver\n"
BESIDE = {
    "mine.py": MINE, "helper.py": "", "unused.py": "half a line (", "deep/__init__.py": "",
    "deep/inner/solver.py": "", "deep/inner/__init__.py": "", "plain/module.py": "",
}  # fmt: skip
NOT_BESIDE = {"other/place/module.py": "", "mine.txt": "", ".hidden/a.py": "", "deep/data/a.json": ""}


def write(root: Path, path: str, text: str) -> None:
    """Write a file anew."""
    (root / path).parent.mkdir(parents=True, exist_ok=True)
    (root / path).write_text(text)
    forget()


def forget() -> None:
    """Let nothing be known of files that were read."""
    provenance._content.cache_clear()


@pytest.mark.parametrize("path", [*FILES, "snug/another.py"])
def test_code_and_data_of_a_folder_count_and_prose_and_networks_do_not(tmp_path, monkeypatch, path):
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    for name, text in FILES.items():
        write(tmp_path, name, text)
    before = software("snug", "snug/data")
    assert set(before) == {"snug", *(f"package {name}" for name in PACKAGES)}
    write(tmp_path, path, "another")
    counts = path in ("snug/network.py", "snug/data/body.npz", "snug/another.py")
    assert (software("snug", "snug/data") != before) is counts


@pytest.fixture
def home(tmp_path):
    for name, text in (BESIDE | NOT_BESIDE).items():
        write(tmp_path, name, text)
    return tmp_path / "mine.py"


@pytest.mark.parametrize("name", [*BESIDE, *NOT_BESIDE])
def test_a_users_file_counts_with_the_modules_beside_it_and_all_that_is_installed(home, name):
    before = software(str(home))
    assert {str(home), "installed packages"} <= set(before)
    write(home.parent, name, "CHANGED = True\n" + (BESIDE | NOT_BESIDE)[name])
    after = software(str(home))
    assert [part for part in before if after.get(part) != before[part]] == [str(home)] * (name in BESIDE)
    assert list(find_imports(str(home))) == ["deep", "helper"]


# What tasks import and what decides no result: names, files and their formats, origin, sizes that are
# inputs.
CARRYING = (
    "benchmarks/plan/cell.py", "benchmarks/declarations.py",
    "benchmarks/presets.py", "benchmarks/provenance.py", "benchmarks/results", "benchmarks/runner/task.py",
    "snug/trained",
)  # fmt: skip
TASKS = {
    "cell": ("benchmarks/methods", *schedule.RUNNING),
    "training": schedule.RUNNING,
    "metrics": schedule.MEASURING,
    "case": schedule.CASES,
}
NOT_COMPUTING = {"filelock", "lazy_loader", "tqdm", "reports"}
DISTRIBUTION = {"skfem": "scikit-fem", "igl": "libigl"}


def file_behind(name: str) -> str:
    """Return the file of ours that has a dotted name, or that defines it."""
    try:
        return find_module(name)
    except DeclarationError:
        return find_module(name.rpartition(".")[0])


@pytest.mark.parametrize("task", TASKS)
def test_what_a_task_declares_holds_all_that_it_imports(task):
    root = provenance.ROOT
    declared = {file.relative_to(root).as_posix() for place in TASKS[task] for file in files_of(place)}
    missing = set()
    for path in sorted(name for name in declared if name.endswith(".py")):
        for _, name in imports(ast.parse((root / path).read_text(encoding="utf-8"))):
            top = name.split(".")[0]
            if top in LAYERS:
                needed = file_behind(name)
                if needed not in declared and not needed.startswith(CARRYING):
                    missing.add(f"{path} imports {needed}")
            elif DISTRIBUTION.get(top, top) not in {*PACKAGES, *NOT_COMPUTING, *sys.stdlib_module_names}:
                missing.add(f"{path} imports {top}")
    assert not missing, "\n".join(sorted(missing))


def test_digests_tell_values_apart():
    @dataclasses.dataclass
    class Pair:
        a: np.ndarray
        b: str

    one = Pair(np.arange(3.0), "x")
    assert digest(one) == digest(Pair(np.arange(3.0), "x"))
    others = (np.arange(3.0) + 1e-16, np.arange(3), np.arange(3.0)[:, None])
    pairs = [Pair(np.arange(3.0), "y"), *(Pair(array, "x") for array in others)]
    assert len({digest(value) for value in (one, *pairs)}) == 5
    with pytest.raises(TypeError, match="object"):
        digest({"a": object()})


def test_a_commit_is_that_of_the_code_and_changes_are_those_of_code(tmp_path, monkeypatch):
    """Published runs are committed one by one, and all name the commit of the code that made them."""
    monkeypatch.setattr(provenance, "ROOT", tmp_path)

    def git(*words: str) -> str:
        command = ["git", "-c", "user.name=a", "-c", "user.email=a@b", *words]
        process = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        return process.stdout.strip()

    def commit() -> str:
        provenance.commit.cache_clear()
        return provenance.commit()

    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    git("init", "-q")
    for path in ("snug/network.py", "reports/build.py", "snug/trained/a.safetensors"):
        write(tmp_path, path, "1")
        git("add", "-A")
        git("commit", "-qm", path)
        names = git("log", "--format=%h", "--abbrev=10").split()
        assert commit() == names[-1]
    write(tmp_path, "reports/build.py", "2")
    assert commit() == names[-1]
    write(tmp_path, "snug/new/NOTICE.md", "2")
    assert commit() == names[-1]
    write(tmp_path, "snug/new/network.py", "2")
    assert commit() == f"{names[-1]}+changes"
    provenance.commit.cache_clear()
