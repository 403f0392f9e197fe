"""Progress bar of long work, with the time left."""

from __future__ import annotations

import sys
from typing import Any

SECONDS_OF_A_LOG = 30.0  # between two lines; on a terminal the line is drawn ten times a second


def progress_bar(*args: Any, **options: Any) -> Any:
    """Return a bar of tqdm with these arguments, on stderr; a file gets a line every half minute."""
    from tqdm import tqdm

    seconds = 0.1 if sys.stderr.isatty() else SECONDS_OF_A_LOG
    return tqdm(*args, mininterval=seconds, maxinterval=max(10.0, seconds), **options)
