"""Order of convergence, by slope."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def fitted_order(errors: Sequence[float], sizes: Sequence[float]) -> float:
    """Slope of log error over log size, least squares; errors that are zero or not finite give nan."""
    if not (np.isfinite(errors).all() and np.min(errors) > 0):
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
