"""Values that the paper printed. Santesteban, Otaduy, Casas: SNUG, CVPR 2022, tables 1 to 3."""

from __future__ import annotations

from reports.run.finished_run import Run
from reports.statistics.effects import recording_of
from reports.tables.table import Column, Table, table

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

TEST_CLIPS = ("tshirt/01_01", "tshirt/07_02")  # two of the paper's four test sequences


def paper_table_1(run: Run) -> list[Table]:
    """Tabulate energies of the paper's recipe on two of its test sequences, with what its table 1 has.

    Each number is a mean over all frames and seeds. The paper does not state the zero of its gravity.
    """
    frames = run.frame_energies
    if frames.empty:
        return []
    kept = frames[frames["scene"].map(recording_of).isin(TEST_CLIPS)]
    if not {"pbns-paper", "snug-paper"} <= set(kept["method"]):
        return []
    means = kept.groupby("method")[["strain", "bending", "inertia"]].mean()
    lines = []
    for term in means:
        printed = [float(values[f"energy/{term}"]) for values in PRINTED["energies"].values()]
        pairs = (means.loc["pbns-paper", term], means.loc["snug-paper", term]), printed
        lines.append((term, *(x for pbns, snug in pairs for x in (pbns, snug, snug / pbns))))
    columns = [Column("energy", "Energy", text=True)]
    for name, where in (("here", "here"), ("paper", "in the paper")):
        columns += [Column(f"{m}_{name}", f"{m}, {where}", "J", trim=True) for m in ("PBNS", "SNUG")]
        columns.append(Column(f"ratio_{name}", f"SNUG / PBNS, {where}", digits=2))
    caption = (
        "Table 1 of the paper: means over the frames of 01_01 and 07_02, two of its four test sequences."
    )
    return table("paper_table_1", columns, lines, caption)
