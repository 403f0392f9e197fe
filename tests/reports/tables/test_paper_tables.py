"""Tables 1 and 2 beside the paper's: means over frames, on its own clips and on all motions, and ratios."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from reports.blocks import BLOCKS, Heading
from reports.tables.paper_tables import paper_tables
from tests.reports.report_folder import row, run_of

FRAMES = {"01_01_a": 3, "07_02": 1, "kick": 4, "turn": 9}  # the last one is not PBNS's
ENERGIES = {"01_01_a": 1.0, "07_02": 5.0, "kick": 10.0, "turn": 99.0}  # of SNUG [J]
METHODS = {"snug-paper": 1.0, "snug-paper-no-strain": 7.0, "simulation-perturbed-1e-4": 0.1}


def tables():
    rows = []
    for motion, energy in ENERGIES.items():
        for term in ("strain", "bending", "gravity", "inertia"):
            rows.append(row(f"tshirt/{motion}", "snug-paper", f"energy/{term}", energy))
            if motion != "turn":
                rows.append(row(f"tshirt/{motion}", "pbns-paper", f"energy/{term}", 2.0 * energy))
        for name in ("histogram", "mean_difference", "error"):
            rows += [
                row(f"tshirt/{motion}", m, f"curvature/{name}", f * energy) for m, f in METHODS.items()
            ]
    frames = [(f"tshirt/{motion}", k) for motion, count in FRAMES.items() for k in range(count)]
    frames = pd.DataFrame(frames, columns=["scene", "seconds"])
    return {made.name: made.rows for made in paper_tables(replace(run_of(rows), frame_energies=frames))}


def test_each_frame_weighs_the_same_on_the_papers_clips_and_on_all_motions():
    made = tables()
    assert list(made) == ["paper_table_1", "paper_table_2"]
    strain, _, gravity, _, of_all, *_ = made["paper_table_1"]
    assert strain == (
        "01_01 and 07_02",
        "strain",
        4.0,
        0.111,
        2.0,
        0.064,
        0.5,
        pytest.approx(0.064 / 0.111),
    )
    assert gravity[-2:] == (None, None)  # its zero is a choice
    assert of_all[0] == "all motions (3)" and of_all[4] == (1.0 * 3 + 5.0 + 10.0 * 4) / 8
    full, without, floor = made["paper_table_2"][:3]
    assert full[1:] == ("full loss", 2.0, 1.0, 2.0, 2.0, 2.7, 1.0)
    assert without[1:4] == ("without strain", 14.0, 7.0) and without[6:] == (19.1, 19.1 / 2.7)
    assert floor[2:] == (pytest.approx(0.2), None, pytest.approx(0.2), pytest.approx(0.2), None, None)


def test_they_stand_on_page_one_by_the_papers_recipe():
    first = [block.name for block in BLOCKS[: [isinstance(b, Heading) for b in BLOCKS].index(True)]]
    assert {"paper_table_1", "paper_table_2"} <= set(first) and "table_1" not in first
