"""Garbage: what is loaded when the tests begin is none, and no collection need look at it."""

import gc


def pytest_collection_finish() -> None:
    """Leave modules and tests out of all collections: each timed run of a method begins with one."""
    gc.collect()
    gc.freeze()
