"""Rows of a run on bodies of other shapes than the mean one."""

from __future__ import annotations

import numpy as np
import pandas as pd

from reports.run.finished_run import Run

SHAPE = "body/shape"


def rows_of_shapes(run: Run) -> tuple[pd.DataFrame, pd.Series]:
    """Return the rows of scenes with a known body shape, and scene -> norm of its shape parameters.

    There are none unless the shapes differ.
    """
    cells = run.cells("shapes")
    known = cells[(cells["metric"] == SHAPE) & cells["usable"]]
    norms = known.drop_duplicates("scene").set_index("scene")["value"]
    kept = cells["scene"].isin(norms.index) if norms.nunique() > 1 else np.zeros(len(cells), bool)
    return cells[kept], norms


def rows_of_other_shapes(run: Run) -> pd.DataFrame:
    """Return the rows of scenes whose body has not the mean shape."""
    rows, norms = rows_of_shapes(run)
    return rows[rows["scene"].isin(norms.index[norms > 0.0])]
