"""Tables of the audit of engines: laws that they violate, and what it costs to be at their own limit."""

from __future__ import annotations

import pandas as pd

from reports.run.finished_run import Run
from reports.tables.table import Cell, Column, Table, table

SPIN = "spin_kept"  # reported, not judged
LAWS = {
    "fall_over_discrete_law": "free fall",
    "momentum_error": "momentum",
    "asymmetry": "symmetry",
    "reaction_over_weight": "reaction",
    "energy_gap": "energy gap",
    SPIN: "spin left",
}
RATIOS = ("fall_over_discrete_law", "reaction_over_weight")  # right at 1; tabulated as errors in per cent
ENGINE = Column("engine", "Engine", text=True)


def engine_audit(run: Run) -> list[Table]:
    """Tabulate what each engine violates at its default, and the cost of 1 % from its own limit."""
    values, violated = _values(run), _violated(run)
    lines: list[tuple[Cell, ...]] = []
    for engine in dict.fromkeys(scene for scene, _ in values if "/" not in scene):
        names = [label for law, label in LAWS.items() if (engine, law) in violated]
        names += ["own limit"] * ((f"{engine}/x1", "distance") in violated)
        judged = [(engine, law) for law in LAWS if law != SPIN] + [(f"{engine}/x1", "distance")]
        if absent := sum(key not in values for key in judged):
            names.append(f"{absent} not measured")
        budget = values.get((engine, "budget"))
        converged = None if budget is None else values.get((f"{engine}/x{budget:.0f}", "time"))
        lines.append((
            engine, ", ".join(names) or "nothing", values.get((f"{engine}/x1", "time")),
            values.get((f"{engine}/x1", "distance")), budget, converged,
            values.get((engine, "reference_time")),
        ))  # fmt: skip
    columns = (
        ENGINE, Column("violates", "Violates at its default", text=True),
        Column("time", "Default, time", "ms"), Column("distance", "Default, from its limit", "%"),
        Column("budget", "Budget within 1 %, multiple"), Column("converged", "Time there", "ms"),
        Column("reference_time", "Reference within 1 % of its limit", "ms"),
    )  # fmt: skip
    caption = (
        "Engines at their default settings: laws violated by more than 1 %, processor time of a frame of "
        "a hanging sheet of 289 vertices, and the least budget within 1 % of the engine's own limit; "
        "a dash there: no budget that was tried is that near."
    )
    return table("engine_audit", columns, lines, caption)


def engine_laws(run: Run) -> list[Table]:
    """Tabulate the numbers behind: how each engine keeps each law at its default."""
    values = _values(run)
    errors = {
        (engine, law): 100.0 * (value - 1.0) if law in RATIOS else value
        for (engine, law), value in values.items()
    }
    lines: list[tuple[Cell, ...]] = [
        (engine, *(errors.get((engine, law)) for law in LAWS))
        for engine in dict.fromkeys(scene for scene, _ in values if "/" not in scene)
    ]
    columns = (ENGINE, *(Column(law, label.capitalize(), "%") for law, label in LAWS.items()))
    caption = "Errors of the laws at default settings; spin that is left is reported, not evaluated."
    return table("engine_laws", columns, lines, caption)


def _rows(run: Run) -> pd.DataFrame:
    rows = run.suite("engines")
    return rows[rows["usable"]].assign(law=rows["metric"].str.removeprefix("engine/"))


def _values(run: Run) -> dict[tuple[str, str], float]:
    """Return (scene, law) -> value."""
    rows = _rows(run)
    return {(str(s), str(law)): float(v) for s, law, v in zip(rows["scene"], rows["law"], rows["value"])}


def _violated(run: Run) -> set[tuple[str, str]]:
    """Return (scene, law) of the numbers that are further from what is expected than the tolerance."""
    rows = _rows(run)
    rows = rows[(rows["value"] - rows["expected"]).abs() > rows["tolerance"]]
    return set(zip(rows["scene"], rows["law"]))
