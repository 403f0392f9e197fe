"""The body of the package, loaded once for all tests below."""

import pytest

from snug.body.parametric_body import Body


@pytest.fixture(scope="session")
def body() -> Body:
    return Body.load()
