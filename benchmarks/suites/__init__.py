"""The visible tuple of suites: which scenes meet which methods, and what is only in a full run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A question put to many cells; the module of that name in this folder says which and how."""

    name: str
    description: str


SUITES = (
    Suite(name="garments", description="all methods on unseen motions: energies, curvature, cost"),
    Suite(name="speed", description="error against run time: truncated solvers beside networks"),
    Suite(name="validation", description="physics with an exact answer: measured, expected, tolerance"),
    Suite(name="extremes", description="stiff, huge and degenerate input: converged, or an honest failure"),
)

SUITE_NAMES = tuple(suite.name for suite in SUITES)
