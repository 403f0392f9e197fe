"""Kernels that numba keeps on disk: used again while nothing has changed, never once something has."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FILES = {
    "deep.py": "from reference_sim.kernels.kernel_cache import njit\n"
    "@njit(cache=True)\ndef deepest(x):\n    return x + 1\n",
    "callee.py": "from reference_sim.kernels.kernel_cache import njit\nfrom deep import deepest\n"
    "@njit(cache=True)\ndef inner(x):\n    return 2 * deepest(x)\n",
    "other.py": "from reference_sim.kernels.kernel_cache import njit\n"
    "@njit(cache=True)\ndef power(x):\n    return x**2\n",
    "constants.py": "FACTOR = 10\n",
    # A kernel that stands below the first one calls what the file has imported.
    "caller.py": "from reference_sim.kernels.kernel_cache import njit\nimport other\n"
    "from callee import inner\nfrom constants import FACTOR\n"
    "@njit(cache=True)\ndef outer(x):\n    return FACTOR * other.power(helper(x))\n"
    "@njit(cache=True)\ndef helper(x):\n    return inner(x)\n",
}
# A kernel that is an argument: its caller does not import it.
FILES["given.py"] = (
    "import numpy as np, sys\nfrom reference_sim.kernels.kernel_cache import njit\n"
    "from reference_sim.kernels.kernel_cache import call_each, kernel_argument\n"
    "@njit(cache=True)\ndef sums(terms, x):\n    out = np.zeros(len(terms) + 1)\n"
    "    call_each(terms, out, x)\n    return out.sum()\n"
)
FILES["term.py"] = (
    "from reference_sim.kernels.kernel_cache import njit\n"
    "@njit(cache=True)\ndef scaled(data, x):\n    return data[0] * x\n"
)
CALL_GIVEN = (
    "import given, term\nkernel = given.kernel_argument(term.scaled)\n"
    "print(given.sums(((kernel, (2.0,)), (kernel, (3.0, 1))), 10.0), given.sums((), 1.0))\n"
    "print(sum(given.sums.stats.cache_hits.values()))"
)
CALL = (
    "import caller\nprint(caller.outer(3))\n"
    "print(sum(caller.outer.stats.cache_hits.values()))\nprint(caller.outer.stats.cache_path)"
)


def run(code: str, path: Path, **environment: str) -> list[str]:
    """The lines that a new process prints, of code that begins in a folder and keeps no compiled Python."""
    variables = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | environment
    done = subprocess.run(
        [sys.executable, "-B", "-c", code], cwd=path, capture_output=True, text=True,
        env=variables | {"PYTHONPATH": f"{ROOT}{os.pathsep}{path}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def call(path: Path, **environment: str) -> tuple[int, bool, Path]:
    """10 (2 (3 + 1))^2 at first; whether it came from the disk; where it lies there."""
    value, hits, place = run(CALL, path, **environment)
    return int(value), hits == "1", Path(place)


@pytest.fixture
def project(tmp_path):
    """Kernels that call kernels of other files."""
    for name, source in FILES.items():
        (tmp_path / name).write_text(source)
    return tmp_path


def edit(path: Path, old: str, new: str) -> None:
    source = path.read_text()
    assert old in source
    path.write_text(source.replace(old, new))


def test_an_edit_in_another_file_that_changes_the_result_is_seen_and_the_kernel_before_it_stays(project):
    assert call(project)[:2] == (640, False)
    assert call(project)[:2] == (640, True)
    for name, old, new, value in (
        ("deep.py", "x + 1", "x + 2", 1000),
        ("other.py", "x**2", "x**3", 10000),
        ("constants.py", "10", "20", 20000),
    ):
        edit(project / name, old, new)
        assert call(project)[:2] == (value, False), name
    edit(project / "constants.py", "20", "10")
    assert call(project)[:2] == (10000, True)


def test_an_edit_of_a_kernel_that_is_an_argument_is_seen(project):
    assert run(CALL_GIVEN, project) == ["50.0 0.0", "0"]
    assert run(CALL_GIVEN, project) == ["50.0 0.0", "2"]
    edit(project / "term.py", "data[0] * x", "data[0] + x")
    assert run(CALL_GIVEN, project) == ["25.0 0.0", "1"]


def test_where_the_package_cannot_be_written_the_cache_of_the_user_serves(project):
    (project / "__pycache__").write_text("a file, so that no folder can be made")
    user = str(project / "user")
    assert call(project, XDG_CACHE_HOME=user, HOME=user, LOCALAPPDATA=user)[2].is_relative_to(user)
