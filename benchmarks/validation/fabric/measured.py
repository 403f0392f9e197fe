"""Place of a fabric among measured ones."""

from __future__ import annotations

from collections.abc import Sequence


def percentile(length: float, lengths: Sequence[float]) -> float:
    """Return the share of bending lengths that are below `length` [%], half of those that equal it.

    >>> percentile(3.0, [1.0, 2.0, 3.0, 4.0])
    62.5
    """
    below = sum(other < length for other in lengths) + 0.5 * sum(other == length for other in lengths)
    return 100.0 * below / len(lengths)
