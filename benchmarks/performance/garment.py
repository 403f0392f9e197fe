"""Microbenchmark garment/*: a T-shirt on a moving body."""

from __future__ import annotations

import dataclasses

import numpy as np

from benchmarks.assets.assets import embedded_motions, open_assets
from benchmarks.methods.solvers.simulation import Simulation
from benchmarks.metrics.surface.penetration_and_distances import DEEP, penetration
from benchmarks.performance.microbenchmark import Settings
from benchmarks.presets import find_preset
from benchmarks.scene import BuiltScene
from benchmarks.scenes import of_garment
from snug.garments.templates import TSHIRT

FRAMES = 60


def dressed(motion: str, vertices: int) -> BuiltScene:
    """Build the scene of an embedded motion, cut to FRAMES frames."""
    preset = dataclasses.replace(find_preset("quick"), garment_vertices=vertices, frames=FRAMES)
    assets = open_assets(preset, embedded_motions([motion]), [TSHIRT])
    return of_garment(TSHIRT).scene(motion).at(preset).build(assets)


def measure(settings: Settings, *, motion: str, vertices: int) -> dict[str, float]:
    """Return median and worst frame, convergence and penetration."""
    scene = dressed(motion, vertices)
    assert scene.obstacle is not None
    simulation = Simulation(options={})
    simulation.prepare(scene)
    medians, worst = [], []
    for _ in range(settings.repeats):
        trajectory = simulation.run()
        medians.append(np.median(trajectory.frame_seconds[1:]))
        worst.append(trajectory.frame_seconds.max())
    fields = trajectory.frame_fields
    depth = penetration([trajectory.positions], [trajectory.faces], scene.obstacle)[0].depth
    return {
        "vertices": scene.cloth.vertex_count,
        "frame": 1e3 * float(np.median(medians)),
        "frame_worst": 1e3 * float(np.median(worst)),
        "iterations": float(np.median(fields["iterations"][1:])),
        "iterations_worst": float(fields["iterations"].max()),
        "converged_frames": 100.0 * float(fields["converged"].sum()) / trajectory.frames,
        "penetrating_vertices": 100.0 * float((depth > 0).mean()),
        "deep_vertices": 100.0 * float((depth > DEEP).mean()),
        "depth_p999": 1e3 * float(np.quantile(depth, 0.999)),
    }
