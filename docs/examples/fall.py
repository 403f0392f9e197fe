"""Run elsewhere: numpy is all that it needs. Vertices fall as points, pins stay."""

import json
import sys
import time
from pathlib import Path

import numpy as np

scene, out = sys.argv[1:]
facts, cloth = json.loads(Path(scene, "scene.json").read_text()), np.load(f"{scene}/cloth.npz")
clock = time.perf_counter()
x, velocity = cloth["start_positions"], cloth["start_velocities"]
free = np.setdiff1d(np.arange(len(x)), cloth["pins"])
positions = [x]
for frame in range(1, facts["frames"]):
    x, velocity = x.copy(), velocity + facts["dt"] * np.array(facts["gravity"])
    x[free] += facts["dt"] * velocity[free]
    if "pin_positions" in cloth:
        x[cloth["pins"]] = cloth["pin_positions"][frame]
    positions.append(x)
seconds = (time.perf_counter() - clock) / (facts["frames"] - 1)
np.savez(out, positions=np.stack(positions), fps=facts["fps"], seconds_per_frame=seconds)
