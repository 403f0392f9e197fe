"""Sparse Cholesky packages on one and the same Hessian: what each of the three calls costs.

The Hessian is that of a stretched and wrinkled sheet with inertia, positive definite; analyse includes the
fill-reducing order. qdldl and cholespy cannot analyse without values: qdldl's analyse holds a factorisation
too, cholespy's factorise holds the analysis. polysolve's and cholespy's CHOLMOD print a warning line of their
own when a matrix is not positive definite.

The choice is CHOLMOD through cvxopt with METIS nested dissection (reference_sim.linear_solver). Processor
milliseconds on one thread of a 2-core machine, analyse / factorise / solve:

    unknowns                         3261                12669                49917
    CHOLMOD, METIS          6.7/ 2.8/0.23        29/  18/2.0         149/ 169/13
    CHOLMOD, AMD            5.2/ 3.0/0.23        21/  24/2.7         106/ 249/15
    polysolve CHOLMOD       5.6/ 3.8/0.17        13/  31/2.6          54/ 304/15
    pypardiso               6.9/ 3.8/0.72        28/  27/5.5         135/ 220/31
    polysolve PardisoLLT    9.6/ 3.8/0.55        33/  28/5.2         142/ 223/30
    SuperLU, METIS          5.2/20  /0.75        21/ 114/4.4          97/ 749/22
    cholespy                1.4/17  /0.33         5/ 137/3.2          29/1800/23
    qdldl                    16/13  /0.34       165/ 158/4.1        3250/3540/32

Every package reports an indefinite matrix (qdldl only through the signs of D), all with backward errors below
2e-15. A factorisation is what Newton's method repeats: CHOLMOD with METIS has the cheapest at every size, a
quarter to a third under PARDISO, whose solve takes two to three times as long besides and which brings
hundreds of megabytes of MKL. AMD analyses faster, which happens once a scene. The price of cvxopt is its
licence, GPLv3; where that or the package is unwelcome, SuperLU from scipy gives the same answers at four to
seven times the cost.
"""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from reference_sim import Cloth, Potential
from reference_sim.energies import BendHinge, Gravity, Inertia, StretchStVK
from reference_sim.hessian_pattern import HessianPattern

from ..parts import Row
from .cholesky_packages import PACKAGES, Build
from .sheet import DT, regular_sheet

CASES = ("32 x 32 cells", "64 x 64 cells", "128 x 128 cells")
LONG = 15.0  # seconds after which a package is not measured again


def hessians(cells: int) -> tuple[HessianPattern, np.ndarray, np.ndarray]:
    """Pattern of a sheet of cells x cells squares, and values (nnz,) of two Hessians on it.

    The first belongs to a sheet pulled by 5 % with wrinkles of 4 mm across it, and is positive definite; the
    second to the same sheet pressed to 70 %, and is not.
    """
    cloth = regular_sheet(cells + 1)
    free = np.ones(cloth.vertex_count, dtype=bool)
    free[cloth.pins] = False
    potential = Potential([StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), Inertia(cloth, DT)])
    pattern = potential.pattern(free)
    return pattern, pattern.assemble(_wrinkled(cloth, 1.05)), pattern.assemble(_wrinkled(cloth, 0.7))


def _wrinkled(cloth: Cloth, stretch: float) -> np.ndarray:
    x = stretch * cloth.rest_positions
    x[:, 1] = 4e-3 * np.sin(14 * np.pi * x[:, 0]) * np.cos(10 * np.pi * x[:, 2])
    return x + np.random.default_rng(0).normal(0, 1e-3 * cloth.edge_lengths.mean(), x.shape)


def measure(case: str, repeats: int) -> list[Row]:
    """ms of each call (medians), backward error, and what becomes of an indefinite matrix."""
    pattern, definite, indefinite = hessians(int(case.split()[0]))
    rows: list[Row] = [("unknowns", pattern.size, "")]
    rows.append(("stored entries", len(pattern.indices), ""))
    for name, (install, build) in PACKAGES.items():
        try:
            rows += [
                (f"{name}: {metric}", value, unit)
                for metric, value, unit in _one(build, pattern, definite, indefinite, repeats)
            ]
        except ImportError:
            rows.append((name, f"absent: pip install {install}", ""))
    return rows


def _one(
    build: Build, pattern: HessianPattern, definite: np.ndarray, indefinite: np.ndarray, repeats: int
) -> list[Row]:
    b = np.random.default_rng(1).normal(size=pattern.size)
    seconds: dict[str, list[float]] = {"analyse": [], "factorise": [], "solve": []}
    begun = time.perf_counter()
    for _ in range(repeats + 1):
        clock = [time.perf_counter()]
        solver = build(pattern.indptr, pattern.indices)
        clock.append(time.perf_counter())
        done = solver.factorise(definite)
        clock.append(time.perf_counter())
        if not done:
            raise ArithmeticError("the positive definite Hessian was refused")
        x = solver.solve(b)
        clock.append(time.perf_counter())
        for part, spent in zip(seconds, np.diff(clock)):
            seconds[part].append(spent)
        if clock[-1] - begun > LONG:
            break
    H = pattern.symmetric(definite)
    scale = sp.linalg.norm(H, np.inf) * np.abs(x).max() + np.abs(b).max()
    # The first round warms up, and counts only where a package is too slow for another.
    rows: list[Row] = [
        (part, 1e3 * float(np.median(spent[1:] or spent)), "ms") for part, spent in seconds.items()
    ]
    rows.append(("backward error", float(np.abs(H @ x - b).max() / scale), "1"))
    refused = not solver.factorise(indefinite)
    rows.append(("not positive definite", "reported" if refused else "NOT reported", ""))
    return rows
