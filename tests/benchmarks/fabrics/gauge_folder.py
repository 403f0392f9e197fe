"""A small folder of the form of GAUGE's: its own numbers, two fabrics."""

from __future__ import annotations

import json
from pathlib import Path

FABRICS = {"satin": (0.07, 1.5e-6), "oxford": (0.2, 4.8e-5)}


def make_folder(folder: Path) -> Path:
    """Write the metadata of stretching and bending."""
    material = {name: {"mass": 0.16 * rho, "density": rho, "bend stiffness": k}
                for name, (rho, k) in FABRICS.items()}  # fmt: skip
    described = folder / "metadata/textile"
    described.mkdir(parents=True)
    for task in ("stretching", "bending"):
        assets = {"rod": {"material": {"wood": {"mass": 0.02}}}, "textile": {"material": material}}
        (described / f"textile {task}.json").write_text(json.dumps({"assets": assets}))
    return folder
