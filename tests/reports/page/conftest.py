"""The page that tests of this room look at."""

from __future__ import annotations

import pytest

from benchmarks.results.run_folder import RunFolder
from tests.reports.page.page_by_hand import make_folder, write


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> RunFolder:
    """The run, whose page is written."""
    run = make_folder(tmp_path_factory.mktemp("page"))
    write(run)
    return run
