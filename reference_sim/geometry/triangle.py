"""Closest point of a triangle, the same to the bit for all triangles that share the side or corner."""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.kernel_cache import njit

SLIVER = 1e-3  # squared sine of a triangle's first angle, below which all of its sides are tried


@njit(cache=True, error_model="numpy")
def _on_side(a0, a1, a2, b0, b1, b2, x, y, z):
    """Return the share of the side from corner a to b that is closest to a point, and the distance squared.

    The same bits for every face that has the side, and the same for every side that ends in the corner.
    """
    r0, r1, r2 = x - a0, y - a1, z - a2
    s0, s1, s2 = b0 - a0, b1 - a1, b2 - a2
    along, length = s0 * r0 + s1 * r1 + s2 * r2, s0 * s0 + s1 * s1 + s2 * s2
    if along <= 0.0:
        return 0.0, r0 * r0 + r1 * r1 + r2 * r2
    if along >= length:
        r0, r1, r2 = x - b0, y - b1, z - b2
        return 1.0, r0 * r0 + r1 * r1 + r2 * r2
    share = along / length
    q0, q1, q2 = r0 - share * s0, r1 - share * s1, r2 - share * s2
    return share, q0 * q0 + q1 * q1 + q2 * q2


@njit(cache=True, error_model="numpy")
def _closest(a0, a1, a2, b0, b1, b2, c0, c1, c2, x, y, z):
    r0, r1, r2 = x - a0, y - a1, z - a2
    s0, s1, s2 = b0 - a0, b1 - a1, b2 - a2
    t0, t1, t2 = c0 - a0, c1 - a1, c2 - a2
    ss, tt, st = s0 * s0 + s1 * s1 + s2 * s2, t0 * t0 + t1 * t1 + t2 * t2, s0 * t0 + s1 * t1 + s2 * t2
    sr, tr = s0 * r0 + s1 * r1 + s2 * r2, t0 * r0 + t1 * r1 + t2 * r2
    det, v, w = ss * tt - st * st, tt * sr - st * tr, ss * tr - st * sr
    u = det - v - w
    best, best_v, best_w = np.inf, 0.0, 0.0
    sliver = not det > SLIVER * ss * tt
    if det > 0.0 and u >= 0.0 and v >= 0.0 and w >= 0.0:
        best_v, best_w = v / det, w / det
        q0 = r0 - best_v * s0 - best_w * t0
        q1 = r1 - best_v * s1 - best_w * t1
        q2 = r2 - best_v * s2 - best_w * t2
        best = q0 * q0 + q1 * q1 + q2 * q2
        if not sliver:
            return best_v, best_w, best
    if w < 0.0 or sliver:
        share, distance = _on_side(a0, a1, a2, b0, b1, b2, x, y, z)
        if distance < best:
            best, best_v, best_w = distance, share, 0.0
    if v < 0.0 or sliver:
        share, distance = _on_side(a0, a1, a2, c0, c1, c2, x, y, z)
        if distance < best:
            best, best_v, best_w = distance, 0.0, share
    if u < 0.0 or sliver:
        share, distance = _on_side(b0, b1, b2, c0, c1, c2, x, y, z)
        if distance < best:
            best, best_v = distance, 1.0 - share
            best_w = 1.0 - best_v  # so that the first weight, 1 - v - w, is exactly zero
    return best_v, best_w, best


@njit(cache=True, error_model="numpy")
def closest_on_triangle(corners, place, x, y, z):
    """Find the closest point of triangle corners[place] to a point (x, y, z).

    It is the foot of the perpendicular, where that lies inside; else the best of the sides that the foot is
    beyond, one of which holds the closest point. Of a sliver, whose foot is too inexact to tell, all sides.

    Returns:
        Weights v, w of the second and third corner at the closest point, and the squared distance to it.
    """
    # As numbers: a function with several ends counts the references to an array at every call.
    return _closest(
        np.float64(corners[place, 0, 0]), np.float64(corners[place, 0, 1]), np.float64(corners[place, 0, 2]),
        np.float64(corners[place, 1, 0]), np.float64(corners[place, 1, 1]), np.float64(corners[place, 1, 2]),
        np.float64(corners[place, 2, 0]), np.float64(corners[place, 2, 1]), np.float64(corners[place, 2, 2]),
        x, y, z,
    )  # fmt: skip
