"""Means, tables, numbers and the page of the report: as the rows say, dashes where there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from reports.blocks import BLOCKS
from reports.pdf import lay_out_table
from reports.statistics.means_and_spreads import Mean, mean_of, pair
from reports.tables import make_tables
from reports.tables.paper_tables import CURVATURE, paper_tables
from reports.tables.pivots import shapes
from tests.reports.report_folder import SCENES, row, run_of


def column(table, name):
    return [column.name for column in table.columns].index(name)


def test_mean_and_spread_over_seeds():
    rows = [row(scene, seed=s, value=v) for scene in SCENES for s, v in ((0, 1.0), (1, 3.0), (2, 8.0))]
    mean = mean_of(run_of(rows).frame, "snug", "energy/strain")
    assert mean == Mean(4.0, pytest.approx(np.std([1, 3, 8], ddof=1)), seeds=3, full_count=6)
    assert dict(mean.cells) == {(scene, s): v for scene in SCENES for s, v in enumerate((1.0, 3.0, 8.0))}
    assert mean_of(run_of(rows[:1]).frame, "snug", "energy/strain").spread is None
    equal = [row(seed=seed, value=2.679144) for seed in range(3)]  # whose mean is another number
    assert mean_of(run_of(equal).frame, "snug", "energy/strain").spread == 0.0
    assert mean_of(run_of(rows).frame, "snug", "energy/bending") is None


def test_the_mean_is_over_scenes_first():
    """One seed has one scene of two: it weighs as much as the other."""
    rows = [row(SCENES[0], value=1.0), row(SCENES[1], value=3.0), row(SCENES[0], value=8.0, seed=1)]
    mean = mean_of(run_of(rows).frame, "snug", "energy/strain")
    assert mean.value == 5.0 and not mean.complete and mean.fewer == " (3 of 4 roll-outs)"


def test_a_failed_cell_enters_no_mean_and_the_table_says_so():
    rows = [
        row("tshirt/walk", value=1.0),
        row("tshirt/jump", value=100.0, status="failed", reason="x"),
        row("tshirt/walk", "simulation", value=4.0, status="stalled", reason="2 frames"),
        row("tshirt/jump", "simulation", value=6.0),
    ]
    run = run_of(rows)
    table = make_tables(run)["energies"]
    lines = {line[1]: line[2] for line in table.rows}
    snug, reference = lines["snug"], lines["simulation"]
    assert snug.value == 1.0 and not snug.complete
    assert reference.value == 5.0 and reference.complete and reference.stalled
    block = lay_out_table(run, table)
    assert [line[1]["mark"] for line in block["groups"][0]["rows"]] == ["†", "*"]
    assert "fewer scenes" in block["note"] and "unconverged" in block["note"]


def test_a_check_that_must_be_exact_is_no_tolerances_away_or_infinitely_many():
    numbers_of = {"suite": "validation", "method": "simulation", "metric": "check", "expected": 6.0}
    rows = [
        row("exact", value=6.0, tolerance=0.0, **numbers_of),
        row("near", value=6.5, tolerance=2.0, **numbers_of),
    ]
    rows += [row("off", value=7.0, tolerance=0.0, **numbers_of), row("told", value=7.0, **numbers_of)]
    table = make_tables(run_of(rows))["validation"]
    assert [line[column(table, "away")] for line in table.rows] == [0.0, 0.25, float("inf"), None]
    block = lay_out_table(run_of(rows), table)
    assert block["groups"][0]["rows"][2][column(table, "away")]["text"] == "∞"


def on_two_scenes(method, *values, metric="energy/total"):
    return [row(scene, method, metric, value) for scene, value in zip(SCENES, values)]


def test_pairs_share_their_scenes_or_have_their_own():
    rows = [*on_two_scenes("snug", 1.0, 9.0), row(SCENES[1], "pbns", "energy/total", 4.0)]
    mean, other = pair(run_of(rows).frame, "snug", "pbns", "energy/total")
    assert (mean.value, other.value, mean.complete) == (9.0, 4.0, False)
    apart = [row(SCENES[0], metric="energy/total"), row(SCENES[1], "pbns", "energy/total")]
    assert pair(run_of(apart).frame, "snug", "pbns", "energy/total") == (None, None)
    assert pair(run_of(rows[:2]).frame, "snug", "pbns", "energy/total")[0].value == 5.0


@pytest.mark.parametrize(
    ("norm", "bodies"), [(1.0, ["other shapes"]), (0.0, ["other shapes", "mean shape"])]
)
def test_the_mean_body_has_lines_and_words_where_there_is_one(norm, bodies):
    rows = [row(scene, metric="energy/strain", suite="shapes") for scene in SCENES]
    rows += [row(s, metric="body/shape", value=x, suite="shapes") for s, x in zip(SCENES, (norm, 2.0))]
    (table,) = shapes(run_of(rows))
    assert [line[0] for line in table.rows] == bodies
    assert ("mean body" in table.caption) == ("mean shape" in bodies)


# frames and energy of each motion
MOTIONS = {"01_01_a": (3, 1.0), "07_02": (1, 5.0), "kick": (4, 10.0), "turn": (9, 99.0)}
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
    tables = paper_tables(replace(run_of(rows), frame_energies=frames))
    one, two = (table.rows for table in tables)
    clips = "01_01 and 07_02"
    assert one[0] == (clips, "strain", 4.0, 0.111, 2.0, 0.064, 0.5, pytest.approx(0.064 / 0.111))
    assert one[2][-2:] == (None, None)  # gravity: its zero is a choice
    assert one[4][:5:4] == ("all motions (3)", (1.0 * 3 + 5.0 + 10.0 * 4) / 8)
    assert two[0] == (clips, "full loss", 2.0, 1.0, 2.0, 2.0, 2.7, 1.0)
    assert two[1] == (clips, "without strain", 14.0, 7.0, 14.0, 14.0, 19.1, 19.1 / 2.7)
    assert two[2][2:] == (pytest.approx(0.2), None, pytest.approx(0.2), pytest.approx(0.2), None, None)
    alone = run_of([r for r in rows if r.method != "simulation-dt/4"])
    captions = tables[1].caption, paper_tables(replace(alone, frame_energies=frames))[1].caption
    assert ["Below: the reference" in caption for caption in captions] == [True, False]
    full = [r for r in rows if r.method != "snug-paper-no-strain"]
    assert len(paper_tables(replace(run_of(full), frame_energies=frames))) == 1
    heading = next(place for place, block in enumerate(BLOCKS) if isinstance(block, str))
    assert {table.name for table in tables} < {block.name for block in BLOCKS[:heading]}  # page one
