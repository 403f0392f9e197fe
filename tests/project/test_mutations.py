"""Faults planted in the physics, one line each: the validation suite has to notice every one of them.

Each fault goes into a copy of the packages in a temporary folder, whose checks run in a process of their own.
`pytest -m slow -s tests/project/test_mutations.py` prints the table of faults and of what caught them.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
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


def planted(fault: Fault | None, folder: Path) -> Path:
    """A copy of the packages, compiled kernels included, with the fault in it; no check needs a network."""
    left_out = shutil.ignore_patterns("*.tmp*", "*.safetensors")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=left_out)
    if fault is not None:
        path = folder / fault.file
        source = path.read_text(encoding="utf-8")
        assert fault.right in source, f"{fault.title}: {fault.file} no longer holds {fault.right!r}"
        path.write_text(source.replace(fault.right, fault.wrong, 1), encoding="utf-8")
    return folder


def outcome(folder: Path, names: tuple[str, ...] = (), enough: int = ENOUGH) -> tuple[int, list[list[str]]]:
    """Run the checks in the copy; return how many ran, and those that failed with their reasons."""
    environment = os.environ | {"PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", RUNNER, json.dumps(names), str(enough)]
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
        )
    except subprocess.TimeoutExpired:
        return 0, [["-", "no end within 300 s"]]
    assert done.returncode == 0, done.stderr
    ran, caught = json.loads(done.stdout.splitlines()[-1])
    return ran, caught


@pytest.mark.slow
def test_nothing_is_caught_where_nothing_is_planted(tmp_path):
    ran, caught = outcome(planted(None, tmp_path))
    assert ran >= 30 and caught == []


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.title)
def test_a_fault_is_caught(fault, tmp_path):
    _, caught = outcome(planted(fault, tmp_path))
    print(f"\n{fault.title:45s} {fault.file:32s} {', '.join(name for name, _ in caught)}")
    assert caught, f"{fault.title}: the validation suite does not notice"


@pytest.mark.slow
@pytest.mark.parametrize("title", WITNESSES)
def test_a_check_fails_where_it_should(title, tmp_path):
    fault = next(fault for fault in FAULTS if fault.title == title)
    _, caught = outcome(planted(fault, tmp_path), WITNESSES[title], len(KNOWN_ANSWERS))
    assert {name for name, _ in caught} == set(WITNESSES[title])


@pytest.mark.parametrize(
    "fault", [*FAULTS, *(fault for _, fault in OF_METRICS)], ids=lambda fault: fault.title
)
def test_the_line_of_a_fault_is_in_its_file(fault):
    assert fault.right in (ROOT / fault.file).read_text(encoding="utf-8")


def test_every_judged_check_has_a_fault_that_it_notices():
    witnessed = [name for names in WITNESSES.values() for name in names]
    assert sorted(witnessed) == sorted(case.name for case in KNOWN_ANSWERS if case.tolerance is not None)


@pytest.mark.parametrize("fault", [f for f in FAULTS if f.fast], ids=lambda fault: fault.title)
def test_a_fault_is_caught_by_the_check_made_for_it(fault, tmp_path):
    _, caught = outcome(planted(fault, tmp_path), fault.fast)
    assert [name for name, _ in caught] == list(fault.fast)


def notices(file: str, fault: Fault | None, folder: Path) -> bool:
    """Return whether a test of tests/<file>.py fails on a copy with the fault."""
    copy = planted(fault, folder)
    shutil.copytree(ROOT / "tests", copy / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    environment = os.environ | {"PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1"}
    options = (
        "-x",
        "-q",
        "-p",
        "no:xdist",
        "-p",
        "no:cacheprovider",
        "-o",
        "addopts=--import-mode=importlib",
        "--rootdir",
        str(copy),
    )
    command = [sys.executable, "-m", "pytest", *options, f"tests/{file}.py"]
    done = subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr  # else nothing could be collected
    return done.returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize("file", METRIC_FAULTS)
def test_no_test_of_metrics_fails_where_nothing_is_planted(file, tmp_path):
    assert not notices(file, None, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("file", "fault"), OF_METRICS, ids=[fault.title for _, fault in OF_METRICS])
def test_a_fault_of_a_metric_is_noticed(file, fault, tmp_path):
    assert notices(file, fault, tmp_path), f"{fault.title}: tests/{file}.py does not notice"


def test_there_are_enough_faults():
    assert len({fault.title for fault in FAULTS}) == len(FAULTS) >= 20
    every = [*FAULTS, *(fault for _, fault in OF_METRICS)]
    assert len(OF_METRICS) >= 12 and all(fault.right != fault.wrong for fault in every)
