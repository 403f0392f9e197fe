"""Trials of files: what ends one, and what does not."""

import pytest

from reference_sim.files import trial
from tests.reference_sim.files.slow_readers import spin, wait


@pytest.mark.skipif(trial.ENDLESS == -256, reason="the system caps no CPU time")
def test_a_trial_ends_with_its_cpu_time_and_not_with_that_of_the_clock(tmp_path, monkeypatch):
    monkeypatch.setattr(trial, "SECONDS", 1.0)
    monkeypatch.setattr(trial, "SPEED", 1e12)
    (tmp_path / "x").write_bytes(b"")
    assert trial.try_out(spin, tmp_path / "x") == "reading it does not end within 1 s"
    assert trial.try_out(wait, tmp_path / "x") == ""
    monkeypatch.setattr(trial, "PATIENCE", 1.0)
    assert trial.try_out(wait, tmp_path / "x") == "reading it does not end within 1 s"
