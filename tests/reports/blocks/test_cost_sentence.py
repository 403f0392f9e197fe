"""Sentence of page one on cost: how fast the network is, and what beats it."""

from __future__ import annotations

import dataclasses

from reports.blocks import sentences
from tests.reports.report_folder import row as any_row
from tests.reports.report_folder import run_of
from tests.reports.speed_rows import SCENES, all_rows, cost_sentence, row


def test_run_times_on_page_one_are_of_the_garment_compared():
    rows = all_rows() + [row("skirt/stop", m, "cost/frame", 500.0, "ms") for m in ("snug", "simulation")]
    assert cost_sentence(run_of(rows)).startswith(
        "On one core SNUG takes 0.250 ms a frame, the simulation 400 times as long, in 2 scenes. Of the"
    )


def test_a_range_that_rounding_closes_is_one_number():
    rows = [
        dataclasses.replace(r, value=r.value * (1 + 1e-3 * seed), seed=seed) if r.method == "snug" else r
        for r in all_rows()
        for seed in ((0, 1) if r.method == "snug" else (0,))
    ]
    assert "the simulation 400 times as long, in 2 scenes." in cost_sentence(run_of(rows))


def test_only_a_rival_that_was_timed_in_all_scenes_and_is_nearer_is_named():
    numbers = {"snug": ("a", "b"), "pbns": ("a",)}
    rows = [
        any_row(scene, method, metric, value / (1 + (method == "pbns")), suite="speed")
        for method, scenes in numbers.items()
        for scene in scenes
        for metric, value in (("gap/energy", 2.0), ("cost/frame", 4.0))
    ]
    run = run_of(rows)
    frame = run.cells("speed", "garments")
    assert sentences._rivals(run, frame, ["a", "b"]) == []
    assert sentences._rivals(run, frame, ["a"])[0].startswith("PBNS is no slower")


def test_a_rival_within_the_uncertainty_of_the_reference_is_as_near():
    rows = [
        row(SCENES[0], method, metric, value, uncertainty=None if metric == "cost/frame" else 0.3)
        for method, time, error in (("snug", 1.0, 5.3), ("pbns", 0.5, 5.0), ("newton-1", 12.0, 1.0))
        for metric, value in (("cost/frame", time), ("gap/energy", error))
    ]
    rows += [row(SCENES[0], "simulation", "cost/frame", 100.0, "ms")]
    sentence = cost_sentence(run_of(rows))
    assert "PBNS is no slower and has an energy gap of 5.00 J, below the 5.30 J of SNUG, by less" in sentence
    sure = [dataclasses.replace(r, uncertainty=0.1 if r.uncertainty else None) for r in rows]
    assert "below the 5.30 J of SNUG." in cost_sentence(run_of(sure))
