"""Faults planted in the physics, one line each: the validation suite has to notice every one of them.

Each fault goes into a copy of the packages in a temporary folder, whose checks run in a process of their
own. `pytest -m slow -s tests/project/test_mutations.py` prints the table of faults and of what caught
them.
"""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from benchmarks.validation.registry import KNOWN_ANSWERS
from tests.project.faults import FAULTS, Fault
from tests.project.metric_faults import METRIC_FAULTS
from tests.project.witnesses import WITNESSES

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("reference_sim", "snug", "benchmarks")
ENOUGH = 2  # checks that fail before the others are left out
OF_METRICS = [(file, fault) for file, faults in METRIC_FAULTS.items() for fault in faults]
PYTEST = "-x -q -p no:xdist -p no:cacheprovider -o addopts=--import-mode=importlib --rootdir"
RUNNER = """
import json, sys
from benchmarks.validation.registry import KNOWN_ANSWERS
names, enough = json.loads(sys.argv[1]), int(sys.argv[2])
caught, ran = [], 0
for case in KNOWN_ANSWERS:
    if case.name in names if names else case.smoke:
        ran += 1
        row = case.run()
        if row.status != "ok":
            caught.append([case.name, row.reason])
        if len(caught) == enough:
            break
print(json.dumps([ran, caught]))
"""


@cache
def sources() -> dict[str, str]:
    """File of the packages -> its text."""
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def place_of(fault: Fault) -> tuple[str, int, int]:
    """Return the file of the one definition that a fault means, and where its lines begin and end there."""
    places = []
    for name, source in sources().items():
        nodes: list = [ast.parse(source)] if fault.right in source else []
        for part in fault.definition.split("."):
            nodes = [child for node in nodes for child in node.body if part in names_of(child)]
        lines = source.splitlines(keepends=True)
        extents = [(node.lineno - 1, node.end_lineno) for node in nodes]
        places += [(name, *extent) for extent in extents if fault.right in "".join(lines[slice(*extent)])]
    assert len(places) == 1, f"{fault.title}: {fault.definition} with {fault.right!r} is in {places}"
    return places[0]


def names_of(statement: ast.stmt) -> list[str]:
    """Return what a statement defines: a function, a class, or the names that it gives a value."""
    if isinstance(statement, ast.Assign | ast.AnnAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        return [target.id for target in targets if isinstance(target, ast.Name)]
    return [getattr(statement, "name", "")]


def planted(fault: Fault | None, folder: Path) -> Path:
    """A copy of the packages, compiled kernels included, with the fault in it; no check needs a network."""
    left_out = shutil.ignore_patterns("*.tmp*", "*.safetensors")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=left_out)
    if fault is not None:
        name, first, last = place_of(fault)
        lines = sources()[name].splitlines(keepends=True)
        definition = "".join(lines[first:last]).replace(fault.right, fault.wrong, 1)
        (folder / name).write_text("".join([*lines[:first], definition, *lines[last:]]), encoding="utf-8")
    return folder


def run(copy: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in the copy, whose packages come first. Raises TimeoutExpired after 300 s."""
    environment = os.environ | {"PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=copy, env=environment, capture_output=True, text=True,
        timeout=300, check=False,
    )  # fmt: skip


def outcome(copy: Path, names: tuple[str, ...] = (), enough: int = ENOUGH) -> tuple[int, list[list[str]]]:
    """Run the checks in the copy; return how many ran, and those that failed with their reasons."""
    try:
        ended = run(copy, "-c", RUNNER, json.dumps(names), str(enough))
    except subprocess.TimeoutExpired:
        return 0, [["-", "no end within 300 s"]]
    assert ended.returncode == 0, ended.stderr
    ran, caught = json.loads(ended.stdout.splitlines()[-1])
    return ran, caught


@pytest.mark.slow
def test_nothing_is_caught_where_nothing_is_planted(tmp_path):
    ran, caught = outcome(planted(None, tmp_path))
    assert ran >= 30 and caught == []


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.title)
def test_a_fault_is_caught(fault, tmp_path):
    _, caught = outcome(planted(fault, tmp_path))
    print(f"\n{fault.title:45s} {fault.definition:32s} {', '.join(name for name, _ in caught)}")
    assert caught, f"{fault.title}: the validation suite does not notice"


@pytest.mark.slow
@pytest.mark.parametrize("title", WITNESSES)
def test_a_check_fails_where_it_should(title, tmp_path):
    fault = next(fault for fault in FAULTS if fault.title == title)
    _, caught = outcome(planted(fault, tmp_path), WITNESSES[title], len(KNOWN_ANSWERS))
    assert {name for name, _ in caught} == set(WITNESSES[title])


def test_there_are_enough_faults_and_the_line_of_each_is_in_one_definition():
    assert len({fault.title for fault in FAULTS}) == len(FAULTS) >= 20 and len(OF_METRICS) >= 12
    for fault in (*FAULTS, *(fault for _, fault in OF_METRICS)):
        assert place_of(fault) and fault.right != fault.wrong


def test_every_judged_check_has_a_fault_that_it_notices():
    witnessed = [name for names in WITNESSES.values() for name in names]
    assert sorted(witnessed) == sorted(case.name for case in KNOWN_ANSWERS if case.tolerance is not None)


@pytest.mark.parametrize("fault", [f for f in FAULTS if f.fast], ids=lambda fault: fault.title)
def test_a_fault_is_caught_by_the_check_made_for_it(fault, tmp_path):
    _, caught = outcome(planted(fault, tmp_path), fault.fast)
    assert [name for name, _ in caught] == list(fault.fast)


def notices(file: str, fault: Fault | None, folder: Path) -> bool:
    """Return whether a test of the file of that name fails on a copy with the fault."""
    copy = planted(fault, folder)
    shutil.copytree(ROOT / "tests", copy / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    (path,) = (copy / "tests").rglob(f"{file}.py")
    done = run(copy, "-m", "pytest", *PYTEST.split(), str(copy), str(path))
    assert done.returncode in (0, 1), done.stdout + done.stderr  # else nothing could be collected
    return done.returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "fault"), [*((file, None) for file in METRIC_FAULTS), *OF_METRICS], ids=str
)
def test_a_fault_of_a_metric_is_noticed_and_nothing_else(file, fault, tmp_path):
    assert notices(file, fault, tmp_path) == (fault is not None)
