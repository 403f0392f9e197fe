"""The table of metrics: every declared metric has one row, alone or with its family."""

from __future__ import annotations

from fnmatch import fnmatchcase

from benchmarks.metrics import declared, find_metric
from reports.text.metric_families import FAMILIES, family_of, family_rows


def test_every_metric_has_a_row_and_every_family_a_metric():
    rows = [name.strip("`") for name, _, _ in family_rows(declared().values())]
    assert len(rows) == len(set(rows))
    assert not [name for name in declared() if not any(fnmatchcase(name, row) for row in rows)]
    assert set(FAMILIES) == {family_of(name) for name in declared()} - {""}


def test_a_family_has_one_row_with_all_its_units_and_others_their_declared_definition():
    metrics = [find_metric(name) for name in ("roll_out/first", "distance/rms", "roll_out/drift")]
    assert family_rows(metrics) == [
        ("`roll_out/*`", "J, mm", FAMILIES["roll_out/*"]),
        ("`distance/rms`", "mm", find_metric("distance/rms").definition),
    ]


def test_all_units_of_a_family_are_listed():
    rows = {name: unit for name, unit, _ in family_rows(declared().values())}
    assert rows["`time_error/*`"] == "1/m, 1, J"


def test_errors_of_wrinkles_are_no_amplitudes_and_frames_are_not_the_inference_time():
    assert family_of("wrinkles/error_under_100") == "wrinkles/error_*"
    assert family_of("wrinkles/under_100") == "wrinkles/*"
    assert (family_of("cost/frame"), family_of("cost/frame_p95")) == ("cost/frame", "cost/frame_*")
