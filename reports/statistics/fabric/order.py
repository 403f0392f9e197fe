"""Order of the fabrics by each method: which pairs early stopping turns round."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import pandas as pd

from reports.run.finished_run import Run

TESTS = {"cantilever": "fabric/bending_length", "drape": "fabric/drape_coefficient"}
ERROR = "fabric/error"
# Below, the order of two fabrics is not asked for: drape coefficients of one fabric differ by 4 points
# between meshes and time steps, as the number of folds does.
APART = {"cantilever": 0.5, "drape": 5.0}  # [mm], [%]


@dataclass(frozen=True)
class Order:
    """Order of the fabrics by one method in one test.

    Attributes:
        turned: pairs that stand the other way round than by the reference, the worst first: (lower, higher)
            by the reference.
        pairs: number of pairs that the reference tells apart and the method has.
    """

    turned: tuple[tuple[str, str], ...]
    pairs: int


def rows_of_test(run: Run, test: str) -> pd.DataFrame:
    """Return the rows of the scenes of a test, "cantilever" or "drape"."""
    cells = run.cells("fabric")
    return cells[cells["scene"].str.startswith(f"fabric/{test}/")]


def readings(run: Run, test: str) -> dict[str, dict[str, float]]:
    """Return method -> fabric -> what the test reads off its specimen."""
    rows = rows_of_test(run, test)
    rows = rows[(rows["metric"] == TESTS[test]) & rows["usable"]]
    values: dict[str, dict[str, float]] = {}
    for scene, method, value in rows[["scene", "method", "value"]].itertuples(index=False):
        values.setdefault(str(method), {})[str(scene).split("/", 2)[2]] = float(value)
    return values


def order(mine: Mapping[str, float], reference: Mapping[str, float], apart: float) -> Order:
    """Compare the order of a method's readings with that of the reference's, by fabric.

    >>> order({"a": 3.0, "b": 2.0}, {"a": 1.0, "b": 9.0}, apart=1.0)
    Order(turned=(('a', 'b'),), pairs=1)
    """
    pairs, turned = 0, []
    for pair in combinations([name for name in reference if name in mine], 2):
        low, high = sorted(pair, key=lambda name: reference[name])
        if reference[high] - reference[low] < apart:
            continue
        pairs += 1
        if mine[low] > mine[high]:
            turned.append((mine[low] - mine[high], (low, high)))
    return Order(tuple(pair for _, pair in sorted(turned, reverse=True)), pairs)
