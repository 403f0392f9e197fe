"""Initial conditions of stress steps: each start is one line of mathematics.

A start takes the rest positions (V, 3) [m] of a horizontal sheet about the origin, to be overwritten, and a
random generator. Starts that are symmetric to the last bit are saddles of the energy: they are perturbed by
a micrometre and say so, but for `flat` and `point`, which are saddles on purpose.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Start = Callable[[np.ndarray, np.random.Generator], np.ndarray]

NOISE = 2e-3  # [m]
PERTURBATION = 1e-6  # [m], enough to leave a saddle


def noisy(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return positions x (V, 3) [m] with noise of NOISE."""
    return x + random.normal(0, NOISE, x.shape)


def _anywhere(width: float) -> Start:
    return lambda x, random: random.uniform(-width / 2, width / 2, x.shape)


def _scaled(along_x: float, along_z: float) -> Start:
    """Return a start pressed together or pulled apart in its plane, perturbed: exactly flat is a saddle."""
    return lambda x, random: x * [along_x, 1.0, along_z] + random.normal(0, PERTURBATION, x.shape)


def _folded(angle: float) -> Start:
    """Return a start whose half x > 0 is turned up about the z axis by `angle` [rad], perturbed."""

    def start(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
        arm = np.maximum(x[:, 0], 0.0)
        x[:, 0] += arm * (np.cos(angle) - 1.0)
        x[:, 1] += arm * np.sin(angle)
        return x + random.normal(0, PERTURBATION, x.shape)

    return start


def pleated(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a row of folds, up and down by turns, each of 89 degrees to the horizontal, perturbed."""
    angle = np.deg2rad(89.0)
    columns = np.round((x[:, 0] / np.ptp(x[:, 0]) + 0.5) * 8)
    x[:, 1] = 0.05 * np.sin(angle) * (columns % 2)
    x[:, 0] *= np.cos(angle)
    return x + random.normal(0, PERTURBATION, x.shape)


def rolled_up(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return positions rolled up tightly in three turns around the z axis, through itself, perturbed."""
    angle = 2 * np.pi * 3.0 * x[:, 0] / np.ptp(x[:, 0])
    radius = np.ptp(x[:, 0]) / (2 * np.pi * 3.0)
    x[:, 0], x[:, 1] = radius * np.sin(angle), radius * (1 - np.cos(angle))
    return x + random.normal(0, PERTURBATION, x.shape)


def twisted(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return positions turned about the x axis, by more and more along it up to two turns, perturbed."""
    angle = 2 * np.pi * 2.0 * (x[:, 0] / np.ptp(x[:, 0]) + 0.5)
    x[:, 1], x[:, 2] = x[:, 2] * np.sin(angle), x[:, 2] * np.cos(angle)
    return x + random.normal(0, PERTURBATION, x.shape)


def spike(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a noisy start with one vertex 10 m away."""
    x[40] += [0.0, 10.0, 0.0]
    return noisy(x, random)


def shuffled(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return every vertex in the place of another: as tangled as the rest shape allows."""
    return noisy(x[random.permutation(len(x))], random)


def collapsed_triangle(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return a noisy start with two neighbours at one place: their hinges have no angle."""
    x = noisy(x, random)
    x[41] = x[40]
    return x


INITIAL_POSITIONS: dict[str, Start] = {
    "noisy": noisy,
    "flat": lambda x, random: x,
    "very noisy": lambda x, random: x + random.normal(0, 0.05, x.shape),
    "anywhere": _anywhere(0.4),
    "anywhere in 40 m": _anywhere(40.0),
    "squeezed to 50 %": _scaled(0.5, 1.0),
    "squeezed to 30 %": _scaled(0.3, 1.0),
    "squeezed to 30 % both ways": _scaled(0.3, 0.3),
    "a thousandth": _scaled(1e-3, 1e-3),
    "stretched to 200 %": _scaled(2.0, 1.0),
    "stretched to 1000 %": _scaled(10.0, 10.0),
    "mirrored": _scaled(-1.0, 1.0),
    "point": lambda x, random: np.zeros_like(x),
    "nearly a point": lambda x, random: random.normal(0, 1e-9, x.shape),
    "line": lambda x, random: x * [1.0, 1.0, 0.0] + random.normal(0, PERTURBATION, x.shape),
    "folded by 180": _folded(np.pi),
    "folded past 180": _folded(np.pi * 1.03),
    "pleated by 89": pleated,
    "rolled up": rolled_up,
    "twisted": twisted,
    "spike": spike,
    "shuffled": shuffled,
    "collapsed triangle": collapsed_triangle,
    "a kilometre away": lambda x, random: noisy(x + np.array([1e3, 0.0, 0.0]), random),
}


def _slivers(x: np.ndarray) -> np.ndarray:
    """Return the sheet a ten-thousandth as wide as long: every triangle a sliver."""
    return x * [1.0, 1.0, 1e-4]


def _one_sliver_row(x: np.ndarray) -> np.ndarray:
    """Return the sheet with one row of cells of aspect 1e4 between even ones."""
    column = np.round((x[:, 0] / np.ptp(x[:, 0]) + 0.5) * 8)
    width = np.ptp(x[:, 0]) / 8
    x[:, 0] = np.where(column == 4, np.ptp(x[:, 0]) * (3 / 8 - 0.5) + 1e-4 * width, x[:, 0])
    x[:, 0] = np.where(column == 3, -width, x[:, 0])
    return x


def _bowl(x: np.ndarray) -> np.ndarray:
    x[:, 1] = 2.0 * (x[:, 0] ** 2 + x[:, 2] ** 2)
    return x


REST_SHAPES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "even": lambda x: x,
    "slivers": _slivers,
    "sliver row": _one_sliver_row,
    "bowl": _bowl,
}

VELOCITIES: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {  # of positions and rest positions
    "thrown at 100 m/s": lambda x, rest: np.tile([60.0, 80.0, 0.0], (len(x), 1)),
    "falling at 90 m/s": lambda x, rest: np.tile([0.0, -90.0, 0.0], (len(x), 1)),
    "spinning at 500 rad/s": lambda x, rest: 500.0 * np.cross([0.0, 1.0, 0.0], x),
    "closing at 30 rad/s": lambda x, rest: np.outer(-30.0 * np.maximum(rest[:, 0], 0.0), [0.0, 1.0, 0.0]),
    "halves apart at 100 m/s": lambda x, rest: np.outer(100.0 * np.sign(x[:, 0]), [1.0, 0.0, 0.0]),
}


def initial_velocities(
    speed: float | str, x: np.ndarray, rest: np.ndarray, random: np.random.Generator
) -> np.ndarray:
    """Return velocities (V, 3) [m/s] at positions x: a named field, or noise of that scale."""
    return VELOCITIES[speed](x, rest) if isinstance(speed, str) else random.normal(0, 1.0, x.shape) * speed
