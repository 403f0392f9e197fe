"""Markers on a sheet that motion capture follows: the curvature at each, and how far repeated trials differ.

    k = full angle - sum of the angles between neighbours   [rad]

is the Gaussian curvature of the markers' mesh, integrated around a marker (angle deficit). It does not
depend on where the sheet is or how it is turned. The full angle is 2 pi inside, pi on an edge, pi/2 at a
corner, as in GAUGE (Wang et al. 2026, doi 10.48550/arXiv.2608.05948, equations 13 and 14).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FULL_ANGLES = {"inner": 2 * np.pi, "edge": np.pi, "corner": np.pi / 2}  # [rad] of a flat sheet


@dataclass(frozen=True, eq=False)
class Markers:
    """Markers and their mesh.

    Attributes:
        rest: positions (M, 3) [m] on the sheet at rest.
        angles: (K, 3), an angle each: the marker where it lies, and its two neighbours.
        full: (M,) [rad], angle around each marker of a flat sheet.
    """

    rest: np.ndarray
    angles: np.ndarray
    full: np.ndarray

    def curvature(self, x: np.ndarray) -> np.ndarray:
        """Return the curvature (..., M) [rad] at the markers x (..., M, 3) [m].

        A marker in the middle of a line that bends by 0.1 rad there:

        >>> line = Markers(np.zeros((3, 3)), np.array([[1, 0, 2]]), np.array([0.0, np.pi, 0.0]))
        >>> x = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [np.cos(0.1), np.sin(0.1), 0.0]])
        >>> line.curvature(x).round(3).tolist()
        [0.0, 0.1, 0.0]
        """
        corner, one, other = np.moveaxis(x[..., self.angles, :], -2, 0)
        a, b = one - corner, other - corner
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))
        at_marker = np.arange(len(self.full)) == self.angles[:, :1]
        return self.full - angle @ at_marker.astype(float)


def deviations(trials: Sequence[np.ndarray]) -> np.ndarray:
    """Return how far each trial is from the mean of all (N,), in the unit of its values.

    The deviation is that of GAUGE's equation 2, with M values a frame summed and T frames averaged:

        E = (mean over t of |g(t) - mean trial(t)|^2)^(1/2)

    The mean of E over the trials is the experiment's repeatability, in whose units GAUGE gives errors.

    Args:
        trials: values (T, M) each; where T differs, as many frames as the shortest has.

    Raises:
        ValueError: fewer than two trials.

    >>> deviations([np.array([[0.0], [0.0]]), np.array([[2.0], [0.0]])]).round(3).tolist()
    [0.707, 0.707]
    """
    if len(trials) < 2:
        raise ValueError(f"{len(trials)} trials: at least two tell how well an experiment repeats")
    frames = min(map(len, trials))
    values = np.stack([trial[:frames] for trial in trials])
    return np.sqrt(((values - values.mean(axis=0)) ** 2).sum(axis=2).mean(axis=1))
