"""Kernels of the contact cache: normals of the skin, energy of all samples, walk of their anchors.

An anchor moves as a bead on the skin would: to the foot of its sample on the anchor's face and, where the
foot is outside, over a side that it is outside of onto the next face, until a foot is inside or a side or
a corner is closest. It cannot find skin of another limb, a thigh that comes up through the hem: that takes
a search (snug.training.contact_cache).
"""

from __future__ import annotations

import igl
import numpy as np

from reference_sim.geometry.leaf_bounds import closest_on_triangle
from reference_sim.kernels.fast_kernels import GUARDED, LANES
from reference_sim.kernels.kernel_cache import njit
from reference_sim.kernels.lanes import add_lanes, copy_lanes, mix_rows

WALK_SLACK = 0.001  # m: beyond the margin, and still followed
CROSSINGS = 12  # sides that an anchor may cross at a time: some 15 cm


def triangle_adjacency(faces: np.ndarray) -> np.ndarray:
    """Return (Q, 3) int32 for faces (Q, 3): the face across the side opposite to each corner, or -1."""
    across, _ = igl.triangle_triangle_adjacency(faces)  # of the sides from each corner to the next
    return np.ascontiguousarray(across[:, [1, 2, 0]], np.int32)


@njit(cache=True, inline="always", error_model="numpy")  # a call costs as much as a walk
def walk_to_foot(
    x0: np.float32,
    x1: np.float32,
    x2: np.float32,
    face: np.uint32,
    skin: np.ndarray,
    faces: np.ndarray,
    adjacency: np.ndarray,
    centroids: np.ndarray,
    homes: np.ndarray,
    sample: int,
    reach: np.float32,
    corners: np.ndarray,
) -> tuple[np.uint32, np.float32, np.float32]:
    """Return the face, and weights of its second and third corner, where an anchor rests for a sample at x.

    It starts on `face` of the body: skin (B, 3) [m] and faces (Q, 3). It enters no face whose centroid at
    rest is farther than the root of `reach` [m^2] from homes (S, 3), the samples at rest. corners (1, 3,
    3) is room to work in.
    """
    last, zero, one = face, np.float32(0.0), np.float32(1.0)
    for _ in range(CROSSINGS):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        o0, o1, o2 = skin[i, 0], skin[i, 1], skin[i, 2]
        s0, s1, s2 = skin[j, 0] - o0, skin[j, 1] - o1, skin[j, 2] - o2
        t0, t1, t2 = skin[k, 0] - o0, skin[k, 1] - o1, skin[k, 2] - o2
        r0, r1, r2 = x0 - o0, x1 - o1, x2 - o2
        ss = s0 * s0 + s1 * s1 + s2 * s2
        tt = t0 * t0 + t1 * t1 + t2 * t2
        st = s0 * t0 + s1 * t1 + s2 * t2
        sr, tr = s0 * r0 + s1 * r1 + s2 * r2, t0 * r0 + t1 * r1 + t2 * r2
        determinant = ss * tt - st * st
        v, w = (tt * sr - st * tr) / determinant, (ss * tr - st * sr) / determinant
        u = one - v - w
        if u >= zero and v >= zero and w >= zero:
            return face, v, w
        side = 0 if u <= v and u <= w else 1 if v <= w else 2
        other = adjacency[face, side]
        if other < 0 or np.uint32(other) == last:
            break
        d0 = centroids[other, 0] - homes[sample, 0]
        d1 = centroids[other, 1] - homes[sample, 1]
        d2 = centroids[other, 2] - homes[sample, 2]
        if d0 * d0 + d1 * d1 + d2 * d2 > reach:
            break
        last, face = face, np.uint32(other)
    for corner in range(3):
        for axis in range(3):
            corners[0, corner, axis] = skin[faces[face, corner], axis]
    v64, w64, _ = closest_on_triangle(corners, 0, np.float64(x0), np.float64(x1), np.float64(x2))
    return face, np.float32(v64), np.float32(w64)


PARTS = 255.0  # of a barycentric coordinate


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def byte_normals(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return vertex normals of positions (N, P, 3) as int8, 127 times unit length, see Patch.normals.

    Normals of faces are summed up in the order of the faces, LANES frames side by side.
    """
    L, (count, vertices, _) = LANES, positions.shape
    size, points, normals = 3 * vertices, positions.ravel(), np.empty(positions.shape, np.int8)
    skin, sums, out = np.empty(size * L, np.float32), np.empty(size * L, np.float32), normals.ravel()
    u, rounded = np.empty(9 * L, np.float32), np.empty(3 * L, np.int8)
    for start in range(0, count, L):
        lanes = min(L, count - start)
        for i in range(size):
            for n in range(L):
                skin[L * i + n] = points[size * (start + min(n, lanes - 1)) + i]
        sums[:] = np.float32(0.0)
        for f in range(len(faces)):
            for corner in range(3):
                for axis in range(3):
                    copy_lanes(skin, 3 * faces[f, corner] + axis, u, 3 * corner + axis)
            for n in range(L):
                ax, ay, az = u[3 * L + n] - u[n], u[4 * L + n] - u[L + n], u[5 * L + n] - u[2 * L + n]
                bx, by, bz = u[6 * L + n] - u[n], u[7 * L + n] - u[L + n], u[8 * L + n] - u[2 * L + n]
                u[n], u[L + n], u[2 * L + n] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            for corner in range(3):
                for axis in range(3):
                    add_lanes(u, axis, sums, 3 * faces[f, corner] + axis)
        for v in range(vertices):
            for axis in range(3):
                copy_lanes(sums, 3 * v + axis, u, axis)
            for n in range(L):
                x, y, z = u[n], u[L + n], u[2 * L + n]
                factor = np.float32(127.0) / (np.sqrt(x * x + y * y + z * z) + np.float32(1e-30))
                u[n] = np.rint(factor * x)
                u[L + n] = np.rint(factor * y)
                u[2 * L + n] = np.rint(factor * z)
            for n in range(3 * L):
                rounded[n] = u[n]
            for n in range(lanes):
                for axis in range(3):
                    out[size * (start + n) + 3 * v + axis] = rounded[axis * L + n]
    return normals


@njit(cache=True, inline="always", error_model="numpy")
def _height(
    x0: np.float32,
    x1: np.float32,
    x2: np.float32,
    skin: np.ndarray,
    m: np.ndarray,
    faces: np.ndarray,
    face: np.uint32,
    parts: np.ndarray,
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Height of a sample above its anchor's plane, times the length of the normal; and that normal.

    skin, m: positions and normals of the body, flat as `mix_rows` wants them.
    """
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    unit = np.float32(1.0) / np.float32(PARTS)
    v, w = unit * np.float32(parts[0]), unit * np.float32(parts[1])
    u = np.float32(1.0) - v - w
    c0, c1, c2 = mix_rows(skin, i, j, k, u, v, w)
    n0, n1, n2 = mix_rows(m, i, j, k, u, v, w)
    return n0 * (x0 - c0) + n1 * (x1 - c1) + n2 * (x2 - c2), n0, n1, n2


@njit(cache=True, error_model="numpy", fastmath=GUARDED)
def contact_energy(
    x: np.ndarray, stencils: np.ndarray, weights: np.ndarray, stiffness: np.ndarray, margin: np.float32,
    power: int, frames: np.ndarray, rows: np.ndarray, positions: np.ndarray, normals: np.ndarray,
    faces: np.ndarray, adjacency: np.ndarray, centroids: np.ndarray, homes: np.ndarray, region: np.float32,
    slack: np.float32, walk: bool, anchor_faces: np.ndarray, barycentric: np.ndarray, values: np.ndarray,
    gradients: np.ndarray,
) -> None:  # fmt: skip
    """Sum k max(margin - d, 0)^power over samples into values (C, LANES); add gradients like x.

    x (C, V, 3, LANES); frames, rows (N, T). stencils, faces: uint32, for a signed index is first
    tested whether it counts from the end. Most samples are out of reach, and for them the loads cost
    most: all that they read of a frame is first laid together.
    """
    # Normals have 127 times unit length, within 0.9 by rounding.
    reach = np.float32(128.0) * (margin + slack if walk else margin)
    zero, corners = np.float32(0.0), np.empty((1, 3, 3))
    vertices, size = x.shape[1], 3 * positions.shape[1]
    garment = np.zeros(3 * vertices + 1, np.float32)
    skin, m = np.zeros(size + 1, np.float32), np.zeros(size + 1, np.float32)
    for n in range(frames.size):
        frame, window = divmod(n, len(frames))
        block, lane = divmod(n, LANES)
        for v in range(vertices):
            for c in range(3):
                garment[3 * v + c] = x[block, v, c, lane]
        body = positions[rows[window, frame]]
        points, directions = body.ravel(), normals[rows[window, frame]].ravel()
        for c in range(len(points)):
            skin[c], m[c] = points[c], directions[c]
        anchors, parts = anchor_faces[frames[window, frame]], barycentric[frames[window, frame]]
        total = 0.0
        for s in range(len(stencils)):
            face = np.uint32(anchors[s])
            a, b, c = stencils[s, 0], stencils[s, 1], stencils[s, 2]
            p, q, r = weights[s, 0], weights[s, 1], weights[s, 2]
            x0, x1, x2 = mix_rows(garment, a, b, c, p, q, r)
            along, n0, n1, n2 = _height(x0, x1, x2, skin, m, faces, face, parts[s])
            if along >= reach:
                continue
            if walk and along < reach:  # not a sample that is no number
                face, v, w = walk_to_foot(
                    x0, x1, x2, face, body, faces, adjacency, centroids, homes, s, region, corners
                )
                anchors[s] = face
                parts[s, 0] = np.uint8(np.rint(np.float32(PARTS) * v))
                third = np.rint(np.float32(PARTS) * w)
                parts[s, 1] = np.uint8(min(third, np.float32(PARTS) - np.float32(parts[s, 0])))
                along, n0, n1, n2 = _height(x0, x1, x2, skin, m, faces, np.uint32(anchors[s]), parts[s])
            length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2) + np.float32(1e-30)
            depth = margin - along / length
            if depth <= zero:
                continue
            force = stiffness[s]
            for _ in range(power - 1):
                force *= depth
            total += force * depth
            force *= -np.float32(power) / length
            for corner, share in ((a, p), (b, q), (c, r)):
                gradients[block, corner, 0, lane] += share * force * n0
                gradients[block, corner, 1, lane] += share * force * n1
                gradients[block, corner, 2, lane] += share * force * n2
        values[block, lane] = total
