"""Time and crossings of a dressed simulation with self-contact and without: `simulator.md` has the numbers.

    python docs/notebook/self_contact.py GARMENT MOTION FRAMES

Prints, for the reference without self-contact and with it, each from its own settled start: CPU time of a
frame, faces that an edge of another triangle passes through (asked of ipctk, not of the project's
metric), vertices inside the body, and the share of frames that converged.
"""

import dataclasses
import sys
import time

import ipctk
import numpy as np

from benchmarks.assets import open_assets
from benchmarks.methods.simulation import Simulation
from benchmarks.presets import find_preset
from benchmarks.scenes import find_garment
from benchmarks.scenes.dressed_body import with_self_contact
from benchmarks.timing import one_thread
from snug.motion.library import make_motion


def faces_cut(x, faces):
    """Return how many faces an edge of another triangle passes through at x (V, 3) [m]."""
    x, faces = np.asfortranarray(x), np.asfortranarray(faces, dtype=np.int32)
    mesh = ipctk.CollisionMesh(x, ipctk.edges(faces), faces)
    search, cut = ipctk.LBVH(), set()
    search.build(x, mesh.edges, mesh.faces, 1e-9)
    for pair in search.detect_edge_face_candidates():
        edge, face = mesh.edges[pair.edge_id], mesh.faces[pair.face_id]
        if not set(edge) & set(face) and ipctk.is_edge_intersecting_triangle(*x[edge], *x[face]):
            cut.add(pair.face_id)
    return len(cut)


def measure(scene, label):
    """Simulate and print one line."""
    method, faces = Simulation(options={}), np.asarray(scene.cloth.faces)
    begun = time.process_time()
    start = scene.start_state
    settling = time.process_time() - begun
    method.prepare(dataclasses.replace(scene, settle=lambda: start, dressed=None))
    begun = time.process_time()
    trajectory = method.run()
    milliseconds = 1e3 * (time.process_time() - begun) / (trajectory.frames - 1)
    cut = [faces_cut(x, faces) for x in trajectory.positions]
    inside = [
        np.mean(scene.obstacle.signed_distance(x, t) < 0) for t, x in enumerate(trajectory.positions)
    ]
    print(
        f"{label}: settled in {settling:.0f} s; {trajectory.frames} frames, {milliseconds:.0f} ms a frame; "
        f"faces cut: {np.mean(cut):.2f} in the mean, {max(cut)} at most, of {len(faces)}; "
        f"{np.mean(inside):.2%} of vertices inside; "
        f"converged in {np.mean(trajectory.frame_fields['converged']):.1%} of frames; "
        f"{trajectory.status} {trajectory.reason}",
        flush=True,
    )


def main():
    """Measure a garment on a motion, with self-contact and without."""
    one_thread()
    garment, motion, frames = sys.argv[1], sys.argv[2], int(sys.argv[3])
    preset = find_preset("quick")
    assets = open_assets(preset, [make_motion(motion)], [garment])
    scene = find_garment(garment).scene(motion).at(preset).build(assets)
    scene = dataclasses.replace(scene, frames=min(frames, scene.frames))
    measure(scene, f"{garment}, {motion}, without")
    apart = with_self_contact(scene.energies)
    scene = dataclasses.replace(scene, minimised=apart, settle=scene.settle_uncrossed)
    measure(scene, f"{garment}, {motion}, with self-contact")


if __name__ == "__main__":
    main()
