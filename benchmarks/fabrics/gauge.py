"""Fabrics of GAUGE's textile experiments (Wang et al. 2026), from a folder that the user has downloaded.

    FOLDER/metadata/textile/textile <task>.json      fabrics of the tasks "stretching" and "bending"

A metadata file gives each fabric's mass per area [kg/m^2] and bending stiffness, taken as [N m] because no
unit is stated. Trials of the experiments are not read: none has been seen, see docs/notebook/fabric.md. MIT
licence; none of its files is part of this project.
"""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.fabrics.fabric import Fabric, plain_name
from benchmarks.fabrics.measured import RANGES, FabricFileError

TASKS = ("stretching", "bending")


def read_gauge(folder: Path) -> tuple[Fabric, ...]:
    """Read the fabrics of the first of TASKS that a folder has.

    Raises:
        FabricFileError: no such folder, a file that is not understood, or a number out of its range.
    """
    paths = [folder / "metadata" / "textile" / f"textile {task}.json" for task in TASKS]
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        raise FabricFileError(
            f"--gauge {folder}: no file '{paths[-1].relative_to(folder)}': give the folder that "
            "GAUGE-Dataset was downloaded to"
        )
    try:
        materials = json.loads(path.read_text(encoding="utf-8"))["assets"]["textile"]["material"]
        read = {key: (float(m["density"]), float(m["bend stiffness"])) for key, m in materials.items()}
    except (OSError, KeyError, TypeError, AttributeError, ValueError) as error:
        raise FabricFileError(
            f"--gauge {path}: not the metadata of a textile task ({type(error).__name__}: {error}): "
            "download it again"
        ) from None
    for key, (density, stiffness) in read.items():
        for field, value, title in (("density", density, "density"), ("warp", stiffness, "bend stiffness")):
            low, high = RANGES[field]
            if not low <= value <= high:
                raise FabricFileError(
                    f"--gauge {path}: {key}: {title} {value:g} is outside {low:g} to {high:g} in SI units: "
                    "check its unit"
                )
    return tuple(Fabric(plain_name(key), density, k, k) for key, (density, k) in read.items())
