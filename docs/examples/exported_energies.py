"""Energies and mean curvature of an exported scene, from its files alone; needs numpy."""

import json
from pathlib import Path

import numpy as np


class Exported:
    """Energies [J] and mean curvature [1/m] of cloth in an exported scene; x (V, 3) [m] everywhere."""

    def __init__(self, folder):
        folder = Path(folder)
        self.facts = json.loads((folder / "scene.json").read_text())
        self.cloth, self.energies = np.load(folder / "cloth.npz"), np.load(folder / "energies.npz")
        if "collision_vertices" in self.energies:
            self.obstacle = np.load(folder / "obstacle.npz")
            self.allowed = self.allowed_faces()

    def strain(self, x):
        """Saint Venant-Kirchhoff: G = (F^T F - I) / 2, E = A (lambda/2 tr(G)^2 + mu tr(G^2))."""
        corners, constants = x[self.energies["strain_vertices"]], self.facts["energies"]["strain"]
        sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        F = sides @ self.energies["strain_Dm_inverse_per_m"]
        G = (F.transpose(0, 2, 1) @ F - np.eye(2)) / 2
        volumetric = constants["lambda_N_per_m"] / 2 * np.trace(G, axis1=1, axis2=2) ** 2
        density = volumetric + constants["mu_N_per_m"] * (G**2).sum((1, 2))
        return (self.energies["strain_areas_m2"] * density).sum()

    def bending(self, x):
        """Hinges: E = s/2 (theta - theta_0)^2; the stiffness s [J] of a hinge is k l^2 / (4 (A1 + A2))."""
        x0, x1, x2, x3 = x[self.energies["bending_vertices"]].swapaxes(0, 1)
        edge = x1 - x0
        n1, n2 = np.cross(edge, x2 - x0), np.cross(x3 - x0, edge)
        sine = (np.cross(n1, n2) * edge).sum(1) / np.linalg.norm(edge, axis=1)
        bent = np.arctan2(sine, (n1 * n2).sum(1)) - self.energies["bending_rest_angles_rad"]
        bent = (bent + np.pi) % (2 * np.pi) - np.pi
        return (self.energies["bending_stiffness_J"] / 2 * bent**2).sum()

    def gravity(self, x, frame):
        """Weight times height; its zero is the height of the pelvis in that frame, where there is a body."""
        heights = self.facts["origin_heights"]
        zero = self.facts["energies"]["gravity"]["origin_height_m"] if heights is None else heights[frame]
        return (self.energies["gravity_weights_N"] * (x[:, 1] - zero)).sum()

    def inertia(self, x, last, last_but_one):
        """Backward Euler: E = m / (2 dt^2) |x - 2 x' + x''|^2; 0 in frames 0 and 1, which have no x''."""
        squared = ((x - 2 * last + last_but_one) ** 2).sum(1)
        return (self.cloth["masses"] / (2 * self.facts["dt"] ** 2) * squared).sum()

    def collision(self, x, frame):
        """Cubic penalty of contact samples: E = k a max(eps - n . (p - c), 0)^3."""
        points = np.einsum(
            "sa,sai->si", self.energies["collision_weights"], x[self.energies["collision_vertices"]]
        )
        frame = min(frame, len(self.obstacle["positions"]) - 1)
        body, faces = self.obstacle["positions"][frame], self.obstacle["faces"]
        normals = np.cross(body[faces[:, 1]] - body[faces[:, 0]], body[faces[:, 2]] - body[faces[:, 0]])
        of_vertices = np.zeros_like(body)
        np.add.at(of_vertices, faces, normals[:, None])
        of_vertices /= np.linalg.norm(of_vertices, axis=1, keepdims=True)
        total, margin = 0.0, self.facts["energies"]["collision"]["margin_m"]
        for point, stiffness, allowed in zip(
            points, self.energies["collision_stiffness_J_per_m3"], self.allowed
        ):
            c, face, weights = closest_point(point, body, faces, allowed)
            n = plane_normal(point, c, face, weights, body, faces, normals, of_vertices)
            offset = point - c
            if np.linalg.norm(offset) > 0.1 and n @ offset < 0.99 * np.linalg.norm(offset):
                nearest = closest_point(point, body, faces, np.arange(len(faces)))[0]
                if np.linalg.norm(point - nearest) > margin and winding_number(point, body, faces) == 0:
                    n = offset / np.linalg.norm(offset)  # free cloth, far from the skin that it may touch
            total += stiffness * max(margin - n @ (point - c), 0.0) ** 3
        return total

    def allowed_faces(self):
        """Return, for each contact sample, the faces within contact_region_m of it at rest; if none, all."""
        faces, points = self.obstacle["faces"], self.energies["collision_rest_positions_m"]
        if "rest_positions" not in self.obstacle:
            return [np.arange(len(faces))] * len(points)
        centroids = self.obstacle["rest_positions"][faces].mean(1)
        near = [
            np.linalg.norm(centroids - point, axis=1) <= self.facts["contact_region_m"]
            for point in points
        ]
        return [np.flatnonzero(mask if mask.any() else ~mask) for mask in near]

    def mean_curvature(self, x):
        """Mean of |sum (cot a + cot b) (x_i - x_j)| / (4 A) over interior vertices; A: mixed Voronoi area."""
        faces = self.cloth["faces"]
        sums, areas = np.zeros_like(x), np.zeros(len(x))
        edges = np.sort(np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]]), axis=1)
        unique, counts = np.unique(edges, axis=0, return_counts=True)
        for i, j, k in faces:
            area = np.linalg.norm(np.cross(x[j] - x[i], x[k] - x[i])) / 2
            dots = [(x[b] - x[a]) @ (x[c] - x[a]) for a, b, c in ((i, j, k), (j, k, i), (k, i, j))]
            for (a, b, c), dot in zip(((i, j, k), (j, k, i), (k, i, j)), dots):
                cotangent = dot / (2 * area)  # of the angle at a, opposite the edge b c
                sums[b] += cotangent * (x[b] - x[c])
                sums[c] += cotangent * (x[c] - x[b])
                if min(dots) >= 0:  # no obtuse angle: the Voronoi cells of b and c
                    areas[[b, c]] += cotangent * ((x[b] - x[c]) ** 2).sum() / 8
                else:
                    areas[a] += area / 2 if dot < 0 else area / 4
        areas[unique[counts == 1]] = 0  # vertices of the boundary
        inside = areas > 0
        H = np.linalg.norm(sums[inside], axis=1) / (4 * areas[inside])
        return (areas[inside] * H).sum() / areas[inside].sum()


def closest_point(point, body, faces, allowed):
    """Return the closest point of the allowed faces, its face, and its weights of the face's corners."""
    a, b, c = body[faces[allowed]].swapaxes(0, 1)
    candidates = []
    for first, second, places in ((a, b, (0, 1)), (a, c, (0, 2)), (b, c, (1, 2))):  # sides and corners
        side = second - first
        share = np.clip(((point - first) * side).sum(1) / (side**2).sum(1), 0.0, 1.0)
        weights = np.zeros((len(allowed), 3))
        weights[:, places[0]], weights[:, places[1]] = 1 - share, share
        candidates.append(weights)
    normal = np.cross(b - a, c - a)
    squared = (normal**2).sum(1)
    v = (np.cross(point - a, c - a) * normal).sum(1) / squared  # the foot of the perpendicular
    w = (np.cross(b - a, point - a) * normal).sum(1) / squared
    foot = np.stack([1 - v - w, v, w], axis=1)
    candidates.append(np.where((foot >= 0).all(1, keepdims=True), foot, candidates[0]))
    weights = np.stack(candidates)
    places = np.einsum("nfa,fai->nfi", weights, body[faces[allowed]])
    kind, best = np.unravel_index(np.argmin(((places - point) ** 2).sum(2)), places.shape[:2])
    return places[kind, best], allowed[best], weights[kind, best]


def winding_number(point, body, faces):
    """Return how often the closed body winds around a point, by solid angles (van Oosterom 1983)."""
    a, b, c = (body[faces] - point).swapaxes(0, 1)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = (a * np.cross(b, c)).sum(1)
    cosines = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return round(np.arctan2(volume, cosines).sum() / (2 * np.pi))


def plane_normal(point, c, face, weights, body, faces, normals, of_vertices):
    """Return the normal of a sample's contact plane, which goes through the closest point c."""
    smooth = weights @ of_vertices[faces[face]]
    smooth /= np.linalg.norm(smooth)
    length = np.linalg.norm(point - c)
    offset = (point - c) / max(length, 1e-30)
    cosine = offset @ smooth
    tangential = length <= 1e-6 or abs(cosine) <= 0.3
    if cosine < -0.3 and weights.min() <= 1e-6:  # below a side or corner, where an allowed face may end
        corners = faces[face][weights > 1e-6]
        around = faces[np.isin(faces, corners).sum(1) == len(corners)]
        ways = body[around].reshape(-1, 3) - c
        tangential |= (ways @ offset > 1e-3 * np.linalg.norm(ways, axis=1)).any()
    if tangential:  # a ball of 10 cm or more that touches the surface in c from inside
        n = max(0.1, 1.5 * length) * smooth + length * offset
        return n / np.linalg.norm(n)
    if weights.min() > 0:
        n = normals[face] / np.linalg.norm(normals[face])
        return n * np.sign(n @ offset) * np.sign(cosine)
    return np.sign(cosine) * offset
