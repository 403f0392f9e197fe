"""Kernels that numba keeps on disk: used again while nothing has changed, never once something has."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from reference_sim.kernels.kernel_cache import njit

ROOT = Path(__file__).resolve().parents[3]
FILES = {
    "deep.py": "@njit(cache=True)\ndef deepest(x):\n    return x + 1\n",
    "callee.py": "from deep import deepest\n@njit(cache=True)\ndef inner(x):\n    return 2 * deepest(x)\n",
    "other.py": "@njit(cache=True)\ndef power(x):\n    return x**2\n",
    "constants.py": "FACTOR = 10\n",
    # A kernel that is an argument: its caller does not import it.
    "term.py": "@njit(cache=True)\ndef scaled(data, x):\n    return data[0] * x\n",
    # A kernel that stands below the first one calls what the file has imported.
    "caller.py": "import other\nimport numpy as np\nfrom callee import inner\nfrom constants import FACTOR\n"
    "@njit(cache=True)\ndef outer(terms, x):\n    out = np.zeros(len(terms) + 1)\n"
    "    call_each(terms, out, x)\n    return FACTOR * other.power(helper(x)) + out.sum()\n"
    "@njit(cache=True)\ndef helper(x):\n    return inner(x)\n",
}
HEAD = "from reference_sim.kernels.kernel_cache import call_each, kernel_argument, njit\n"
CALL = (
    "import caller, term\nkernel = caller.kernel_argument(term.scaled)\n"
    "print(caller.outer(((kernel, (2.0,)), (kernel, (3.0, 1))), 3))\n"
    "print(sum(caller.outer.stats.cache_hits.values()))\nprint(caller.outer.stats.cache_path)"
)


def call(path: Path, **environment: str) -> tuple[float, bool, Path]:
    """10 (2 (3 + 1))^2 + 2 3 + 3 3 at first, by a new process; whether it came from the disk; from where."""
    variables = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | environment
    process = subprocess.run(
        [sys.executable, "-B", "-c", CALL], cwd=path, capture_output=True, text=True,
        env=variables | {"PYTHONPATH": f"{ROOT}{os.pathsep}{path}"},
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    value, hits, place = process.stdout.splitlines()
    return float(value), hits == "1", Path(place)


@pytest.fixture
def project(tmp_path):
    """Kernels that call kernels of other files."""
    for name, source in FILES.items():
        (tmp_path / name).write_text(HEAD + source)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "old", "new", "value"),
    [
        ("deep.py", "x + 1", "x + 2", 1015),
        pytest.param("other.py", "x**2", "x**3", 5135, marks=pytest.mark.slow),
        pytest.param("constants.py", "10", "20", 1295, marks=pytest.mark.slow),
        pytest.param("term.py", "data[0] * x", "data[0] + x", 651, marks=pytest.mark.slow),
    ],
)
def test_an_edit_in_another_file_is_seen_and_the_kernel_before_it_stays(name, old, new, value, project):
    assert call(project)[:2] == (655, False)
    source = (project / name).read_text()
    assert old in source
    (project / name).write_text(source.replace(old, new))
    assert call(project)[:2] == (value, False)
    (project / name).write_text(source)
    assert call(project)[:2] == (655, True)


def test_of_two_processes_that_need_a_kernel_one_compiles_it(project):
    source = (project / "deep.py").read_text()
    (project / "deep.py").write_text(f"import time\ntime.sleep(1.0)\n{source}")  # both have begun by then
    with ThreadPoolExecutor() as pool:
        assert {one[:2] for one in pool.map(call, [project, project])} == {(655, False), (655, True)}


def test_where_the_package_cannot_be_written_the_cache_of_the_user_serves(project):
    (project / "__pycache__").write_text("a file, so that no folder can be made")
    user = str(project / "user")
    # A variable that would leave kernels uncompiled, and the callers of them without what they ask for.
    assert call(project, NUMBA_DISABLE_JIT="1", XDG_CACHE_HOME=user, HOME=user, LOCALAPPDATA=user)[
        2
    ].is_relative_to(user)


SUM = (
    "import numpy as np\nfrom reference_sim.minimise.descent import dot\n"
    "a, b = np.random.default_rng(0).normal(size=(2, 3000))\nprint(dot(a, b).hex())"
)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="LLVM chooses the width there")
def test_a_sum_has_the_same_digits_on_processors_that_prefer_other_vectors(tmp_path):
    variables = {k: v for k, v in os.environ.items() if k != "NUMBA_CPU_FEATURES"}
    variables |= {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path)}
    sums = [
        subprocess.check_output([sys.executable, "-c", SUM], env=variables | {"NUMBA_CPU_NAME": name})
        for name in ("skylake-avx512", "znver4")
    ]
    assert sums[0] == sums[1]


@pytest.mark.parametrize("fastmath", [True, {"nsz", "arcp"}, {"afn"}])
def test_a_kernel_of_estimated_reciprocals_is_refused(fastmath):
    with pytest.raises(ValueError, match=r"leave out afn, arcp, fast$"):
        njit(fastmath=fastmath)
