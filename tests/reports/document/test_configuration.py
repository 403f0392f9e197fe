"""Configuration of a run as its report lists it."""

from __future__ import annotations

from reports.pdf import configuration
from tests.reports.report_folder import row, run_of

MOTIONS = {"train tshirt": ["07_01"], "test tshirt": ["kick", "walk"], "frames": {"07_01": 9, "kick": 5}}


def test_motions_are_those_of_the_rows():
    kick, flag = row("tshirt/kick"), row("flag", "simulation", garment="", motion="", part="")
    assert dict(configuration({"motions": MOTIONS}, run_of([kick, flag]).frame))["Motions"] == "kick"
    assert "Motions" not in dict(configuration({"motions": MOTIONS}, run_of([flag]).frame))
