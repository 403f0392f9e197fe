"""Configuration of a run as its report lists it."""

from __future__ import annotations

from reports.document.configuration import configuration
from tests.reports.report_folder import row, run_of

MOTIONS = {
    "train tshirt": ["07_01"], "validation tshirt": ["06_02"], "test tshirt": ["kick", "walk"],
    "frames": {"07_01": 9, "06_02": 8, "kick": 5, "walk": 6},
}  # fmt: skip


def motions_of(*methods: str) -> str:
    run = run_of([row("tshirt/kick", method) for method in methods])
    return dict(configuration({"motions": MOTIONS}, run.frame))["Motions"]


def test_motions_are_those_of_the_rows_and_of_their_trainings():
    assert motions_of("simulation", "skinning") == "test tshirt kick; frames kick 5"
    trained = "train tshirt 07_01; validation tshirt 06_02; test tshirt kick; frames 07_01 9, 06_02 8, kick 5"
    assert motions_of("simulation", "snug") == trained


def test_a_run_without_motions_lists_none():
    run = run_of([row("flag", "simulation", garment="", motion="", part="")])
    assert not {"Motions"} & {name for name, _ in configuration({"motions": MOTIONS}, run.frame)}
    assert not {"Motions"} & {name for name, _ in configuration({}, run.frame)}
