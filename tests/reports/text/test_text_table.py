"""Tables as text: one number a cell, intervals in columns of their own."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.metric import Metric
from benchmarks.results.row import Row
from reports.finished_run import make_run
from reports.statistics.effects import EXCESS, Effect
from reports.statistics.means_and_spreads import Mean
from reports.tables.table import METHOD, Column, Table, metric_column
from reports.text.text_table import remarks_on, text_rows
from tests.reports.report_folder import DECLARED

RUN = make_run({"methods": DECLARED}, [Row("garments", "a/b", "snug", 0, "energy/total", "J", 1.0)])


def small_table() -> Table:
    effect = Effect(value=1.5, scale=EXCESS, second=0.0, error=0.2, motions=20)
    mean = Mean(value=0.25, spread=0.01, seeds=3, asked=0)
    columns = (METHOD, Column("excess", "Excess", "%"), Column("total", "Total", "J"), Column("none", "None"))
    return Table("t", columns, (("snug", effect, mean, None), ("skinning", None, None, None)))


def test_an_interval_has_a_column_of_its_own_and_empty_columns_are_left_out():
    head, snug, skinning = text_rows(RUN, small_table())
    assert head == ["Method", "Excess [%]", "Interval", "Total [J]"]
    assert snug[0] == "SNUG" and " to " in snug[2] and "±" not in snug[3] and snug[3] == "0.250"
    assert skinning == ["skinning", "–", "–", "–"]


def test_a_mean_over_fewer_roll_outs_is_marked_and_the_mark_explained():
    fewer = replace(small_table(), rows=(("snug", None, Mean(0.25, None, seeds=3, asked=3), None),))
    rows = text_rows(RUN, fewer)
    assert rows[1] == ["SNUG", "0.250*"]
    assert remarks_on(rows).startswith("* A mean over fewer") and remarks_on(rows[:1]) == ""


def test_an_amplitude_of_rounding_alone_is_printed_as_zero():
    amplitude = metric_column(
        Metric(name="dynamics/amplitude", unit="1", title="Hem amplitude", definition="")
    )
    means = (
        Mean(2.15e-6, None, seeds=1, asked=0),
        Mean(-3e-6, None, seeds=1, asked=0),
        Mean(0.0926, None, seeds=1, asked=0),
    )
    rows = text_rows(RUN, Table("t", (amplitude,), tuple((mean,) for mean in means)))
    assert [row[0] for row in rows] == ["Hem amplitude", "0", "0", "0.0926"]
