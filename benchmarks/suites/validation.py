"""Suite validation: numbers whose exact value is known before anything is computed.

The smallest preset runs those marked `smoke`. Rows without a tolerance are reported, not judged.
"""

from __future__ import annotations

from ..check import METHOD, Check, run_check
from . import validation_exact, validation_orders, validation_references

__all__ = ["CHECKS", "METHOD", "Check", "run_check"]

CHECKS: tuple[Check, ...] = (
    *validation_exact.CHECKS,
    *validation_orders.CHECKS,
    *validation_references.CHECKS,
)
