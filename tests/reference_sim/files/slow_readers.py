"""Readers of files that take long, for trials."""

import time


def spin(path):
    """Read without end."""
    while True:
        pass


def wait(path):
    """Take long by the clock, and no CPU time, as all do on a busy machine."""
    time.sleep(1.5)
