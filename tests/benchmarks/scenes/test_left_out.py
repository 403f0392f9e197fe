"""A scene imports nothing that it does not declare."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

from benchmarks.assets import embedded_motions, open_assets
from benchmarks.presets import find_preset
from benchmarks.scenes import of_garment

ROOT = Path(__file__).resolve().parents[3]
DRESSED = """
import dataclasses, pickle, sys
from pathlib import Path
from benchmarks.methods import find_method
from benchmarks.presets import find_preset
from benchmarks.scenes import of_garment
assets, body, start, motion = pickle.loads(Path(sys.argv[1]).read_bytes())
assets = dataclasses.replace(assets, motions={"kick": motion}, bodies={"kick": body})
scene = of_garment("tshirt").scene("kick").at(find_preset("smoke")).build(assets)
method = find_method("lbfgs-5").make(models=Path("."), seed=0)
method.prepare(dataclasses.replace(scene, settle=lambda: start))
assert method.run().frames == 4
print(*sys.modules)
"""
NETWORKS = {"torch", "snug.body.skinning", "snug.networks.dressed_body", "snug.networks.regressor"}


def test_solvers_of_a_dressed_body_load_no_network_library(tmp_path):
    """Whoever poses the joints needs torch; a cell is given the posed body."""
    assets = open_assets(find_preset("smoke"), embedded_motions(["kick"]), ["tshirt"])
    scene = of_garment("tshirt").scene("kick").at(find_preset("smoke")).build(assets)
    motion, path = assets.motions["kick"], tmp_path / "given"
    given = (assets, assets.posed_body(motion)[:4], scene.start, motion.cut(0, 4))
    path.write_bytes(pickle.dumps(given))
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    modules = subprocess.check_output(
        [sys.executable, "-c", DRESSED, str(path)], text=True, env=environment
    )
    assert "reference_sim.obstacle" in modules.split() and not NETWORKS & {*modules.split()}
