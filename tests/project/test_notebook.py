"""The notebook of the first steps: its cells run in their order, with few frames and few steps."""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib
import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOK = ROOT / "docs" / "first-steps.ipynb"
SMALL = {
    "FRAMES = 60": "FRAMES = 4",
    "STEPS = 600": "STEPS = 2",
    'make_motion("walk")': 'make_motion("walk").cut(0, 8)',
}
CELLS = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]


def sources(*, slow: bool) -> list[str]:
    """Return the code of the cells; of those marked as slow only where they are asked for."""
    code = [cell for cell in CELLS if cell["cell_type"] == "code"]
    return [
        "".join(cell["source"]) for cell in code if slow or "slow" not in cell["metadata"].get("tags", ())
    ]


def run(cells: list[str], changes: dict[str, str]) -> dict:
    """Run the cells in one namespace, which a front end of Jupyter does too; return the namespace."""
    code = "\n".join(cells)
    for whole, part in changes.items():
        assert whole in code
        code = code.replace(whole, part)
    names: dict = {"__name__": "notebook"}
    exec(compile(code, str(NOTEBOOK), "exec"), names)
    return names


@pytest.fixture(autouse=True)
def without_a_screen():
    before = matplotlib.get_backend()
    matplotlib.use("Agg")
    yield
    matplotlib.pyplot.close("all")
    matplotlib.use(before)


def test_the_cells_run_and_the_trained_network_is_nearer_the_simulation_than_a_brief_training(capsys):
    names = run(sources(slow=False), SMALL)
    energies = {name: values.mean() for name, values in names["energies"].items()}
    assert list(energies) == ["SNUG", "SNUG, a minute", "Simulation"]
    assert energies["Simulation"] < energies["SNUG"] < energies["SNUG, a minute"]
    assert names["simulated"].status == "converged" and len(names["figure"].axes) == 3
    assert capsys.readouterr().out.startswith("5300 steps on 34 motions, commit ")


@pytest.mark.slow
def test_the_scenes_own_score_runs_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = run(sources(slow=True), SMALL)
    assert names["scored"]["status"] == "ok" and names["scored"]["metrics"]["energy/total"]["unit"] == "J"


def test_no_output_is_stored_that_could_grow_stale():
    assert all(not cell.get("outputs") for cell in CELLS)
