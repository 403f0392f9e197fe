"""A study: rows of a suite that are no single number known beforehand, and need more than the solver.

A check or a case needs nothing but itself. A study reads what the run has left in its folder (roll-outs,
trained networks), or simulates whole motions; it comes after the cells, off every clock.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .results import Row, RunFolder

if TYPE_CHECKING:
    from .plan import Plan
    from .wardrobe import Wardrobe

METHOD = "simulation"  # naming methods without it leaves studies out, as checks and cases


@dataclass(frozen=True, kw_only=True)
class Study:
    """The declaration of a study: cheap to list. `rows` of its module does it.

    reads: what of the run it looks at: "roll-outs" on bodies, the T-shirt's "networks", test "motions". When
    that is another, or its code, the study is done again.
    """

    name: str
    description: str
    suite: str
    module: str
    reads: tuple[str, ...] = ()

    def run(self, plan: Plan, folder: RunFolder, wardrobe: Wardrobe | None) -> list[Row]:
        """Its rows. What it raises becomes a failed row with the reason."""
        try:
            return importlib.import_module(self.module).rows(plan, folder, wardrobe)
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            return [Row(self.suite, self.name, METHOD, 0, "study", "", None, "failed", reason)]
