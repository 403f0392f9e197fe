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


def run(folder: Path, monkeypatch, *, slow: bool) -> dict:
    """Run the cells in one namespace, as Jupyter does, and return it; `slow` ones too."""
    monkeypatch.chdir(folder)
    matplotlib.use("Agg")
    cells = [cell for cell in CELLS if cell["cell_type"] == "code"]
    wanted = [cell for cell in cells if slow or "slow" not in cell["metadata"].get("tags", ())]
    code = "\n".join("".join(cell["source"]) for cell in wanted)
    for whole, part in SMALL.items():
        assert whole in code
        code = code.replace(whole, part)
    names: dict = {"__name__": "notebook"}
    exec(compile(code, str(NOTEBOOK), "exec"), names)
    matplotlib.pyplot.close("all")
    return names


def test_the_cells_run_and_snug_is_nearer_the_simulation_than_after_a_minute(
    tmp_path, monkeypatch, capsys
):
    names = run(tmp_path, monkeypatch, slow=False)
    energies = {name: values.mean() for name, values in names["energies"].items()}
    assert list(energies) == ["SNUG", "SNUG, a minute", "Simulation"]
    assert energies["Simulation"] < energies["SNUG"] < energies["SNUG, a minute"]
    assert names["simulated"].status == "converged" and len(names["figure"].axes) == 3
    assert capsys.readouterr().out.startswith("16000 steps on 34 motions, commit ")


@pytest.mark.slow
def test_the_scenes_own_score_runs_too(tmp_path, monkeypatch):
    scored = run(tmp_path, monkeypatch, slow=True)["scored"]
    assert scored["status"] == "ok" and scored["metrics"]["energy/total"]["unit"] == "J"


def test_each_cell_that_prints_or_plots_has_its_output_in_a_small_file():
    assert len([cell for cell in CELLS if cell.get("outputs")]) == 5
    assert NOTEBOOK.stat().st_size < 1e6 and '"error"' not in NOTEBOOK.read_text(encoding="utf-8")
