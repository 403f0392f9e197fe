"""Progress of long work: a bar with the time left, and a line before kernels are compiled."""

from __future__ import annotations

import os
import sys
from itertools import chain
from pathlib import Path
from typing import Any

SECONDS_OF_A_LOG = 30.0  # between two lines; on a terminal the line is drawn ten times a second
BELIEVED = 120.0  # [s]: after so long the expected rate counts as much as the measured one,
BELIEVED_SHARE = 1 / 3  # or after this share of the expected duration if longer: long tasks report late
LEAST = 0.1  # of the time left at the last report: so much is shown of it however long ago that was


def progress_bar(*args: Any, expected_rate: float = 0.0, **options: Any) -> Any:
    """Return a bar of tqdm with these arguments, on stderr; a file gets a line every half minute.

    expected_rate: [1/s] units that are expected to be done in a second. With it the time left is known from
    the beginning, when long tasks have begun and none has ended, and between two reports of progress it falls
    as time goes by, down to LEAST of what it was; 0 leaves the estimate to tqdm.
    """
    from tqdm import tqdm

    class SteadyBar(tqdm):  # type: ignore[type-arg]
        reported = (0.0, 0.0)  # units and [s] of the last report

        @property
        def format_dict(self) -> dict[str, Any]:
            shown: dict[str, Any] = super().format_dict
            left = (self.total or 0.0) - self.n
            if expected_rate and left > 0.0:
                done = self.n - self.initial
                if done != self.reported[0]:
                    self.reported = done, shown["elapsed"]
                believed = max(BELIEVED, BELIEVED_SHARE * (done + left) / expected_rate)
                rate = (done + expected_rate * believed) / (self.reported[1] + believed)
                seconds, since = left / rate, shown["elapsed"] - self.reported[1]
                shown["rate"] = left / max(seconds - since, LEAST * seconds)
            return shown

    seconds = 0.1 if sys.stderr.isatty() else SECONDS_OF_A_LOG
    return SteadyBar(*args, mininterval=seconds, maxinterval=max(10.0, seconds), **options)


def announce_compilation() -> None:
    """Say on stderr that kernels will be compiled, where none lies compiled on disk.

    The places are those of reference_sim.kernels.kernel_cache, which is not imported: it loads numba.
    """
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        folders = [Path(given)]
    else:
        of_user = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folders = [Path(__file__).parent, Path(of_user, "numba")]
    if not any(chain.from_iterable(folder.rglob("reference_sim.*-*/*.nbi") for folder in folders)):
        print("first use: kernels are compiled, which takes one to five minutes once", file=sys.stderr)
