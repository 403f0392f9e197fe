"""Metrics stretch/*: percentiles of the principal stretches of triangles, tension and compression apart.

Of each triangle F = [x1 - x0, x2 - x0] Dm^-1 (3 x 2) is the deformation gradient, and the square roots of the
eigenvalues of the right Cauchy-Green tensor F^T F are its principal stretches (Bonet and Wood 2008, section
4.6). The larger one less 1 is called tension and the smaller one less 1 compression, whatever their signs:
a triangle may be stretched in one direction and compressed in the other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmarks.metric import Metric

if TYPE_CHECKING:
    from benchmarks.metric import RollOut
    from reference_sim.cloth import Cloth

Floats = NDArray[np.float64]

PERCENTILES = (1, 50, 99)
SIDES = {"compression": "smaller", "tension": "larger"}  # in the order of `principal_stretches`

METRICS = tuple(
    Metric(
        name=f"stretch/{side}_p{percent:02}", unit="%", title=f"{side.capitalize()}, {percent} %",
        table="stretch" if percent != 50 else "",
        definition=f"{SIDES[side]} principal stretch of a triangle less 1: {percent} % of the rest area have "
        "less, over all evaluated frames",
    )
    for side in ("tension", "compression")
    for percent in PERCENTILES
)  # fmt: skip


def measure(roll_out: RollOut) -> dict[str, float]:
    """Return percentiles of tension and compression over triangles and evaluated frames [%]."""
    cloth = roll_out.scene.cloth
    strains = principal_stretches(roll_out.positions[roll_out.judged], cloth) - 1.0
    values: dict[str, float] = {}
    for side, strain in zip(SIDES, np.moveaxis(strains, -1, 0)):
        of_percentiles = weighted_percentiles(strain, np.broadcast_to(cloth.areas, strain.shape), PERCENTILES)
        values |= {f"stretch/{side}_p{p:02}": 100.0 * float(v) for p, v in zip(PERCENTILES, of_percentiles)}
    return values


def principal_stretches(positions: Floats, cloth: Cloth) -> Floats:
    """Return the smaller and the larger principal stretch of each triangle, (T,F,2) [1].

    positions: (T,V,3) [m].

    >>> from benchmarks.meshes import right_grid
    >>> from reference_sim.cloth import Cloth
    >>> plane, faces = right_grid(2, 2, 1.0, 1.0)
    >>> sheet = np.column_stack([plane, 0.0 * plane[:, 0]])
    >>> principal_stretches(sheet[None] * [1.2, 0.9, 1.0], Cloth(sheet, faces))[0, 0].round(12).tolist()
    [0.9, 1.2]
    """
    faces, inverse = cloth.faces, cloth.Dm_inverse
    first = positions[:, faces[:, 1]] - positions[:, faces[:, 0]]
    second = positions[:, faces[:, 2]] - positions[:, faces[:, 0]]
    along = first * inverse[:, 0, 0, None] + second * inverse[:, 1, 0, None]  # columns of F, (T,F,3)
    across = first * inverse[:, 0, 1, None] + second * inverse[:, 1, 1, None]
    mean = 0.5 * ((along**2).sum(-1) + (across**2).sum(-1))
    half = 0.5 * ((along**2).sum(-1) - (across**2).sum(-1))
    radius = np.hypot(half, (along * across).sum(-1))
    return np.sqrt(np.stack([np.maximum(mean - radius, 0.0), mean + radius], axis=-1))


def weighted_percentiles(values: Floats, weights: Floats, percentiles: tuple[int, ...]) -> Floats:
    """Return for each percentile the least of the values that, with all below it, has that share of weight.

    >>> weighted_percentiles(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 8.0]), (5, 50, 95)).tolist()
    [1.0, 2.0, 3.0]
    """
    order = np.argsort(values, axis=None, kind="stable")
    cumulated = np.cumsum(weights.ravel()[order])
    places = np.searchsorted(cumulated, np.array(percentiles) / 100.0 * cumulated[-1])
    return values.ravel()[order][np.minimum(places, len(order) - 1)]
