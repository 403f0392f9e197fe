"""Sentences of page one on suites that compare no garments: textile tests, and cloth of other engines."""

from __future__ import annotations

from typing import Any

from reports.run.finished_run import Run
from reports.tables.engines.audit import engine_audit
from reports.tables.fabric.textile_tests import fabric_order
from reports.tables.number_texts import number
from reports.tables.table import Table

NEAR = 1.0  # % of the exact bending length, and points of the reference's drape coefficient


def textile_tests(run: Run) -> str:
    """Say which solver stopped early is the fastest near the right answers, and how many turn fabrics round.

    Empty for a run without textile tests of solvers stopped early.
    """
    rows = [row for row in _rows(fabric_order(run)) if run.methods[row["method"]].role == "solver"]
    errors = ("cantilever_error", "drape_error")
    judged = [row for row in rows if all(row[name] is not None for name in (*errors, "time"))]
    if not judged:
        return ""
    near = [row for row in judged if all(float(row[name]) <= NEAR for name in errors)]
    what = (
        f"within {NEAR:g} % of the exact bending lengths and {NEAR:g} point of the reference's drape "
        "coefficients"
    )
    first = f"No solver stopped early is {what}."
    if near:
        row = min(near, key=lambda row: float(row["time"]))
        first = (
            f"The fastest solver stopped early {what} is {run.label(row['method'])}, {number(row['time'])} "
            "ms a frame."
        )
    turned = sum(bool(row["worst"]) for row in judged)
    return f"{first} {turned} of {len(judged)} put fabrics in another order of stiffness than the reference."


def engines(run: Run) -> str:
    """Say which settings of other engines violate nothing, and which is farthest from its own limit.

    Empty for a run without other engines.
    """
    rows = [row for row in _rows(engine_audit(run)) if row["engine"] != "reference"]
    if not rows:
        return ""
    right = [row["engine"] for row in rows if row["violates"] == "nothing"]
    one, several = "violates no law and is at its own limit", "violate no law and are at their own limits"
    verdict = one if len(right) == 1 else several
    count = f"Of {len(rows)} default settings of other engines {len(right)} {verdict}"
    sentences = [f"{count}: {', '.join(right)}." if right else f"{count}."]
    measured = [row for row in rows if row["distance"] is not None]
    if measured:
        row = max(measured, key=lambda row: float(row["distance"]))
        needed = "No budget tried is" if row["budget"] is None else f"{row['budget']:g} times its budget is"
        sentences.append(
            f"Farthest from its own limit is {row['engine']}, by {number(row['distance'], 2)} % of what the "
            f"sheet moves. {needed} within 1 % of it."
        )
    return " ".join(sentences)


def _rows(tables: list[Table]) -> list[dict[str, Any]]:
    """Return column -> cell of each row, means as their numbers."""
    return [
        {column.name: getattr(cell, "value", cell) for column, cell in zip(table.columns, row)}
        for table in tables
        for row in table.rows
    ]
