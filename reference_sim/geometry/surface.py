"""Surface of a triangle mesh: normals, contact planes, carried points, winding numbers."""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.kernel_cache import njit

# Weight of a corner below which a place is on a side; weights may be rounded to float32.
ON_SIDE = 1e-6
# [m] diameter, of a limb: what the surface is taken for beside the faces that a sample may meet.
TANGENT_BALL = 0.1
# cosine to a face, of an offset that leads over it: above the round-off of a foot on a side
BEYOND = 1e-3


@njit(cache=True, error_model="numpy")
def cross_of_face(x, i, j, k):
    """Return twice the area of a triangle of positions x (V, 3) times its normal."""
    a0, a1, a2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
    b0, b1, b2 = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


@njit(cache=True, error_model="numpy")
def vertex_normals(positions, faces):
    """Return unit normals (B, 3) of vertices (B, 3) [m]: of the faces (F, 3) around, weighted by area."""
    normals = np.zeros_like(positions)
    for f in range(len(faces)):
        n = cross_of_face(positions, faces[f, 0], faces[f, 1], faces[f, 2])
        for a in range(3):
            for c in range(3):
                normals[faces[f, a], c] += n[c]
    for v in range(len(normals)):
        normals[v, 0], normals[v, 1], normals[v, 2], _ = _unit(
            normals[v, 0], normals[v, 1], normals[v, 2]
        )
    return normals


def faces_around(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces of (F, 3) around each of `count` vertices: around[starts[v] : starts[v + 1]]."""
    order = np.argsort(faces, axis=None, kind="stable")
    return np.searchsorted(faces.ravel()[order], np.arange(count + 1)), order // 3


@njit(cache=True, error_model="numpy")
def normals_of_corners(subset, positions, faces, starts, around):
    """Return the `vertex_normals` (B, 3) of the corners of a subset (n,) of faces; all others stay unset.

    starts, around: see `faces_around`.
    """
    normals, is_set = np.empty_like(positions), np.zeros(len(positions), np.bool_)
    for s in subset:
        for a in range(3):
            v = faces[s, a]
            if is_set[v]:
                continue
            is_set[v] = True
            x, y, z = 0.0, 0.0, 0.0
            for place in range(starts[v], starts[v + 1]):
                f = around[place]
                n = cross_of_face(positions, faces[f, 0], faces[f, 1], faces[f, 2])
                x, y, z = x + n[0], y + n[1], z + n[2]
            normals[v, 0], normals[v, 1], normals[v, 2], _ = _unit(x, y, z)
    return normals


@njit(cache=True, error_model="numpy")
def _unit(x, y, z):
    """Return the unit vector along (x, y, z), and its length."""
    length = np.sqrt(x * x + y * y + z * z) + 1e-30
    return x / length, y / length, z / length, length


@njit(cache=True, error_model="numpy")
def _leads_nearer(offset, c, face, weights, vertices, faces, starts, around):
    """Return whether some face at c leads nearer along the unit offset; c is on a side or a corner of one."""
    sharing, lowest, corner = 0, 0.0, face[np.argmax(weights)]
    for f in around[starts[corner] : starts[corner + 1]]:
        shared = True
        for a in range(3):
            v = face[a]
            shared &= weights[a] <= ON_SIDE or v == faces[f, 0] or v == faces[f, 1] or v == faces[f, 2]
        if not shared:
            continue
        sharing += 1
        for a in range(3):
            along, squared = 0.0, 0.0
            for i in range(3):
                way = vertices[faces[f, a], i] - c[i]
                along += offset[i] * way
                squared += way * way
            if along > BEYOND * np.sqrt(squared):
                return True
            lowest = min(lowest, along + BEYOND * np.sqrt(squared))
    return sharing == 1 and lowest < 0.0  # over the border of the mesh itself


@njit(cache=True, error_model="numpy")
def plane_normals(points, closest, closest_faces, barycentric, vertices, faces, starts, around, normals):
    """Write the normals (S, 3) from the closest points to the samples, turned outwards.

    Returns the samples (n,) farther than TANGENT_BALL whose normal was tilted away from their offset.

    A sample that looks along the surface, or is below it and beyond the border of the faces that it may
    meet (another face at the closest point c leads nearer), meets a ball that touches the surface in c
    from below: the normal points to the sample from the ball's point opposite to c. starts, around: see
    `faces_around`.
    """
    of_vertices = normals_of_corners(closest_faces, vertices, faces, starts, around)
    tilted, count = np.empty(len(points), np.int64), 0
    for s in range(len(points)):
        i, j, k = faces[closest_faces[s], 0], faces[closest_faces[s], 1], faces[closest_faces[s], 2]
        u, v, w = barycentric[s, 0], barycentric[s, 1], barycentric[s, 2]
        m0 = u * of_vertices[i, 0] + v * of_vertices[j, 0] + w * of_vertices[k, 0]
        m1 = u * of_vertices[i, 1] + v * of_vertices[j, 1] + w * of_vertices[k, 1]
        m2 = u * of_vertices[i, 2] + v * of_vertices[j, 2] + w * of_vertices[k, 2]
        m0, m1, m2, _ = _unit(m0, m1, m2)  # of the smooth surface
        x, y, z, length = _unit(
            points[s, 0] - closest[s, 0], points[s, 1] - closest[s, 1], points[s, 2] - closest[s, 2]
        )
        cosine, o0, o1, o2 = x * m0 + y * m1 + z * m2, x, y, z
        # Within a micrometre, or looking along the surface, the offset has no direction to trust.
        untrusted = not (length > 1e-6 and np.abs(cosine) > 0.3)
        if cosine < -0.3 and min(u, v, w) <= ON_SIDE:
            face = faces[closest_faces[s]]
            untrusted |= _leads_nearer(
                (x, y, z), closest[s], face, barycentric[s], vertices, faces, starts, around
            )
        if untrusted:
            ball, outwards = max(TANGENT_BALL, 1.5 * length), 1.0  # below c is in it, however deep
            x, y, z, _ = _unit(ball * m0 + length * x, ball * m1 + length * y, ball * m2 + length * z)
        else:
            outwards = np.sign(cosine)
            if min(u, v, w) > 0.0:  # inside the face: its normal has no cancellation
                n = cross_of_face(vertices, i, j, k)
                side = np.sign(n[0] * x + n[1] * y + n[2] * z)
                x, y, z, _ = _unit(side * n[0], side * n[1], side * n[2])
        x, y, z = outwards * x, outwards * y, outwards * z
        normals[s, 0], normals[s, 1], normals[s, 2] = x, y, z
        # Also by little: it would be met within the step.
        if length > TANGENT_BALL and x * o0 + y * o1 + z * o2 < 0.99:
            tilted[count] = s
            count += 1
    return tilted[:count]


@njit(cache=True, error_model="numpy")
def _frame_of_face(x, i, j, k, axes):
    """Write the orthonormal axes (3, 3) of a triangle, in rows; the last is its normal."""
    for c in range(3):
        axes[0, c] = x[j, c] - x[i, c]
    axes[2, 0], axes[2, 1], axes[2, 2] = cross_of_face(x, i, j, k)
    for a in (0, 2):
        axes[a, 0], axes[a, 1], axes[a, 2], _ = _unit(axes[a, 0], axes[a, 1], axes[a, 2])
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        axes[1, c] = axes[2, d] * axes[0, e] - axes[2, e] * axes[0, d]


@njit(cache=True, error_model="numpy")
def carry(points, closest, closest_faces, barycentric, start, end, faces, carried):
    """Write into carried (N, 3) the points beside their closest faces, which go from `start` to `end`."""
    source, target = np.empty((3, 3)), np.empty((3, 3))
    for s in range(len(points)):
        i, j, k = faces[closest_faces[s], 0], faces[closest_faces[s], 1], faces[closest_faces[s], 2]
        _frame_of_face(start, i, j, k, source)
        _frame_of_face(end, i, j, k, target)
        u, v, w = barycentric[s, 0], barycentric[s, 1], barycentric[s, 2]
        for c in range(3):
            carried[s, c] = u * end[i, c] + v * end[j, c] + w * end[k, c]
        for a in range(3):
            local = 0.0
            for c in range(3):
                local += source[a, c] * (points[s, c] - closest[s, c])
            for c in range(3):
                carried[s, c] += target[a, c] * local


def winding_numbers(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how often a closed mesh of vertices (B, 3) winds around points (P, 3) [m]: (P,).

    Faces are wound outwards; a point on the surface counts as one beside it. Rays run along the shortest
    side of the mesh's bounding box; a grid over the other two axes has the faces that a ray may meet. A ray
    through a side or a corner is moved by less than any number, the same way for all faces.
    """
    numbers = np.zeros(len(points), np.int64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    rows = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    if len(rows) == 0:
        return numbers
    along = int(np.argmin(high - low))
    axes = [(along + 1) % 3, (along + 2) % 3, along]  # the ray runs along the last
    x, rays = np.ascontiguousarray(vertices[:, axes]), np.ascontiguousarray(points[rows][:, axes])
    sides = np.maximum((high - low)[axes[:2]], np.finfo(float).tiny)
    # As many as faces.
    cells = np.maximum(np.sqrt(len(faces) * sides / sides[::-1]), 1.0).astype(np.int64)
    starts, hits = _faces_of_cells(x, faces, low[axes], cells / sides, cells)
    numbers[rows] = _crossings(x, faces, rays, low[axes], cells / sides, cells, starts, hits)
    return numbers


@njit(cache=True, error_model="numpy")
def _cell(value, low, scale, count):
    return min(max(int((value - low) * scale), 0), count - 1)


@njit(cache=True, error_model="numpy")
def _faces_of_cells(x, faces, low, scale, cells):
    """Return starts (C + 1,) and faces of each cell that their boxes touch, cell by cell."""
    starts = np.zeros(cells[0] * cells[1] + 1, np.int64)
    box = np.empty((len(faces), 4), np.int64)
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for c in range(2):
            box[f, c] = _cell(min(x[i, c], x[j, c], x[k, c]), low[c], scale[c], cells[c])
            box[f, 2 + c] = _cell(max(x[i, c], x[j, c], x[k, c]), low[c], scale[c], cells[c])
        for u in range(box[f, 0], box[f, 2] + 1):
            for v in range(box[f, 1], box[f, 3] + 1):
                starts[u * cells[1] + v + 1] += 1
    for cell in range(len(starts) - 1):
        starts[cell + 1] += starts[cell]
    hits, filled = np.empty(starts[-1], np.int64), starts[:-1].copy()
    for f in range(len(faces)):
        for u in range(box[f, 0], box[f, 2] + 1):
            for v in range(box[f, 1], box[f, 3] + 1):
                hits[filled[u * cells[1] + v]] = f
                filled[u * cells[1] + v] += 1
    return starts, hits


@njit(cache=True, error_model="numpy")
def _area(x, i, j, u, v):
    """Return twice the signed area of (i, j, (u, v)), to the bit minus that of (j, i, (u, v)).

    Where it is zero, that of the point moved by (e, e^2), with e below any number.
    """
    a, b = min(i, j), max(i, j)
    along, across = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1]
    area = along * (v - x[a, 1]) - across * (u - x[a, 0])
    if area == 0.0:
        area = np.copysign(np.finfo(np.float64).tiny, -across if across != 0.0 else along)
    return area if i < j else -area


@njit(cache=True, error_model="numpy")
def _crossings(x, faces, rays, low, scale, cells, starts, hits):
    """Return the signed crossings (P,) of the rays from points, in the direction of the last axis."""
    numbers = np.zeros(len(rays), np.int64)
    for p in range(len(rays)):
        u, v, height = rays[p, 0], rays[p, 1], rays[p, 2]
        cell = _cell(u, low[0], scale[0], cells[0]) * cells[1] + _cell(v, low[1], scale[1], cells[1])
        for place in range(starts[cell], starts[cell + 1]):
            face = faces[hits[place]]
            i, j, k = face[0], face[1], face[2]
            if max(x[i, 2], x[j, 2], x[k, 2]) < height:
                continue
            of_k, of_i, of_j = _area(x, i, j, u, v), _area(x, j, k, u, v), _area(x, k, i, u, v)
            if (of_k > 0.0) != (of_i > 0.0) or (of_k > 0.0) != (of_j > 0.0):
                continue
            total = of_i + of_j + of_k
            if (of_i * x[i, 2] + of_j * x[j, 2] + of_k * x[k, 2]) / total > height:
                numbers[p] += 1 if total > 0.0 else -1
    return numbers
