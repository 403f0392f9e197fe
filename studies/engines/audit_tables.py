"""Tables of a run of this study: python audit_tables.py RUN [FOLDER]. Prints them, and writes CSV files.

Table `engine_audit` has the laws that an engine violates at its default settings, and what it costs to be at
its own limit; `engine_laws` has the errors of the laws.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from pathlib import Path

LAWS = {
    "fall_over_discrete_law": "free fall",
    "momentum_error": "momentum",
    "asymmetry": "symmetry",
    "reaction_over_weight": "reaction",
    "energy_gap": "energy gap",
}
RATIOS = ("fall_over_discrete_law", "reaction_over_weight")  # right at 1; tabulated as errors in per cent
SPIN = "spin_kept"
HEADS = {  # of the file -> of the printed table
    "engine": "Engine",
    "violates": "Violates at its default",
    "time [ms]": "Default, time [ms]",
    "distance [%]": "Default, from its limit [%]",
    "budget": "Budget within 1 %, multiple",
    "converged [ms]": "Time there [ms]",
    "reference_time [ms]": "Reference within 1 % of its limit [ms]",
    **{f"{law} [%]": f"{label.capitalize()} [%]" for law, label in LAWS.items()},
    f"{SPIN} [%]": "Spin left [%]",
}
Table = list[list[str]]


def tables(results: Path) -> dict[str, Table]:
    """Return name -> rows of each table, the heads first, from a file of results."""
    with results.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["suite"] == "engines" and row["status"] == "ok"]
    values = {(row["scene"], row["metric"].removeprefix("engine/")): row for row in rows}
    engines = list(dict.fromkeys(scene for scene, _ in values if "/" not in scene))
    audit = [[*HEADS][:7], *([engine, *_audit(engine, values)] for engine in engines)]
    laws = [["engine", *(f"{law} [%]" for law in (*LAWS, SPIN))]]
    laws += [[engine, *(_error(law, values.get((engine, law))) for law in (*LAWS, SPIN))]
             for engine in engines]  # fmt: skip
    return {"engine_audit": audit, "engine_laws": laws}


def _audit(engine: str, values: dict[tuple[str, str], dict[str, str]]) -> Iterator[str]:
    """Yield the cells of an engine: laws violated, default time and distance, budget, its time, reference."""
    judged = {
        **{(engine, law): label for law, label in LAWS.items()},
        (f"{engine}/x1", "distance"): "own limit",
    }
    names = [label for key, label in judged.items() if key in values and _violated(values[key])]
    if absent := sum(key not in values for key in judged):
        names.append(f"{absent} not measured")
    yield ", ".join(names) or "nothing"
    budget = values.get((engine, "budget"))
    at_limit = f"{engine}/x{float(budget['value']):.0f}" if budget else ""
    places = ((f"{engine}/x1", "time"), (f"{engine}/x1", "distance"), (engine, "budget"), (at_limit, "time"))
    for key in (*places, (engine, "reference_time")):
        yield _cell(float(values[key]["value"])) if key in values else "-"


def _violated(row: dict[str, str]) -> bool:
    return abs(float(row["value"]) - float(row["expected"])) > float(row["tolerance"])


def _error(law: str, row: dict[str, str] | None) -> str:
    if row is None:
        return "-"
    value = float(row["value"])
    return _cell(100.0 * (value - 1.0) if law in RATIOS else value)


def _cell(value: float) -> str:
    return f"{value:.9g}"


def markdown(table: Table) -> str:
    """Return a table in Markdown, with numbers of three digits.

    >>> print(markdown([["engine", "time [ms]"], ["a", "1.23456"]]))
    | Engine | Default, time [ms] |
    | --- | --- |
    | a | 1.23 |
    """
    heads, *rows = table
    texts = [[cell if cell == "-" or cell[0].isalpha() else f"{float(cell):.3g}" for cell in row]
             for row in rows]  # fmt: skip
    lines = [[HEADS[head] for head in heads], ["---"] * len(heads), *texts]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


if __name__ == "__main__":
    for name, rows in tables(Path(sys.argv[1]) / "results.csv").items():
        print(f"{name}\n\n{markdown(rows)}\n")
        if sys.argv[2:]:
            with (Path(sys.argv[2]) / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerows(rows)
