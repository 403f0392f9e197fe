"""What the paper printed and what it claimed, as data, and whether the claims came out in this run.

Santesteban, Otaduy, Casas: SNUG, CVPR 2022, tables 1 to 3 and section 4.
"""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from reports.data import Run
from reports.means import Mean, pair
from reports.significance import difference, relative_difference
from reports.table import Cell, Column, Table, table

# Table -> method -> metric -> as printed. A column that the paper does not report is a dash.
PRINTED = {
    "energies": {
        "PBNS, in the paper": {
            "energy/strain": "0.111", "energy/bending": "0.007", "energy/gravity": "0.044",
            "energy/inertia": "0.0035",
        },
        "SNUG, in the paper": {
            "energy/strain": "0.064", "energy/bending": "0.004", "energy/gravity": "0.028",
            "energy/inertia": "0.0034",
        },
    },
    "curvature": {"SNUG, in the paper": {"curvature/error": "2.7"}},
    "cost": {
        "TailorNet, in the paper": {
            "cost/data": "29 h", "cost/train": "6.5 h", "cost/frame": "10.1", "cost/memory": "2114",
        },
        "Santesteban 2019, in the paper": {
            "cost/data": "180 h", "cost/train": "17 h", "cost/frame": "2.5", "cost/memory": "109",
        },
        "SNUG, in the paper": {
            "cost/data": "0 h", "cost/train": "2 h", "cost/frame": "2.2", "cost/memory": "19",
        },
    },
}  # fmt: skip
NOTES = {
    "energies": "In grey the paper's values, for its own garment, motions, contact and zero of gravity.",
    "curvature": "In grey the paper's value, whose operator and unit it does not state.",
    "cost": "In grey the paper's values, on its own machine with a GPU.",
}

# (metric, lower, higher): the first method has less of it than the second.
CLAIMS = (
    *((f"energy/{term}", "snug", "pbns") for term in ("strain", "bending", "gravity", "inertia")),
    *(
        (metric, "snug", f"snug-{name}")
        for name in ("no-bending", "no-strain", "no-gravity", "no-inertia", "window6", "window12")
        for metric in ("energy/total", "curvature/error")
    ),
    ("curvature/error", "snug", "snug-springs"),
    *(("dynamics/amplitude", name, "snug") for name in ("snug-no-inertia", "snug-window6", "snug-window12")),
    ("curvature/mean", "supervised", "simulation"),
    ("curvature/mean", "supervised", "snug"),
    ("curvature/error", "snug", "supervised"),
    ("energy/total", "snug-noise-alone", "snug-no-noise"),
    ("curvature/error", "snug-noise-alone", "snug-no-noise"),
    ("roll_out/drift", "snug-noise-alone", "snug-no-noise"),
    ("roll_out/last", "snug-noise-alone", "snug-no-noise"),
)
REPRODUCED, NOT_REPRODUCED, SCATTERED = "reproduced", "not reproduced", "within the scatter of seeds"


def findings(run: Run) -> list[Table]:
    """The claims that this run can judge, over the scenes of the first garment that both methods share."""
    first = next(iter(run.garments(run.worn)), None)
    rows = list(_judged(run, run.worn[run.worn["garment"] == first]))
    columns = (
        Column("metric", "Measure", text=True, width="1fr"),
        Column("lower", "Less of it", text=True, method=True, width="1fr"),
        Column("higher", "More of it", text=True, method=True, width="1fr"),
        Column("unit", "Unit", text=True),
        Column("first", "The first"),
        Column("second", "The second"),
        Column("apart", "Apart", "%", digits=2, trim=True),
        Column("status", "Here", text=True, width="1.2fr"),
    )
    caption = (
        "Findings of the paper: which method has less of what, and whether that came out here. "
        "Apart: of geometric means where several seeds are compared and all values are positive."
    )
    return table("findings", columns, rows, caption)


def _judged(run: Run, frame: pd.DataFrame) -> Iterator[tuple[Cell, ...]]:
    ran = set(frame["method"])
    for metric, lower, higher in CLAIMS:
        if not {lower, higher} <= ran:
            continue
        own = frame[(frame["metric"] == metric) | ~frame["usable"]]
        means = pair(own, lower, higher, metric)
        said = verdict(run, frame, (lower, higher), means, metric)
        if said:
            share = None if None in means else relative_difference(*means)  # type: ignore[arg-type]
            apart = None if share is None else 100.0 * share
            declared = run.metrics[metric]
            yield declared.title, lower, higher, declared.unit, *means, apart, said


def verdict(
    run: Run,
    frame: pd.DataFrame,
    methods: tuple[str, str],
    means: tuple[Mean | None, Mean | None],
    metric: str,
) -> str:
    """In words, whichever way it comes out; empty where one of the two was not run.

    Of a metric of which less is better, a method that diverged has more.
    """
    one, other = means
    if one is not None and other is not None:
        sign = difference(one, other)
        word = (
            SCATTERED if sign == 0 else REPRODUCED if sign < 0 else f"{NOT_REPRODUCED}: the other way round"
        )
        return word + one.fewer
    if metric not in run.metrics or not run.metrics[metric].lower_is_better:
        return ""
    diverged = set(frame[frame["status"] == "diverged"]["method"])
    if one is not None and methods[1] in diverged:
        return f"{REPRODUCED}: the second diverged"
    return f"{NOT_REPRODUCED}: the first diverged" if other is not None and methods[0] in diverged else ""
