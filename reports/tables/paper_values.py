"""Values that the paper printed, as data. Santesteban, Otaduy, Casas: SNUG, CVPR 2022, tables 1 to 3."""

from __future__ import annotations

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
