"""Closest points on the walking body: the tree of `reference_sim.closest_point` beside the AABB of libigl.

The questions are those of a simulation, samples of a T-shirt that follows the walk; libigl, which builds its
tree anew for every frame, is asked on the faces that some sample may meet, and knows no rule of regions. Both
answer in turn, so that a busy machine is as bad to the one as to the other.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.spatial import cKDTree

from reference_sim.closest_point import FaceTree
from reference_sim.energies import ContactPenalty

from ..parts import Row
from .tshirt import dressed

CASES = ("walk, 1000", "walk, 4400")
FRAMES = 12


def measure(case: str, repeats: int) -> list[Row]:
    """Processor time of all threads, medians over frames and repeats; distance between the answers [m]."""
    import igl

    scene = dressed(case)
    obstacle = scene.obstacle
    contact = next(energy for energy in scene.energies if isinstance(energy, ContactPenalty))
    assert obstacle is not None and obstacle.rest_centroids is not None
    home, region, centroids = contact.rest_samples, obstacle.region, obstacle.rest_centroids
    gap, _ = cKDTree(home).query(centroids, distance_upper_bound=region)
    reachable = np.flatnonzero(np.isfinite(gap))
    begun = time.process_time()
    tree = FaceTree(obstacle.faces, centroids)
    rows: list[Row] = [("build, once", 1e3 * (time.process_time() - begun), "ms")]
    seconds: dict[str, list[float]] = {}
    x = contact.sample_matrix @ obstacle.transported(scene.start, 1, scene.cloth.rest_positions)
    faces, apart = None, 0.0
    for frame in range(1, FRAMES + 1):
        vertices = np.asfortranarray(obstacle.at(frame))
        for _ in range(repeats + (frame == 1)):  # the very first compiles
            clock = [time.process_time()]
            tree.refit(vertices)
            clock.append(time.process_time())
            found = tree.nearest(x, hints=faces, rest_points=home, region=region)
            clock.append(time.process_time())
            theirs = igl.AABB()
            theirs.init(vertices, obstacle.faces[reachable])
            clock.append(time.process_time())
            theirs.squared_distance(vertices, obstacle.faces[reachable], np.asfortranarray(x))
            clock.append(time.process_time())
            for name, spent in zip(("refit", "search", "libigl: build", "libigl: search"), np.diff(clock)):
                seconds.setdefault(name, []).append(spent)
        whole = igl.point_mesh_squared_distance(x[::50], vertices, obstacle.faces)[0]
        ours = np.linalg.norm(x[::50] - tree.nearest(x[::50]).points, axis=1)
        apart = max(apart, float(np.abs(ours - np.sqrt(whole)).max()))
        faces = found.faces
        x = obstacle.transported(x, frame + 1, home)
    middle = {name: 1e3 * float(np.median(spent[1:])) for name, spent in seconds.items()}
    rows += [(name, ms, "ms") for name, ms in middle.items()]
    ratio = (middle["libigl: build"] + middle["libigl: search"]) / (middle["refit"] + middle["search"])
    return [*rows, ("libigl over ours, a frame", ratio, "1"), ("answers apart by", apart, "m")]
