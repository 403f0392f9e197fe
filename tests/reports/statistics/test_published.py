"""A run of the default preset beside what was published."""

from __future__ import annotations

from dataclasses import replace

import pytest

from reports.finished_run import Run
from reports.statistics import outcomes
from reports.statistics.outcomes import DEFAULT, published_beside
from tests.reports import report_folder
from tests.reports.report_folder import row

SCENES = ("tshirt/a", "tshirt/b", "tshirt/c")


def run_of(
    shares: dict[int, float], scenes: tuple[str, ...] = SCENES, started: str = "now", hard: str = "", **config
) -> Run:
    """Return a run in which SNUG leaves so many % with each seed, the reference has 1 J and skinning 2.

    hard: a scene with ten times as many.
    """
    rows = [
        row(scene, method, "energy/total", value, seed=seed)
        for scene in scenes
        for method, seed, value in (
            ("simulation", 0, 1.0),
            ("skinning", 0, 2.0),
            *(("snug", k, 1.0 + share * (10 if scene == hard else 1) / 100) for k, share in shares.items()),
        )
    ]
    return report_folder.run_of(rows, **{"preset": DEFAULT, "started": started, **config})


@pytest.fixture
def publish(monkeypatch, tmp_path):
    def made(run: Run) -> None:
        (tmp_path / DEFAULT).mkdir()
        monkeypatch.setattr(outcomes, "PUBLISHED", tmp_path)
        monkeypatch.setattr(outcomes, "read_published", lambda folder: run)

    return made


def test_a_seed_among_those_published_is_reproduced_and_one_far_off_is_not(publish):
    publish(run_of({0: 5.0, 1: 5.5, 2: 6.0}, (*SCENES, "tshirt/d"), started="before"))
    assert published_beside(run_of({0: 5.2}), "snug") == "published 5.5 % on these motions: reproduced"
    assert published_beside(run_of({0: 12.0}), "snug").endswith(": not reproduced")


def test_segments_of_a_recording_count_as_one_motion(publish):
    scenes = ("tshirt/01_01_a", "tshirt/01_01_b", "tshirt/01_01_c", "tshirt/kick")
    publish(run_of({0: 5.0, 1: 5.0}, scenes, started="before", hard="tshirt/kick"))
    note = published_beside(run_of({0: 5.0}, scenes, hard="tshirt/kick"), "snug")
    assert note == "published 16 % on these motions: reproduced"  # between 5 and 50 on a scale of logarithms


def test_nothing_stands_beside_another_preset_the_published_run_itself_or_motions_of_ones_own(publish):
    publish(run_of({0: 5.0, 1: 5.5}, started="before"))
    assert published_beside(run_of({0: 5.2}, preset="smoke"), "snug") == ""
    assert published_beside(run_of({0: 5.2}, started="before"), "snug") == ""
    assert published_beside(run_of({0: 5.2}, ("tshirt/a", "tshirt/mine")), "snug") == ""
    assert published_beside(run_of({0: 5.2}), "pbns") == ""
    own = run_of({0: 5.2})  # say, beside a reference whose cloth does not cross itself
    own = replace(own, frame=own.frame.assign(protocol="own"))
    assert published_beside(own, "snug") == ""
