"""Tables 1 and 2 beside the paper's: means over frames, on its own clips and on all motions, and ratios."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from reports.blocks import BLOCKS, Heading
from reports.tables.paper_tables import CURVATURE, paper_tables
from tests.reports.report_folder import row, run_of

MOTIONS = {"01_01_a": (3, 1.0), "07_02": (1, 5.0), "kick": (4, 10.0), "turn": (9, 99.0)}  # frames, energy
FACTORS = {"snug-paper": 1.0, "snug-paper-no-strain": 7.0, "pbns-paper": 2.0, "simulation-dt/4": 0.1}


def test_each_frame_weighs_the_same_on_the_papers_clips_and_on_all_motions():
    rows = [
        row(f"tshirt/{motion}", method, metric, factor * value)
        for motion, (_, value) in MOTIONS.items()
        for method, factor in FACTORS.items()
        for metric in ("energy/strain", "energy/gravity", *CURVATURE)
        if (motion, method) != ("turn", "pbns-paper")
    ]
    frames = [(f"tshirt/{motion}", k) for motion, (count, _) in MOTIONS.items() for k in range(count)]
    frames = pd.DataFrame(frames, columns=["scene", "seconds"])
    made = paper_tables(replace(run_of(rows), frame_energies=frames))
    one, two = (table.rows for table in made)
    clips = "01_01 and 07_02"
    assert one[0] == (clips, "strain", 4.0, 0.111, 2.0, 0.064, 0.5, pytest.approx(0.064 / 0.111))
    assert one[2][-2:] == (None, None)  # gravity: its zero is a choice
    assert one[4][:5:4] == ("all motions (3)", (1.0 * 3 + 5.0 + 10.0 * 4) / 8)
    assert two[0] == (clips, "full loss", 2.0, 1.0, 2.0, 2.0, 2.7, 1.0)
    assert two[1] == (clips, "without strain", 14.0, 7.0, 14.0, 14.0, 19.1, 19.1 / 2.7)
    assert two[2][2:] == (pytest.approx(0.2), None, pytest.approx(0.2), pytest.approx(0.2), None, None)
    heading = next(place for place, block in enumerate(BLOCKS) if isinstance(block, Heading))
    assert {table.name for table in made} < {block.name for block in BLOCKS[:heading]}  # page one
