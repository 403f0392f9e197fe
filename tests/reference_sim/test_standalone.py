"""The simulator by itself: no heavy package that it does not need."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from reference_sim import Trajectory

ROOT = Path(__file__).resolve().parents[2]
UNNEEDED = (
    "torch", "vtk", "vtkmodules", "pyvista", "typst", "pandas", "matplotlib", "skfem", "meshio", "ipctk",
    "snug", "benchmarks", "reports",
)  # fmt: skip
# A sheet that a rising tetrahedron lifts, with friction, into a file.
SIMULATION = """
import sys
import numpy as np
from reference_sim import Cloth, Obstacle, simulate
from reference_sim.energies import BendHinge, ContactFriction, ContactPenalty, Gravity, StretchStVK
from tests.reference_sim.meshes import grid
sheet, faces = grid(6, 6, width=0.4, depth=0.4)
sheet -= sheet.mean(axis=0)
tip = np.array([[0, -0.01, 0], [0.1, -0.2, 0], [-0.1, -0.2, 0.1], [-0.1, -0.2, -0.1]])
body = np.stack([tip + [0, 0.01 * k, 0] for k in range(4)])
cloth = Cloth(sheet, faces)
contact = ContactPenalty(cloth)
terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth), contact, ContactFriction(contact)]
obstacle = Obstacle(body, np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]))
result = simulate(cloth, terms, frames=4, obstacle=obstacle, tolerance=1e-10)
result.save(sys.argv[1])
assert result.status == "converged", result.reason
assert result.frame_fields["energy/collision"][-1] > 0
print(*sorted(name.split(".")[0] for name, module in sys.modules.items() if module is not None))
"""


def test_a_simulation_loads_no_more_than_it_needs(tmp_path):
    path = tmp_path / "sheet.vtkhdf"
    command = [sys.executable, "-c", SIMULATION, str(path)]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    loaded = set(process.stdout.split())
    assert {"numba", "h5py"} < loaded and loaded.isdisjoint(UNNEEDED)
    assert np.ptp(Trajectory.load(path).positions[:, :, 1]) > 0.01
