"""Correspondence of the vertices of two triangle meshes: by topology, or by position."""

from __future__ import annotations

import numpy as np

from reference_sim.geometry.topology import edge_uses

Index = np.ndarray  # of whole numbers

TRIED = 24  # places of a first triangle; a mesh with as many symmetries as triangles has thousands
ROUNDS = 12  # of the refinement of colours: what lies so many edges around a vertex tells it from others


def same_faces(theirs: Index, ours: Index) -> bool:
    """Return whether two lists of triangles (F,3) join the same vertices, in any order and winding.

    >>> same_faces(np.array([[0, 1, 2]]), np.array([[1, 0, 2]]))
    True
    """
    return theirs.shape == ours.shape and np.array_equal(_canonical(theirs), _canonical(ours))


def _canonical(faces: Index) -> Index:
    return np.unique(np.sort(faces, axis=1), axis=0)


def nearest_order(theirs: np.ndarray, ours: np.ndarray, *, reach: float) -> Index | None:
    """Return the nearest of their points (V,3) for each of ours (V,3): indices (V,).

    None where two of ours have the same, or one is farther than `reach` [m].
    """
    from scipy.spatial import cKDTree

    distance, order = cKDTree(theirs).query(ours)
    one_to_one = len(np.unique(order)) == len(ours) == len(theirs)
    return np.asarray(order) if one_to_one and float(distance.max()) < reach else None


def same_topology(
    theirs: Index, ours: Index, their_points: np.ndarray, our_points: np.ndarray
) -> Index | None:
    """Return for each of our vertices the one of theirs in the same place of the mesh: indices (V,).

    theirs, ours: (F,3), each with one winding. Of several ways, as in a symmetric mesh, that with the least
    distances between their_points and our_points (V,3). None where the meshes are not the same, or where an
    edge has more than two triangles.

    Method: colours of vertices are refined by those of their neighbours (Weisfeiler and Leman 1968) until few
    share one; then one triangle of ours is laid on each of theirs that has its colours, and the rest follows
    triangle by triangle.
    """
    if theirs.shape != ours.shape or len(their_points) != len(our_points):
        return None
    colours = _colours(theirs, len(their_points)), _colours(ours, len(our_points))
    if not np.array_equal(np.sort(colours[0]), np.sort(colours[1])):
        return None
    orders = [
        order
        for winding in (theirs, theirs[:, ::-1])
        if (order := _laid_on(winding, ours, *colours, their_points, our_points)) is not None
    ]
    return min(orders, key=lambda order: _cost(their_points[order], our_points), default=None)


def _laid_on(
    theirs: Index, ours: Index, their_colours: Index, our_colours: Index, their_points: np.ndarray,
    our_points: np.ndarray,
) -> Index | None:  # fmt: skip
    """Return the order by triangles of that winding, part by part of our mesh; None where there is none."""
    their_side, our_side, colours = _third(theirs), _third(ours), (their_colours, our_colours)
    if their_side is None or our_side is None:
        return None
    order = np.full(len(our_points), -1)
    taken: set[int] = set()
    rare = dict(zip(*np.unique(our_colours, return_counts=True)))
    rarity = np.array([[rare[c] for c in our_colours[face]] for face in ours]).min(axis=1)
    for seed in ours[np.argsort(rarity, kind="stable")]:
        if (order[seed] >= 0).all():
            continue
        # A part may share a vertex with parts that are laid already.
        ways = [
            way
            for place in _places(seed, theirs, *colours, their_points, our_points)
            if (way := _followed(seed, place, their_side, our_side, *colours)) is not None
            and all(b == order[a] if order[a] >= 0 else b not in taken for a, b in way.items())
        ]
        if not ways:
            return None
        best = min(ways, key=lambda way: _cost(their_points[list(way.values())], our_points[list(way)]))
        order[list(best)] = list(best.values())
        taken |= set(best.values())
    used = np.unique(ours)
    spare = np.setdiff1d(np.arange(len(our_points)), used), np.setdiff1d(np.arange(len(order)), order[used])
    order[spare[0]] = spare[1]  # in no triangle: any order is as good
    return order


def _places(
    seed: Index, theirs: Index, their_colours: Index, our_colours: Index, their_points: np.ndarray,
    our_points: np.ndarray,
) -> Index:  # fmt: skip
    """Return their triangles, turned, of the colours of our triangle `seed`: the TRIED nearest."""
    turned = np.concatenate([np.roll(theirs, turn, axis=1) for turn in range(3)])
    alike = turned[(their_colours[turned] == our_colours[seed]).all(axis=1)]
    away = ((their_points[alike] - our_points[seed]) ** 2).sum(axis=(1, 2))
    return alike[np.argsort(away, kind="stable")[:TRIED]]


def _followed(
    seed: Index, place: Index, theirs: dict, ours: dict, their_colours: Index, our_colours: Index
) -> dict[int, int] | None:
    """Return our vertex -> theirs, of all that hangs together with `seed` where that lies on `place`.

    None where two triangles contradict each other.
    """
    way = {int(a): int(b) for a, b in zip(seed, place)}
    if len(set(way.values())) < 3:
        return None
    back = {b: a for a, b in way.items()}
    todo = [(int(seed[k - 1]), int(seed[k])) for k in range(3)]
    done = set(todo)
    while todo:
        a, b = todo.pop()
        tip, other = ours.get((b, a)), theirs.get((way[b], way[a]))
        if (tip is None) != (other is None):
            return None
        if tip is None or other is None:
            continue
        if way.setdefault(tip, other) != other or back.setdefault(other, tip) != tip:
            return None
        if their_colours[other] != our_colours[tip]:
            return None
        for edge in ((a, tip), (tip, b)):
            if edge not in done:
                done.add(edge)
                todo.append(edge)
    return way


def _third(faces: Index) -> dict[tuple[int, int], int] | None:
    """Return directed edge -> the third corner of its triangle; None where two triangles share one."""
    corners: dict[tuple[int, int], int] = {}
    for a, b, c in faces.tolist():
        for edge, tip in (((a, b), c), ((b, c), a), ((c, a), b)):
            if edge in corners:
                return None
            corners[edge] = tip
    return corners


def _colours(faces: Index, vertices: int) -> Index:
    """Return colours (V,), equal where the mesh within ROUNDS edges of two vertices is alike."""
    edges, _ = edge_uses(faces)
    both = np.concatenate([edges, edges[:, ::-1]])
    colour = np.bincount(faces.ravel(), minlength=vertices).astype(np.uint64)
    for _ in range(ROUNDS):
        mixed = _mixed(colour)
        around = np.zeros(vertices, dtype=np.uint64)
        np.add.at(around, both[:, 0], mixed[both[:, 1]])
        colour = mixed * np.uint64(3) + _mixed(around)
    return colour


def _mixed(values: Index) -> Index:
    """Return a hash of whole numbers, the same everywhere.

    Source: splitmix64 (Steele, Lea and Flood 2014).
    """
    with np.errstate(over="ignore"):
        x = values + np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return x ^ (x >> np.uint64(31))


def _cost(points: np.ndarray, others: np.ndarray) -> float:
    return float(((points - others) ** 2).sum())
