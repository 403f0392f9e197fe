"""Kernels that numba keeps on disk: used again while nothing has changed, never once something has."""

from __future__ import annotations

import ast
import json
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


# Loading numba takes longer than compiling one of these kernels: a process that has it forks the others.
FORKING = """
import json, os, sys, traceback
import numba
import reference_sim.kernels.kernel_cache
for line in sys.stdin:
    code, path, environment = json.loads(line)
    read, write = os.pipe()
    if os.fork() == 0:
        os.dup2(write, 1)
        os.dup2(write, 2)
        os.chdir(path)
        os.environ.update(environment)
        sys.path.insert(0, path)
        numba.config.reload_config()
        try:
            exec(code, {})
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        sys.stdout.flush()
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as stream:
        said = stream.read()
    print(json.dumps([os.waitstatus_to_exitcode(os.wait()[1]), said]), flush=True)
"""


@pytest.fixture(scope="module")
def forking():
    """A process that keeps no compiled Python, which looks at whole seconds only."""
    variables = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-B", "-c", FORKING]
    with subprocess.Popen(
        command, env=variables, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    ) as process:
        yield process
        process.stdin.close()


@pytest.fixture
def run(forking):
    """The lines that a new process prints, of code that begins in a folder."""

    def lines(code: str, path: Path, **environment: str) -> list[str]:
        print(json.dumps([code, str(path), environment]), file=forking.stdin, flush=True)
        status, output = json.loads(forking.stdout.readline())
        assert status == 0, output
        return output.split("\n")[:-1]

    return lines


@pytest.fixture
def call(run):
    """10 (2 (3 + 1))^2 at first; whether it came from the disk; where it lies there."""

    def found(path: Path, **environment: str) -> tuple[int, bool, Path]:
        value, hits, place = run(CALL, path, **environment)
        return int(value), hits == "1", Path(place)

    return found


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


def test_every_edit_that_changes_the_result_is_seen_and_the_kernel_before_it_stays(project, call):
    assert call(project)[:2] == (640, False)
    assert call(project)[:2] == (640, True)
    for name, old, new, value in (
        ("callee.py", "2 * ", "3 * ", 1440),
        ("deep.py", "x + 1", "x + 2", 2250),
        ("other.py", "x**2", "x**3", 33750),
        ("constants.py", "10", "20", 67500),
        ("caller.py", "return FACTOR", "return 1 + FACTOR", 67501),
    ):
        edit(project / name, old, new)
        assert call(project)[:2] == (value, False), name
    edit(project / "caller.py", "return 1 + FACTOR", "return FACTOR")
    assert call(project)[:2] == (67500, True)


def test_an_edit_of_a_kernel_that_is_an_argument_is_seen(project, run):
    assert run(CALL_GIVEN, project) == ["50.0 0.0", "0"]
    assert run(CALL_GIVEN, project) == ["50.0 0.0", "2"]
    edit(project / "term.py", "data[0] * x", "data[0] + x")
    assert run(CALL_GIVEN, project) == ["25.0 0.0", "1"]


def test_where_the_package_cannot_be_written_the_cache_of_the_user_serves(project, call):
    (project / "__pycache__").write_text("a file, so that no folder can be made")
    user = project / "user"
    _, _, place = call(project, XDG_CACHE_HOME=str(user), HOME=str(user), LOCALAPPDATA=str(user))
    assert place.is_relative_to(user)
    assert call(project, XDG_CACHE_HOME=str(user), HOME=str(user), LOCALAPPDATA=str(user))[1]


def test_no_file_takes_a_decorator_from_numba_itself():
    wrapper = "reference_sim/kernels/kernel_cache.py"
    wrong = []
    for layer in ("reference_sim", "snug", "benchmarks", "reports"):
        for path in (ROOT / layer).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            if "numba" not in text:
                continue
            tree = ast.parse(text)
            named = {
                alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names
            }
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom):
                    named |= {f"{node.module}.{alias.name}" for alias in node.names}
            named -= {"numba.types", "numba.extending.intrinsic", "numba.extending.overload"}
            named -= {"numba.core.event.install_recorder"}
            if any(name.split(".")[0] == "numba" for name in named):
                wrong.append(path.relative_to(ROOT).as_posix())
    assert wrong == [wrapper]
