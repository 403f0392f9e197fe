"""The folder of a run, for tests of what runs tasks."""

import pytest

from benchmarks.results.run_folder import RunFolder


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "run").mkdir()
    return RunFolder(tmp_path / "run")
