"""Dictionary of results.csv: each column, metric and judged case, as declared."""

from __future__ import annotations

from benchmarks.results.row import ROLES, STATUSES
from reports.run.finished_run import Run
from reports.tables.table import Column, Table

# The columns of benchmarks.results.row.Row: unit, where it has one, and meaning.
COLUMNS = {
    "suite": ("", "question that the row belongs to; with scene, method, seed and metric it names the row"),
    "scene": ("", "what is simulated; of a case, its name"),
    "method": ("", "what gave the roll-out, as declared in run.json"),
    "seed": ("", "of the training; 0 for what has none"),
    "metric": ("", "what was measured: see the rows of kind metric and case"),
    "unit": ("", "of value, expected, tolerance and uncertainty; 1 for what has none"),
    "value": ("of the row", "the number; empty where there is none"),
    "status": ("", f"one of {', '.join(STATUSES)}; stalled: some frame did not converge"),
    "reason": ("", "in words, why the status is not ok, or a remark"),
    "expected": ("of the row", "known answer of a row that is judged, else empty"),
    "tolerance": ("of the row", "largest difference from expected with which the row passes"),
    "uncertainty": (
        "of the row",
        "standard deviation over the ensemble of the reference, or its standard error "
        "as a sample of frames; empty where unknown",
    ),
    "moved": (
        "of the row",
        "what each member of the reference's ensemble changes of the value, in its place: JSON, or empty",
    ),
    "preset": ("", "sizes of everything, as declared in run.json"),
    "protocol": ("", "number of the protocol; 'own' where scene, metric or settings are a user's"),
    "commit": ("", "of the source that measured the row"),
    "hardware": ("", "processor and number of its cores"),
    "dtype": ("", "of the numbers computed with"),
    "threads": ("1", "used by the method"),
    "terms": ("", "energies of the scene, joined by +"),
    "garment": ("", "of the scene; empty without a body"),
    "motion": ("", "of the scene; empty without a body"),
    "part": ("", "of the motion: whole, clip, loop or start; empty without a body"),
    "family": ("", "shared by methods that differ by one number"),
    "level": ("of the family", "that number, such as iterations; empty where there is none"),
    "role": ("", f"of the method: one of {', '.join(filter(None, ROLES))}"),
    "base": ("", "method that this one varies or starts from; empty for none"),
    "seeded": ("", "true where another seed gives another answer"),
    "pairing_group": ("", "shared by methods that are compared seed by seed; empty for none"),
}  # fmt: skip
SIDES = {True: "lower", False: "higher", None: ""}


def dictionary(run: Run) -> Table:
    """List each column of results.csv, each metric of this run and each case that is judged."""
    lines: list[tuple[str, ...]] = [
        ("column", name, unit, "", meaning, "", "") for name, (unit, meaning) in COLUMNS.items()
    ]
    judged = run.frame[run.frame["case"] != ""].drop_duplicates("case")
    measured = set(run.frame[run.frame["case"] == ""]["metric"])
    lines += [
        ("metric", m.name, m.unit, m.title, m.definition, SIDES[m.lower_is_better], m.table)
        for m in run.metrics.values()
        if m.name in measured
    ]
    cases = run.config.get("cases") or {}
    for row in judged.itertuples():
        description = str(cases[row.case].get("description") or "")
        lines.append(("case", f"{row.scene} {row.metric}", row.unit, row.case, description, "", row.suite))
    names = ("kind", "name", "unit", "title", "definition", "better", "table")
    return Table("dictionary", tuple(Column(name, name, text=True) for name in names), tuple(lines))
