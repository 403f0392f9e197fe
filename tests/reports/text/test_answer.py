"""Page one in a terminal."""

from __future__ import annotations

from reports.tables import make_tables
from reports.text.text_table import MOST_METHODS, answer
from tests.reports.report_folder import row, run_of

TOTALS = {
    "simulation": 1.0,
    "skinning": 9.0,
    "snug": 2.0,
    "supervised": 30.0,
    "pbns": 3.0,
    "snug+cleanup": 1.5,
}


def test_the_answer_is_a_table_of_few_methods_and_one_line_below():
    totals = TOTALS | {"another": 4.0}
    rows = [
        row(scene, method, "energy/total", value * size)
        for scene, size in (("tshirt/a", 1.0), ("tshirt/b", 2.0), ("tshirt/c", 3.0))
        for method, value in totals.items()
    ]
    run = run_of(rows)
    head, *lines, last = answer(run, make_tables(run)).splitlines()
    assert head.split()[:3] == ["Method", "Relative", "excess"] and len(lines) == MOST_METHODS
    assert not [line for line in lines if line.startswith("SNUG, cleaned up")]
    assert last.startswith(
        "On 3 unseen motions the relative excess is: SNUG 12 % (pooled 12 %) and PBNS 25 %"
    )
    assert last.endswith("The report also has SNUG, cleaned up.")
