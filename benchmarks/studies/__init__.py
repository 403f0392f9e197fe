"""The visible tuple of studies: one line each. Nothing is imported until a study is run."""

from __future__ import annotations

from ..study import METHOD, Study

__all__ = ["METHOD", "STUDIES", "Study"]

STUDIES = (
    Study(
        name="laws",
        description="momentum, energy and residual of every roll-out on unseen motions, frame by frame",
        suite="validation",
        module="benchmarks.studies.laws",
        reads=("roll-outs",),
    ),
    Study(
        name="long_roll_outs",
        description="every network for a thousand frames there and back: energy at both ends, and drift",
        suite="garments",
        module="benchmarks.studies.long_roll_outs",
        reads=("networks", "motions"),
    ),
    Study(
        name="training_windows",
        description="every network on its training motions: windows as it was trained beside whole roll-outs",
        suite="garments",
        module="benchmarks.studies.training_windows",
        reads=("networks",),
    ),
    Study(
        name="dependence",
        description="every headline number of the T-shirt on other meshes and at other time steps",
        suite="validation",
        module="benchmarks.studies.dependence",
    ),
    Study(
        name="hard_motions",
        description="networks and simulator: too fast, too far, too large, with glitches, for 10,000 frames",
        suite="extremes",
        module="benchmarks.studies.hard_motions",
        reads=("networks",),
    ),
)
