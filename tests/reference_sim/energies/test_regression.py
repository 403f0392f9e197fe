"""The energies of four small scenes, term by term and frame by frame, are those kept in energies.csv.

    python -m tests.reference_sim.energies.test_regression

writes the table anew. A change in it is a change of physics or of the minimum that the solver finds: look
at every line of the difference, and say in the commit why it had to be.

Every term of the simulator is in one of them. Each is solved to a tolerance at which the energies are
known to nine digits, and is short enough that round-off does not grow into another wrinkle.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reference_sim import Cloth, Obstacle, Trajectory, simulate
from reference_sim.energies import (
    BendHinge,
    ContactFriction,
    ContactPenalty,
    Gravity,
    StretchSpring,
    StretchStVK,
)
from tests.reference_sim.meshes import grid, sphere

STORE = Path(__file__).with_name("energies.csv")
COLUMNS = ["scene", "frame", "term", "energy [J]"]
TOLERANCE = 1e-10  # of the solver's relative residual


def sheet(cells: int = 7, size: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """A tilted sheet with a nudge at every vertex, so that no step has to choose between mirror images."""
    x, faces = grid(cells, cells, width=size, depth=size)
    x = x - x.mean(axis=0) + np.random.default_rng(5).normal(0, 1e-3, x.shape)
    x[:, 1] += 0.05 * x[:, 0] + 0.03 * x[:, 2]
    return x, faces


def hanging() -> Trajectory:
    """Held at two corners and let go."""
    cloth = Cloth(*sheet(), pins=(0, 7))
    energies = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth, origin_height=-0.1)]
    return simulate(cloth, energies, frames=8, tolerance=TOLERANCE)


def springs() -> Trajectory:
    """Springs along the edges, hinges as the SNUG paper prints them, their rest angles those of a bowl."""
    x, faces = sheet()
    x[:, 1] += 1.5 * (x[:, 0] ** 2 + x[:, 2] ** 2)
    cloth = Cloth(x, faces, pins=range(8))
    bending = BendHinge(cloth, scaling="none", rest_angles="rest")
    return simulate(cloth, [StretchSpring(cloth), bending, Gravity(cloth)], frames=8, tolerance=TOLERANCE)


def ball() -> Trajectory:
    """Dropped onto a ball, with friction."""
    x, faces = sheet()
    cloth = Cloth(x + np.array([0.01, 0.12, 0.005]), faces)
    points, triangles = sphere(4, 0.1)
    contact = ContactPenalty(cloth)
    energies = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), contact, ContactFriction(contact)]
    obstacle = Obstacle(points, triangles)
    return simulate(cloth, energies, frames=6, obstacle=obstacle, guess="previous", tolerance=TOLERANCE)


def carried() -> Trajectory:
    """A sheet on a ball that moves and turns below it, sub-stepped; samples meet only what is near at rest.

    The guess is not the transported one: beside an edge of the ball round-off decides which face carries.
    """
    x, faces = sheet()
    cloth = Cloth(x + np.array([0.0, 0.112, 0.0]), faces)
    points, triangles = sphere(4, 0.1)
    turns = 0.05 * np.arange(6)
    turned = [points @ Rotation.from_euler("y", a).as_matrix().T + [0.2 * a, 0.1 * a, 0.0] for a in turns]
    obstacle = Obstacle(np.stack(turned), triangles, rest_positions=points, region=0.15)
    contact = ContactPenalty(cloth, samples="vertices")
    energies = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), contact]
    options = {"guess": "extrapolated", "tolerance": TOLERANCE}
    return simulate(cloth, energies, frames=6, obstacle=obstacle, substeps=2, **options)


SCENES = {scene.__name__: scene for scene in (hanging, springs, ball, carried)}


def computed(name: str) -> dict[tuple[str, int, str], float]:
    """Energies [J] of a scene by (scene, frame, term), from frame 1 on; raises if one did not converge."""
    trajectory = SCENES[name]()
    if trajectory.status != "converged":
        raise AssertionError(f"{name}: {trajectory.status}: {trajectory.reason}")
    energies = {}
    for field, values in trajectory.frame_fields.items():
        kind, _, term = field.partition("/")
        if kind == "energy":
            energies |= {(name, frame, term): float(v) for frame, v in enumerate(values) if frame}
    return energies


# Round-off of 1e-13 m at the start moves no term by more than 1e-11, another linear solver by 1e-14; the
# solver's own tolerance of 1e-10 is below that. 1e-9 leaves room for other processors.
@pytest.mark.parametrize("scene", SCENES)
def test_the_energies_are_those_that_were_kept(scene, tolerance=1e-9):
    with STORE.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.reader(stream) if row[0] == scene]
    energies = {(name, int(frame), term): float(energy) for name, frame, term, energy in rows}
    new = computed(scene)
    assert new.keys() == energies.keys()
    for (_, frame, term), value in new.items():
        expected = energies[scene, frame, term]
        largest = max(abs(energy) for (_, _, name), energy in energies.items() if name == term)
        assert abs(value - expected) <= tolerance * largest, (
            f"{scene}, frame {frame}: {term} {expected!r} -> {value!r} J; if that is meant: "
            "python -m tests.reference_sim.energies.test_regression"
        )


def main() -> None:
    """Write energies.csv anew."""
    with STORE.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for name in SCENES:
            writer.writerows([*key, repr(value)] for key, value in computed(name).items())


if __name__ == "__main__":
    main()
