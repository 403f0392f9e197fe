"""A task's dependencies are read from the source: all that it uses, and nothing else that would rerun it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fingerprint import dependencies as source
from benchmarks.fingerprint.dependencies import code_of, data_of, packages_of
from benchmarks.fingerprint.digest import digest
from benchmarks.methods.catalogue.all_methods import METHODS
from benchmarks.metrics import MODULE_OF
from benchmarks.scenes import FURTHER_SCENES, SCENES

FILES = {
    "reference_sim/__init__.py": "from .cloth import Cloth\n",
    "reference_sim/cloth.py": "class Cloth:\n    pass\n",
    "reference_sim/stretch.py": "K = 1.0\n",
    "reference_sim/bend.py": "K = 2.0\n",
    "reference_sim/terms/__init__.py": "def __getattr__(name):\n    return load(name)\n",
    "reference_sim/terms/stretch.py": "class Stretch:\n    pass\n",
    "reference_sim/terms/bend.py": "class Bend:\n    pass\n",
    "reference_sim/terms/twist/__init__.py": "",
    "reference_sim/terms/twist/definition.py": (
        "class Twist:\n"
        "    kernels: ClassVar = {'lanes': 'reference_sim.terms.twist.lanes:make', 'own': 'f'}\n"
    ),
    "reference_sim/terms/twist/lanes.py": "def make(term):\n    return 2 * term\n",
    "snug/network.py": "import torch\nfrom reference_sim.terms import Unknown\n",
    "snug/data/body.npz": "weights",
    "snug/trained/snug-tshirt.safetensors": "a network, which counts where it is read",
    "benchmarks/methods/catalogue/all_methods.py": "from . import one, other\n",
    "benchmarks/methods/one.py": (
        '"""Words."""\nfrom typing import TYPE_CHECKING\nfrom reference_sim import Cloth\n'
        "from ..scene import build\nif TYPE_CHECKING:\n    from snug.network import Network\n"
        "def make():\n    import numpy, nowhere\n    from reference_sim.terms import Stretch\n"
    ),
    "benchmarks/methods/other.py": "import snug.network\nfrom . import one\n",
    "benchmarks/scene.py": "import os\ndef build():\n    return 1\n",
}


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A small project; gives a function that writes a file of it anew."""

    def write(path: str, text: str) -> None:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
        forget()

    monkeypatch.setattr(source, "ROOT", tmp_path)
    for path, text in FILES.items():
        write(path, text)
    yield write
    forget()


def forget() -> None:
    for name in ("_source", "_exported", "_names", "_file_of", "_closure", "_data_files"):
        getattr(source, name).cache_clear()


def test_the_code_is_what_is_imported_also_inside_functions_and_by_first_use(project):
    assert set(code_of("benchmarks.methods.one")) == {
        "benchmarks/methods/one.py", "benchmarks/scene.py", "reference_sim/__init__.py",
        "reference_sim/cloth.py", "reference_sim/terms/__init__.py", "reference_sim/terms/stretch.py",
    }  # fmt: skip
    assert "snug/network.py" in code_of("benchmarks.methods.other")


@pytest.mark.parametrize(
    "path", ["reference_sim/terms/bend.py", "benchmarks/methods/other.py", "snug/network.py"]
)
def test_what_is_not_used_may_change(project, path):
    before = code_of("benchmarks.methods.one")
    project(path, "CHANGED = True\n")
    assert code_of("benchmarks.methods.one") == before


@pytest.mark.parametrize(
    "path", ["reference_sim/terms/stretch.py", "benchmarks/scene.py", "reference_sim/cloth.py"]
)
def test_what_is_used_may_not(project, path):
    before = code_of("benchmarks.methods.one")
    project(path, FILES[path] + "CHANGED = True\n")
    after = code_of("benchmarks.methods.one")
    assert [name for name in after if after[name] != before[name]] == [path]


def test_what_runs_beside_the_type_checkers_imports_counts(tmp_path, project):
    """The other branch is run, and so are the packages that a user's module is imported through."""
    file = tmp_path / "mine.py"
    file.write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import unused\nelse:\n    import fast\n"
        "if not TYPE_CHECKING:\n    import faster\nimport helpers.inner.solver\n"
    )
    inner = ("helpers/__init__", "helpers/inner/__init__", "helpers/inner/solver")
    for name in ("unused", "fast", "faster", *inner):
        path = tmp_path / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    forget()
    names = {Path(path).relative_to(tmp_path).as_posix() for path in code_of(str(file))}
    assert names == {
        "mine.py", "fast.py", "faster.py",
        "helpers/__init__.py", "helpers/inner/__init__.py", "helpers/inner/solver.py",
    }  # fmt: skip


def test_words_and_blanks_do_not_count(project):
    before = code_of("benchmarks.methods.one")
    text = FILES["benchmarks/methods/one.py"].replace("Words.", "Other words.")
    project("benchmarks/methods/one.py", f"{text}\n\n# a remark\n")
    assert code_of("benchmarks.methods.one") == before


def test_packages_are_those_that_the_code_imports_installed_or_not(project):
    assert set(packages_of(code_of("benchmarks.methods.one"))) == {"numpy", "nowhere"}
    packages = packages_of(code_of("benchmarks.methods.other"))
    assert packages["nowhere"] == "absent" and packages["numpy"].startswith("numpy ") and "torch" in packages


def test_a_name_that_nobody_defines_makes_all_of_its_package_count(project):
    code = code_of("snug.network")
    assert {"reference_sim/terms/stretch.py", "reference_sim/terms/bend.py"} < set(code)


def test_what_lies_beside_the_source_counts_where_its_package_is_reached(project):
    assert set(data_of(code_of("benchmarks.methods.other"))) == {"snug/data/body.npz"}
    assert data_of(code_of("benchmarks.methods.one")) == {}


def test_a_stub_says_which_module_a_lazy_name_comes_from(project):
    """Also where a module of the package has the same name as what it exports."""
    project("reference_sim/__init__.py", "__getattr__ = lazy\n")
    project("reference_sim/__init__.pyi", "from .bend import stretch as stretch\n")
    project("benchmarks/three.py", "from reference_sim import stretch\n")
    files = {"benchmarks/three.py", "reference_sim/__init__.py", "reference_sim/bend.py"}
    assert set(code_of("benchmarks.three")) == files


def test_the_kernels_that_a_term_declares_count_with_it(project):
    project("benchmarks/three.py", "from reference_sim.terms import Twist\n")
    terms = "reference_sim/terms"
    files = {"benchmarks/three.py", f"{terms}/__init__.py"}
    assert set(code_of("benchmarks.three")) == files | {
        f"{terms}/twist/definition.py",
        f"{terms}/twist/lanes.py",
    }


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


def test_a_scene_without_obstacle_or_body_depends_on_neither():
    code = code_of(
        "benchmarks.tasks.cell_task",
        "benchmarks.scenes.hanging_sheet",
        "benchmarks.methods.solvers.simulation",
    )
    assert "reference_sim/energies/bend_hinge.py" in code and "reference_sim/minimise/newton.py" in code
    unused = ("snug/", "reports/", "reference_sim/energies/contact", "benchmarks/methods/__init__")
    assert [path for path in code if path.startswith(unused)] == []


def test_training_does_not_hang_on_the_solver():
    code = code_of("benchmarks.tasks.training")
    assert "snug/training/losses/physics_loss.py" in code
    assert "reference_sim/energies/bend_hinge.py" in code
    assert [path for path in code if path.startswith("reference_sim/minimise")] == []


def test_no_task_depends_on_the_lists_of_scenes_methods_and_metrics():
    """A line more in one of them makes nothing stale."""
    lists = {f"benchmarks/{name}" for name in (
        "scenes/__init__.py", "methods/__init__.py", "methods/solvers.py", "methods/learned.py",
        "presets.py", "plan/choose_cells.py", "plan/study.py", "plan/plan.py",
        "runner/schedule.py", "validation/registry.py",
    )}  # fmt: skip
    lists.add("snug/recipes/named.py")
    names = (
        "cell_task",
        "ground_truth",
        "training",
        "metric_task",
        "case",
    )
    modules = [f"benchmarks.tasks.{name}" for name in names]
    modules += [entry.module for entry in (*SCENES, *FURTHER_SCENES, *METHODS)]
    modules += ["benchmarks.scenes.dressed_body", "benchmarks.assets.assets"]
    modules += list(MODULE_OF.values())
    assert {name: files for name in modules if (files := lists & set(code_of(name)))} == {}


def test_the_packages_that_move_a_number_are_known():
    assert {"pymetis", "cvxopt", "scipy", "numba"} <= set(
        packages_of(code_of("benchmarks.methods.solvers.simulation"))
    )
    assert "ipctk" in packages_of(code_of("reference_sim.energies.contact_barrier"))
