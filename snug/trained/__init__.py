"""Trained networks of the package: one file each, which `snug.TrainedModel.load` finds by its name.

`snug-tshirt` is SNUG for the T-shirt, trained with seed 0; another seed stands behind:
`snug-tshirt-seed1`. The header of a file names recipe, data, commit, versions and processor of its
training.
"""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).resolve().parent
SUFFIX = ".safetensors"


def network_name(network: str, garment: str, seed: int) -> str:
    """Return the name of a network of the package.

    >>> network_name("snug", "tshirt", 0), network_name("pbns", "tshirt", 2)
    ('snug-tshirt', 'pbns-tshirt-seed2')
    """
    return f"{network}-{garment}" + (f"-seed{seed}" if seed else "")


def list_networks() -> dict[str, Path]:
    """Return name -> file of every network of the package, by name."""
    return {path.stem: path for path in sorted(FOLDER.glob(f"*{SUFFIX}"))}
