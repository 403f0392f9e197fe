"""Commands and lists answer at once: what measures, learns or draws is loaded when there is work for it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROBE = """
import runpy, sys
del sys.argv[0]
try:
    runpy.run_module(sys.argv[0], run_name="__main__")
except SystemExit as end:
    assert not end.code, end.code
print("LOADED", *sys.modules)
"""
LIBRARIES = {"torch", "numba", "igl", "scipy", "pyvista"}
MEASURED = LIBRARIES | {"vtk", "vtkmodules", "pandas", "skfem", "matplotlib"}

# Command, a word of its answer, what must not be loaded.
LIGHT = [
    ("benchmarks.run --help", "examples:", MEASURED),
    ("benchmarks.run --list sheet", "hanging_sheet", MEASURED),
    ("benchmarks.run --dry-run", "tshirt/01_01_a", MEASURED),
    ("reference_sim.simulate --help", "--obstacle", {"torch", "numba", "igl", "meshio", "h5py"}),
    ("snug.check --help", "usage:", LIBRARIES | {"numpy"}),
    ("snug.train --help", "examples:", {"torch"}),
    ("reports.build --help", "usage:", MEASURED | {"numpy", "h5py", "typst", "reference_sim.cloth"}),
    ("benchmarks.results.run_folder", "", {"numpy", "torch", "pandas"}),
]


@pytest.mark.parametrize(("command", "answer", "heavy"), LIGHT)
def test_nothing_heavy_is_loaded_before_there_is_something_to_do(command, answer, heavy, tmp_path):
    process = subprocess.run(
        [sys.executable, "-c", PROBE, *command.split()],
        capture_output=True, text=True, timeout=120, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert process.returncode == 0 and process.stderr == "", process.stderr
    output, _, modules = process.stdout.rpartition("LOADED")
    loaded = set(modules.split())
    assert answer in output and "runpy" in loaded and loaded.isdisjoint(heavy), loaded & heavy
    assert list(tmp_path.iterdir()) == []
