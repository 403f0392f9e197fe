"""Tables of a run of this study: python audit_tables.py RUN [FOLDER]. Prints them, and writes CSV files.

Table `engine_audit` has the laws that an engine violates at its default settings, and what it costs to be
at its own limit; `engine_laws` has the errors of the laws.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

LAWS = {
    "fall_over_discrete_law": "free fall",
    "momentum_error": "momentum",
    "asymmetry": "symmetry",
    "reaction_over_weight": "reaction",
    "energy_gap": "energy gap",
    "spin_kept": "spin left",  # reported, not judged
}
RATIOS = ("fall_over_discrete_law", "reaction_over_weight")  # right at 1; tabulated as errors in per cent
HEADS = {  # of the file -> of the printed table
    "engine": "Engine",
    "violates": "Violates at its default",
    "time [ms]": "Default, time [ms]",
    "distance [%]": "Default, from its limit [%]",
    "budget": "Budget within 1 %, multiple",
    "converged [ms]": "Time there [ms]",
    "reference_time [ms]": "Reference within 1 % of its limit [ms]",
    **{f"{law} [%]": f"{label.capitalize()} [%]" for law, label in LAWS.items()},
}


def tables(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return name -> table, from the rows of results.csv."""
    rows = rows[(rows["suite"] == "engines") & (rows["status"] == "ok")]
    rows = rows.assign(law=rows["metric"].str.removeprefix("engine/")).set_index(["scene", "law"])
    faults = (rows["value"] - rows["expected"]).abs() > rows["tolerance"]
    values = rows["value"].to_dict()
    errors = {key: 100.0 * (value - 1.0) if key[1] in RATIOS else value for key, value in values.items()}
    audit, laws = [], []
    for engine in dict.fromkeys(scene for scene, _ in values if "/" not in scene):
        labels = {(engine, law): label for law, label in LAWS.items() if law != "spin_kept"}
        labels[f"{engine}/x1", "distance"] = "own limit"
        names = [label for key, label in labels.items() if faults.get(key)]
        if count := sum(key not in values for key in labels):
            names.append(f"{count} not measured")
        budget, reference = (values.get((engine, law)) for law in ("budget", "reference_time"))
        default, distance = (values.get((f"{engine}/x1", law)) for law in ("time", "distance"))
        converged = values.get((f"{engine}/x{budget or 0:.0f}", "time"))
        audit.append(
            [engine, ", ".join(names) or "nothing", default, distance, budget, converged, reference]
        )
        laws.append([engine, *(errors.get((engine, law)) for law in LAWS)])
    heads = list(HEADS)
    laws_table = pd.DataFrame(laws, columns=[heads[0], *heads[7:]])
    return {"engine_audit": pd.DataFrame(audit, columns=heads[:7]), "engine_laws": laws_table}


def markdown(table: pd.DataFrame) -> str:
    """Return a table in Markdown, with numbers of three digits.

    >>> print(markdown(pd.DataFrame([{"engine": "a", "time [ms]": 1.23456}])))
    | Engine | Default, time [ms] |
    | --- | --- |
    | a | 1.23 |
    """
    cells = table.astype(object).where(table.notna(), "-")
    texts = [
        [f"{cell:.3g}" if isinstance(cell, float) else cell for cell in row] for row in cells.to_numpy()
    ]
    lines = [[HEADS[head] for head in table], ["---"] * len(table.columns), *texts]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


if __name__ == "__main__":
    results = pd.read_csv(next(Path(sys.argv[1]).glob("results.csv*")), low_memory=False)
    for name, table in tables(results).items():
        print(f"{name}\n\n{markdown(table)}\n")
        if sys.argv[2:]:
            table.to_csv(Path(sys.argv[2]) / f"{name}.csv", index=False, float_format="%.9g", na_rep="-")
