"""Sweeps over vertices and over constraints, and the strain, fold angle and depth of one element they share.

Written for one element at a time, where the energies' own kernels run over all: a Gauss-Seidel sweep moves
vertices between one element and the next. Tests hold them to the energies' gradients and Hessians.
"""

from __future__ import annotations

import numpy as np

from reference_sim.kernels.kernel_cache import njit


@njit(cache=True, inline="always")
def strain(x, face, D, fa, fb):
    """G00, G11, G01 of the Green strain; the columns of F are written into fa and fb."""
    p, q, r = face[0], face[1], face[2]
    for i in range(3):
        first, second = x[q, i] - x[p, i], x[r, i] - x[p, i]
        fa[i] = first * D[0, 0] + second * D[1, 0]
        fb[i] = first * D[0, 1] + second * D[1, 1]
    aa = fa[0] * fa[0] + fa[1] * fa[1] + fa[2] * fa[2]
    bb = fb[0] * fb[0] + fb[1] * fb[1] + fb[2] * fb[2]
    ab = fa[0] * fb[0] + fa[1] * fb[1] + fa[2] * fb[2]
    return 0.5 * (aa - 1.0), 0.5 * (bb - 1.0), 0.5 * ab


@njit(cache=True, inline="always")
def hat(D, corner):
    """Gradient of the hat function of a corner in rest coordinates [1/m]."""
    if corner == 0:
        return -D[0, 0] - D[1, 0], -D[0, 1] - D[1, 1]
    return D[corner - 1, 0], D[corner - 1, 1]


@njit(cache=True, error_model="numpy")
def fold(x, hinge, rest, gradient):
    """theta - rest, wrapped into half a turn, of one hinge; its gradient (4, 3) [1/m] is written.

    A face of a hinge turns by one radian where its tip moves by its height over the edge, along the normal.
    """
    p, q = hinge[0], hinge[1]
    e0, e1, e2 = x[q, 0] - x[p, 0], x[q, 1] - x[p, 1], x[q, 2] - x[p, 2]
    length = np.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    normals = np.empty((2, 3))
    for side in range(2):
        t = hinge[2 + side]
        r0, r1, r2 = x[t, 0] - x[p, 0], x[t, 1] - x[p, 1], x[t, 2] - x[p, 2]
        sign = 1.0 if side == 0 else -1.0
        n0, n1, n2 = sign * (e1 * r2 - e2 * r1), sign * (e2 * r0 - e0 * r2), sign * (e0 * r1 - e1 * r0)
        normals[side, 0], normals[side, 1], normals[side, 2] = n0, n1, n2
        along = (e0 * r0 + e1 * r1 + e2 * r2) / length
        scale = 1.0 / (n0 * n0 + n1 * n1 + n2 * n2)
        for i in range(3):
            m = normals[side, i] * scale
            if side == 0:
                gradient[0, i], gradient[1, i] = 0.0, 0.0
            gradient[0, i] += (length - along) * m
            gradient[1, i] += along * m
            gradient[2 + side, i] = -length * m
    a, b = normals[0], normals[1]
    c0, c1, c2 = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    sine = (e0 * c0 + e1 * c1 + e2 * c2) / length
    angle = np.arctan2(sine, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) - rest
    return angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5)


@njit(cache=True, inline="always")
def depth(x, stencil, weight, margin, point, normal):
    """max(margin - n . (x_s - c), 0) of one contact sample [m]."""
    distance = 0.0
    for i in range(3):
        sample = weight[0] * x[stencil[0], i] + weight[1] * x[stencil[1], i] + weight[2] * x[stencil[2], i]
        distance += normal[i] * (sample - point[i])
    return max(margin - distance, 0.0)


@njit(cache=True, error_model="numpy")
def sweep_vertices(x, free, inertia, membrane, hinges, touching, around):
    g, H = np.empty(3), np.empty((3, 3))
    fa, fb, turn = np.empty(3), np.empty(3), np.empty((4, 3))
    for v in free:
        block(x, v, inertia, membrane, hinges, touching, around, g, H, fa, fb, turn)
        _newton(x, v, g, H)


@njit(cache=True, error_model="numpy")
def block(x, v, inertia, membrane, hinges, touching, around, g, H, fa, fb, turn):
    """Writes the gradient g (3,) and the convex block H (3, 3) of vertex v; fa, fb and turn are scratch."""
    mass, x_hat, weight = inertia
    for i in range(3):
        g[i] = mass[v] * (x[v, i] - x_hat[v, i])
        for j in range(3):
            H[i, j] = mass[v] if i == j else 0.0
    g[1] += weight[v]
    first, corners = around[0], around[1]
    for at in range(first[v], first[v + 1]):
        _add_strain(x, corners[at] // 3, corners[at] % 3, membrane, g, H, fa, fb)
    first, corners = around[2], around[3]
    for at in range(first[v], first[v + 1]):
        e, corner = corners[at] // 4, corners[at] % 4
        angle = fold(x, hinges[0][e], hinges[2][e], turn)
        for i in range(3):
            pull = hinges[1][e] * turn[corner, i]
            g[i] += pull * angle
            for j in range(3):
                H[i, j] += pull * turn[corner, j]
    first, corners = around[4], around[5]
    stencils, shares, stiffness, margin, points, normals = touching
    for at in range(first[v], first[v + 1]):
        e, corner = corners[at] // 3, corners[at] % 3
        d = depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if d > 0.0:
            share = shares[e, corner]
            for i in range(3):
                g[i] -= 3.0 * stiffness[e] * d * d * share * normals[e, i]
                for j in range(3):
                    H[i, j] += 6.0 * stiffness[e] * d * share * share * normals[e, i] * normals[e, j]


@njit(cache=True, inline="always")
def _add_strain(x, e, corner, membrane, g, H, fa, fb):
    """A F S b and A [(b.S+ b) I + (lambda + mu) (F b)(F b)^T + mu |b|^2 F F^T], S+ without compression."""
    faces, Dm_inverse, areas, lam, mu = membrane
    G00, G11, G01 = strain(x, faces[e], Dm_inverse[e], fa, fb)
    trace = lam * (G00 + G11)
    S00, S11, S01 = trace + 2.0 * mu * G00, trace + 2.0 * mu * G11, 2.0 * mu * G01
    b0, b1 = hat(Dm_inverse[e], corner)
    s0, s1 = S00 * b0 + S01 * b1, S01 * b0 + S11 * b1
    P00, P11, P01 = _stretched(S00, S11, S01)
    along = b0 * (P00 * b0 + P01 * b1) + b1 * (P01 * b0 + P11 * b1)
    bb = b0 * b0 + b1 * b1
    area = areas[e]
    for i in range(3):
        g[i] += area * (fa[i] * s0 + fb[i] * s1)
        Fi = fa[i] * b0 + fb[i] * b1
        H[i, i] += area * along
        for j in range(3):
            Fj = fa[j] * b0 + fb[j] * b1
            H[i, j] += area * ((lam + mu) * Fi * Fj + mu * bb * (fa[i] * fa[j] + fb[i] * fb[j]))


@njit(cache=True, inline="always")
def _stretched(S00, S11, S01):
    """The symmetric matrix S without its negative eigenvalues."""
    mean, half = 0.5 * (S00 + S11), 0.5 * (S00 - S11)
    radius = np.sqrt(half * half + S01 * S01)
    if mean - radius >= 0.0:
        return S00, S11, S01
    if mean + radius <= 0.0:
        return 0.0, 0.0, 0.0
    scale = 0.5 * (mean + radius) / radius  # the larger eigenvalue times the projector on its direction
    return scale * (radius + half), scale * (radius - half), scale * S01


@njit(cache=True, inline="always", error_model="numpy")
def _newton(x, v, g, H):
    """x_v -= H^-1 g by the adjugate; H is positive definite, for a mass is on its diagonal."""
    c0 = H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1]
    c1 = H[1, 2] * H[2, 0] - H[1, 0] * H[2, 2]
    c2 = H[1, 0] * H[2, 1] - H[1, 1] * H[2, 0]
    scale = 1.0 / (H[0, 0] * c0 + H[0, 1] * c1 + H[0, 2] * c2)
    d0 = H[0, 2] * H[2, 1] - H[0, 1] * H[2, 2]
    d1 = H[0, 0] * H[2, 2] - H[0, 2] * H[2, 0]
    d2 = H[0, 1] * H[2, 0] - H[0, 0] * H[2, 1]
    f0 = H[0, 1] * H[1, 2] - H[0, 2] * H[1, 1]
    f1 = H[0, 2] * H[1, 0] - H[0, 0] * H[1, 2]
    f2 = H[0, 0] * H[1, 1] - H[0, 1] * H[1, 0]
    x[v, 0] -= scale * (c0 * g[0] + d0 * g[1] + f0 * g[2])
    x[v, 1] -= scale * (c1 * g[0] + d1 * g[1] + f1 * g[2])
    x[v, 2] -= scale * (c2 * g[0] + d2 * g[1] + f2 * g[2])


# Here lam is a force: the paper's lambda / dt^2. w = dt^2 / m takes its place in M^-1.
@njit(cache=True, error_model="numpy")
def sweep_constraints(x, w, membrane, hinges, touching, strain_force, fold_force, contact_force):
    fa, fb = np.empty(3), np.empty(3)
    D, turn = np.empty((3, 3, 3)), np.empty((4, 3))
    for e in range(len(membrane[0])):
        _solve_strain(x, w, e, membrane, strain_force[e], fa, fb, D)
    for e in range(len(hinges[0])):
        hinge, k = hinges[0][e], hinges[1][e]
        if k == 0.0:  # its compliance is infinite: it pulls at nothing
            continue
        angle = fold(x, hinge, hinges[2][e], turn)
        total = 1.0 / k
        for c in range(4):
            total += w[hinge[c]] * (turn[c, 0] ** 2 + turn[c, 1] ** 2 + turn[c, 2] ** 2)
        change = -(angle + fold_force[e] / k) / total
        fold_force[e] += change
        for c in range(4):
            for i in range(3):
                x[hinge[c], i] += w[hinge[c]] * turn[c, i] * change
    stencils, shares, stiffness, margin, points, normals = touching
    for e in range(len(stencils)):
        d = depth(x, stencils[e], shares[e], margin, points[e], normals[e])
        if d > 0.0 or contact_force[e] != 0.0:
            compliance = 1.0 / (2.0 * stiffness[e])
            slope = -1.5 * np.sqrt(d)  # of C along the normal
            total = compliance
            for c in range(3):
                total += w[stencils[e, c]] * (slope * shares[e, c]) ** 2
            change = -(d * np.sqrt(d) + compliance * contact_force[e]) / total
            contact_force[e] += change
            for c in range(3):
                for i in range(3):
                    x[stencils[e, c], i] += w[stencils[e, c]] * slope * shares[e, c] * normals[e, i] * change


@njit(cache=True, inline="always")
def _solve_strain(x, w, e, membrane, force, fa, fb, D):
    """One triangle's three strains at once; D (3, 3, 3) holds dC_k/dx_c."""
    faces, Dm_inverse, areas, lam, mu = membrane
    face = faces[e]
    G00, G11, G01 = strain(x, face, Dm_inverse[e], fa, fb)
    for c in range(3):
        b0, b1 = hat(Dm_inverse[e], c)
        for i in range(3):
            D[0, c, i], D[1, c, i] = fa[i] * b0, fb[i] * b1
            D[2, c, i] = 0.5 * (fa[i] * b1 + fb[i] * b0)
    # K^-1 of the plane: [[p, q, 0], [q, p, 0], [0, 0, r]]
    scale = 1.0 / (areas[e] * 4.0 * mu * (lam + mu))
    p, q, r = scale * (lam + 2.0 * mu), -scale * lam, 1.0 / (4.0 * mu * areas[e])
    r0 = -G00 - p * force[0] - q * force[1]
    r1 = -G11 - q * force[0] - p * force[1]
    r2 = -G01 - r * force[2]
    a00, a11, a22, a01, a02, a12 = p, p, r, q, 0.0, 0.0
    for c in range(3):
        wc = w[face[c]]
        for i in range(3):
            d0, d1, d2 = D[0, c, i], D[1, c, i], D[2, c, i]
            a00 += wc * d0 * d0
            a11 += wc * d1 * d1
            a22 += wc * d2 * d2
            a01 += wc * d0 * d1
            a02 += wc * d0 * d2
            a12 += wc * d1 * d2
    c0, c1, c2 = a11 * a22 - a12 * a12, a12 * a02 - a01 * a22, a01 * a12 - a11 * a02
    inverse = 1.0 / (a00 * c0 + a01 * c1 + a02 * c2)
    s0 = inverse * (c0 * r0 + c1 * r1 + c2 * r2)
    s1 = inverse * (c1 * r0 + (a00 * a22 - a02 * a02) * r1 + (a01 * a02 - a00 * a12) * r2)
    s2 = inverse * (c2 * r0 + (a01 * a02 - a00 * a12) * r1 + (a00 * a11 - a01 * a01) * r2)
    force[0] += s0
    force[1] += s1
    force[2] += s2
    for c in range(3):
        for i in range(3):
            x[face[c], i] += w[face[c]] * (D[0, c, i] * s0 + D[1, c, i] * s1 + D[2, c, i] * s2)
