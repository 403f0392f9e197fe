"""Lifts of the slit annular plate on other meshes, with other stiffness: the tables of simulator.md.

    OMP_NUM_THREADS=1 python docs/notebook/slit_annulus.py

It takes three minutes and prints the inner and the outer lift [m] and how far they are from Sze's [%].
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from benchmarks.validation.large_bending import ANNULUS_MATERIAL, SZE, D, lift_lip
from benchmarks.validation.plates import plate_stiffness
from reference_sim.kernels.fast_kernels import SlowPathWarning

EXACT = np.array(SZE)


def measure(
    rows: int, *, zero: bool, family: str = "equilateral", bend: float = 1.0, stretch: float = 1.0
):
    """Print the lifts: nu = 0 if `zero`, else that of hinges; factors on bending and membrane stiffness."""
    stiffness = bend * D / plate_stiffness(family, "length_area")[0]
    young = stretch * ANNULUS_MATERIAL.young_modulus
    material = replace(ANNULUS_MATERIAL, young_modulus=young, bending_stiffness=stiffness)
    lifts = lift_lip(rows, bend * D if zero else 0.0, material, family)
    print(
        f"{family:12} {rows:4} {zero!s:6} {bend:5} {stretch:5}",
        lifts,
        100 * (lifts / EXACT - 1),
        flush=True,
    )


if __name__ == "__main__":
    np.set_printoptions(precision=4, suppress=True)
    print("triangles  rows  nu = 0  bending  membrane  lifts  distance [%]")
    warnings.simplefilter("ignore", SlowPathWarning)
    for zero in (True, False):
        for rows in (4, 8, 16, 32):
            measure(rows, zero=zero)
    for family in ("right", "cross", "union_jack", "delaunay"):
        for rows in (8, 16):
            measure(rows, zero=False, family=family)
    for stretch in (0.1, 10.0):
        for rows in (4, 8, 16):
            measure(rows, zero=True, stretch=stretch)
    for bend in (0.97, 1.03):
        for rows in (8, 16):
            measure(rows, zero=True, bend=bend)
