"""Files of a user's own, from outside the project: methods, a scene, a metric and a program, as texts."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

from benchmarks import metrics, run
from benchmarks.presets import find_preset
from tests.benchmarks.test_provenance import forget

TINY = dataclasses.replace(find_preset("smoke"), sheet_cells=3, sheet_frames=6)

METHOD = """import numpy as np
from benchmarks import Method, MethodEntry
from reference_sim import Trajectory

METHODS = (MethodEntry(name="still", description="a method", role="solver"),)

class Still(Method):
    def prepare(self, scene):
        self.scene, _ = scene, scene.start  # which is not there where methods are only checked

    def run(self):
        scene = self.scene
        x = np.repeat(np.array(scene.start)[None], scene.frames, axis=0)
        pass
        return Trajectory(x, scene.cloth.faces, np.arange(len(x)) * scene.dt)

def make(*, models, seed):
    method = Still()
    method.seed = seed
    return method
"""
HELPER = "def place(scene, frame):\n    return scene.exact[frame] + {shift}\n"
SCENE_FILE = """
import numpy as np
from benchmarks.scene import BuiltScene, Scene
from reference_sim import Cloth
from reference_sim.energies import Energy

SCENES = (Scene(name="lift", description="a sheet in a constant upward force", sizes=("sheet_frames",)),)

class Lift(Energy):
    name = "lift"

    def __init__(self, cloth):
        self.cloth, self.stencils = cloth, np.arange(cloth.vertex_count)[:, None]

    def element_energy(self, u):
        import torch

        return -(torch.as_tensor(self.cloth.masses).to(u) * u[..., 0, 1])

    def value_and_gradient(self, x):  # and no torch is needed
        return float(-self.cloth.masses @ x[:, 1]), -self.cloth.masses[:, None] * np.array([0.0, 1, 0])

    def hessian_blocks(self, x):
        return np.zeros((len(x), 3, 3))

def build(scene, assets=None, *, sheet_frames):
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
    cloth, dt = Cloth(positions, np.array([[0, 2, 1], [0, 3, 2]])), 0.1
    steps = np.arange(sheet_frames)  # by backward Euler: 1 m/s^2 upwards
    exact = positions + np.array([0.0, 1, 0]) * (dt**2 * steps * (steps + 1) / 2)[:, None, None]
    return BuiltScene(name=scene.name, cloth=cloth, energies=(Lift(cloth),), dt=dt, frames=sheet_frames,
                      settle=lambda: positions, exact=exact)
"""
METRIC_FILE = """
from benchmarks.metric import Metric

METRICS = (
    Metric(name="height/highest", unit="m", title="Highest", definition="of all vertices", table="height"),
)

def measure(roll_out):
    return {"height/highest": float(roll_out.positions[..., 1].max())}
"""
PROGRAM = """
import json, sys
import numpy as np
facts, cloth = json.load(open(sys.argv[1] + "/scene.json")), np.load(sys.argv[1] + "/cloth.npz")
n = np.arange(facts["frames"])
up = np.array([0.0, 1, 0]) * (facts["dt"] ** 2 * n * (n + 1) / 2)[:, None, None]
np.savez(sys.argv[2], positions=cloth["start_positions"] + up, seconds_per_frame=0.002)
"""
PROGRAM_FILE = """
import sys
from pathlib import Path
from benchmarks.methods import METHODS
from benchmarks.methods.outside import program

SCRIPT = Path(__file__).with_name("theirs_run.py")
METHODS = (program("theirs", f"{sys.executable} -I {SCRIPT} {{scene}} {{out}}", files=("theirs_run.py",)),)
"""


def method_by(helper: str, name: str) -> str:
    """Return the text of a method that reads a.txt and puts its vertices where a module beside it says."""
    text = METHOD.replace("import numpy as np", f"import numpy as np\nfrom {helper} import place")
    text = text.replace('"still"', f'"{name}"').replace('"solver"', '"solver", files=("a.txt",)')
    return text.replace("pass", "x = np.stack([place(scene, frame) for frame in range(scene.frames)])")


def as_before():
    """Restore the search path and unload the outside modules after a test that loaded them."""
    path, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        file = getattr(sys.modules[name], "__file__", None) or sys.prefix  # of torch, written in C
        if not file.startswith((str(Path(run.__file__).parent.parent), sys.prefix, *filter(None, path))):
            del sys.modules[name]
    metrics.list_metrics.cache_clear()
    forget()
