"""From a trajectory to rows: what is judged, what is not finite, what may fail, and the closing table."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from benchmarks.cell import Outcome, frames_computed, judge
from benchmarks.clock import Reading
from benchmarks.closing import remarks, summary
from benchmarks.named_metrics import UNITS, unit_of
from benchmarks.record import Record
from benchmarks.stages import accepted

from benchmarks import provenance
from benchmarks.methods import METHODS
from benchmarks.plan import Cell, Plan
from benchmarks.presets import find_preset
from benchmarks.results import NOT_FALLING, Row
from benchmarks.rows import model_costs, rows_of
from benchmarks.scenes import SMALL_SCENES, dressed_scene
from benchmarks.validation.registry import KNOWN_ANSWERS
from reference_sim import Trajectory

SHEET = SMALL_SCENES[0]


def trajectory(frames=4, **changes) -> Trajectory:
    values = {
        "positions": np.zeros((frames, 3, 3)), "faces": np.array([[0, 1, 2]]),
        "times": np.arange(frames) / 30,
        "frame_seconds": np.r_[0.0, np.full(frames - 1, 0.002)], "status": "converged",
    }  # fmt: skip
    return Trajectory(**(values | changes))


@dataclasses.dataclass
class FourFrames:
    frames: int = 4


def test_a_trajectory_is_judged_by_what_is_in_it():
    def judged(cut_short=False, **changes):
        return judge(trajectory(**changes), Reading(1.0), FourFrames(), cut_short=cut_short)

    assert judged() == ("ok", "")
    assert judged(status="max_iterations", cut_short=True) == ("ok", "")
    assert judged(status="max_iterations", reason="frame 2: gave up")[0] == "stalled"
    assert judged(frames=2)[0] == "diverged"
    assert judged(positions=np.full((4, 3, 3), np.nan))[0] == "diverged"
    assert judged(status="fine")[0] == "failed"
    stalled = judged(
        status="stalled", reason="frame 2: x", frame_fields={"converged": np.array([1, 1, 0, 0.0])}
    )
    assert stalled == ("stalled", "2 of 4 frames did not converge; first frame 2: x")


def test_a_time_that_cannot_be_believed_fails_the_cell():
    status, reason = judge(trajectory(), Reading(1.0, "it went on"), FourFrames(), cut_short=False)
    assert status == "failed" and "it went on" in reason


def test_a_first_frame_that_was_given_does_not_count():
    assert frames_computed(trajectory()) == 3
    assert frames_computed(trajectory(frame_seconds=np.r_[np.nan, np.ones(3)])) == 3
    assert frames_computed(trajectory(frame_seconds=np.full(4, 0.1))) == 4


def test_rows_of_a_cell_stand_in_each_suite_and_tell_what_is_not_finite():
    cell = Cell(SHEET, "newton-1", 0, ("garments", "speed"))
    rows = rows_of(Outcome(cell, "ok", recorded=True), {"energy/strain": 1.0, "distance/rms": np.nan})
    assert [row.suite for row in rows] == ["garments", "garments", "speed", "speed"]
    assert {row.dtype for row in rows} == {"float64"}
    skinned = rows_of(Outcome(Cell(SHEET, "skinning", 0, ("speed",)), "ok"), {"energy/strain": 1.0})
    assert skinned[0].dtype == "float32"
    assert rows[0].value == 1.0 and rows[0].unit == "J" and rows[0].status == "ok"
    assert rows[1].value is None and rows[1].status == "failed" and "finite" in rows[1].reason
    skipped = rows_of(Outcome(cell, "skipped", "why"), {})
    assert [(row.status, row.reason, row.value) for row in skipped] == [("skipped", "why", None)] * 2


def test_every_unit_is_known():
    assert unit_of("energy/strain") == "J" and unit_of("penetration/depth_p99") == "mm"
    assert set(UNITS.values()) == {"J", "1/m", "mm", "%", "ms", "s", "MB", "m", "1", "deg", "frames"}
    with pytest.raises(KeyError):
        unit_of("nonsense/x")


def test_an_extreme_case_may_fail_honestly_and_nothing_else_may():
    def row(suite, status, reason="why"):
        return Row(suite, "s", "m", 0, "x", "1", None, status, reason)

    assert accepted(row("extremes", "stalled")) and accepted(row("garments", "skipped"))
    assert not accepted(row("extremes", "failed")) and not accepted(row("garments", "stalled"))
    assert not accepted(row("extremes", "stalled", ""))


def test_networks_skip_scenes_without_a_body_and_solvers_skip_nothing():
    for entry in (entry for entry in METHODS if entry.package is None):
        reason = entry.skip(SHEET)
        assert bool(reason) == entry.needs_body and entry.skip(dressed_scene("walk")) is None


def test_the_closing_table_shows_a_dash_for_what_is_not_there():
    rows = [
        Row("garments", "dressed/a", "snug", 0, "energy/total", "J", 1.0),
        Row("garments", "dressed/b", "snug", 0, "energy/total", "J", 3.0),
        Row("garments", "dressed/a", "pbns", 0, "cost/frame", "ms", None, "failed", "why"),
        Row("validation", "c", "simulation", 0, "check", "1", 0.0),
    ]
    text = summary(rows, [{"name": "cells", "seconds": 3.2}])
    lines = text.splitlines()
    assert "mean of 2 scenes" in lines[0] and lines[1].split() == ["snug", "2", "ok"]
    assert lines[2].split() == ["pbns", "-", "failed"]
    assert "validation: 1 ok" in text and "cells 3 s" in text


def test_the_closing_table_keeps_garments_apart_and_marks_means_over_less():
    rows = [
        Row("garments", scene, method, 0, "energy/total", "J", value)
        for scene, method, value in (
            ("dressed/a", "snug", 1.0), ("dressed/b", "snug", 3.0), ("dressed/a", "pbns", 5.0),
            ("tunic/a", "snug", 9.0),
        )
    ]  # fmt: skip
    rows.append(Row("garments", "dressed/b", "pbns", 0, "cost/frame", "ms", None, "diverged", "why"))
    lines = summary(rows, []).splitlines()
    assert "garments, dressed, mean of 2 scenes" in lines[0] and lines[1].split() == ["snug", "2", "ok"]
    assert lines[2].split() == ["pbns", "5*", "ok,", "diverged"] and lines[3].startswith("* over fewer")
    assert "garments, tunic, mean of 1 scene " in lines[5] and lines[6].split() == ["snug", "9", "ok"]


def test_a_check_that_is_off_or_raises_is_a_failed_row(monkeypatch):
    check = KNOWN_ANSWERS[0]
    off = dataclasses.replace(check, expected=1.0).run()
    assert off.status == "failed" and off.value is not None and check.reason in off.reason
    broken = dataclasses.replace(check, function="nothing").run()
    assert broken.status == "failed" and broken.value is None and "nothing" in broken.reason


def test_the_remarks_name_repeats_that_lie_apart_gaps_that_rise_and_what_is_out_of_date():
    base = Row("speed", "flag", "newton-1", 0, "cost/spread", "%", 12.0)
    late = dataclasses.replace(base, method="lbfgs-5", value=31.0, status="stalled", reason="2 of 4 frames")
    tight = dataclasses.replace(base, status="stalled", reason="2 of 4 frames")
    gap = dataclasses.replace(base, method="vbd-20", metric="gap/relative", reason=f"{NOT_FALLING}: so")
    said = remarks([tight, late, gap], 3, {"flag x snug": "preset"})
    assert [line for line in said if "flag x newton-1" in line] == [] and len(said) == 4
    assert said[0].startswith("3 results") and said[1] == "flag x snug: kept though preset changed"
    assert said[2].endswith("flag x lbfgs-5 (31 %)") and said[3].endswith("flag x vbd-20")
    assert remarks([base], 0, {}) == []


def test_the_accelerator_is_on_the_rows_of_training_alone(tmp_path, monkeypatch):
    facts = {"processor": "a processor", "cores": 2, "device": "cuda", "accelerator": "a GPU"}
    monkeypatch.setattr(provenance, "hardware", lambda device: facts)
    record = Record(
        Plan(preset=find_preset("smoke"), suites=(), cells=(), checks=(), cases=(), train=(), test=(),
             seeds=(0,), device="cuda", folder=tmp_path, command="")
    )  # fmt: skip
    metrics = ("cost/train", "cost/frame")
    record.rows = [Row("garments", "dressed/kick", "snug", 0, metric, "s", 1.0) for metric in metrics]
    record.write_rows()
    found = {row.metric: row.hardware for row in record.folder.read_rows()}
    assert found == {"cost/train": "a GPU, a processor (2 cores)", "cost/frame": "a processor (2 cores)"}


def test_what_a_network_has_cost_is_read_from_records_of_any_version():
    record = {"seconds": 120.0, "megabytes": 9.0, "long_gone": 1}
    assert model_costs("snug", record, 7.0) == {"cost/data": 0.0, "cost/train": 120.0, "cost/memory": 9.0}
    whole = model_costs("supervised", record | {"setup_seconds": 20.0}, 7.0)
    assert whole["cost/data"] == 7.0 and whole["cost/setup"] == 20.0
    assert "cost/data" not in model_costs("supervised", record, None)
    assert model_costs(None, record, 7.0) == model_costs("snug", None, 7.0) == {}
