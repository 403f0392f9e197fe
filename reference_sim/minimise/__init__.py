"""Minimisers of a Potential: same call, same result type, one file each."""

from .newton import Newton, minimise
from .result import Result

__all__ = ["Newton", "Result", "minimise"]
