"""Pictures of few dots for all tests below: what they show is tested, not how sharp it is."""

import pytest

from reports import pictures
from reports.figures import plotting

DOTS = 40  # of a picture in an inch; 200 in a report


@pytest.fixture(scope="session", autouse=True)
def few_dots():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "DOTS", DOTS)
        patch.setattr(plotting, "DOTS", DOTS)
        yield
