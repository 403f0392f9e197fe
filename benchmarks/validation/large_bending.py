"""Large bending with a known answer: elastica, catenary, lateral buckling, slit annulus.

Catenary, with lambda = 0: a string of force N = E2 s (s^2 - 1)/2 per width at stretch s, whose weight
gives the force at each of its points; integrated by scipy.

Lateral buckling: a strip on edge, clamped at one end, gives way sideways under P = 4.0126 (EI GJ)^0.5 /
L^2 at the other end (Michell 1899, Prandtl 1899), or 12.85 (EI GJ)^0.5 / L^2 spread evenly over the
length (Timoshenko and Gere, Theory of Elastic Stability), as tested by Romero et al.
(2021). Of a narrow strip of width b on equilateral triangles EI = D (1 - nu^2) b, GJ = 2 D (1 - nu) b.

Slit annular plate (Sze, Liu and Lo 2004): clamped at one lip of the slit, the other lifted by a line
load. Equilateral triangles are mapped to the annulus by exp, which is conformal. Such a plate has nu =
-1/3, and the energy of Gaussian curvature makes it one of nu = 0.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

import reference_sim as sim
from benchmarks.meshes import ROW, rectangle, right_grid
from benchmarks.validation.case import known_answer
from benchmarks.validation.clamped_strip import clamped_strip, exact_elastica
from benchmarks.validation.equilibrium import DeadLoad, ends, flat_cloth, minimum, order
from benchmarks.validation.plates import NU, GaussianCurvature
from reference_sim import energies

ELASTICA_STIFFNESS = 1e-3  # [J] hinge stiffness
# 330 N/m: at Gamma = 1000 the strip weighs 0.9 N per metre of width, and stretches by 0.3 %.
ELASTICA_MATERIAL = sim.Material(
    young_modulus=700e3, poisson_ratio=0.0, bending_stiffness=ELASTICA_STIFFNESS
)
COLUMNS = 120
ELASTICA = partial(
    known_answer, smoke=False, expected=0.0, reason="120 cells, their error halves with the cell"
)
SYMMETRIC = ("cross", "union_jack", "equilateral", "delaunay")


def bent_strip(
    family: str, weight: float, load: float, columns: int = COLUMNS
) -> tuple[np.ndarray, np.ndarray]:
    """Return the chord of the strip and of the elastica, (width, height) each, over the length."""
    strip = clamped_strip(family, columns, 1.0, ELASTICA_MATERIAL)
    cloth, length = strip.cloth, strip.length
    acceleration = weight * strip.stiffness / length**3 / ELASTICA_MATERIAL.areal_density
    terms: list[energies.Energy] = [energies.StretchStVK(cloth), energies.BendHinge(cloth)]
    if weight:
        terms.append(energies.Gravity(cloth, acceleration=acceleration))
    if load:
        forces = np.zeros_like(cloth.rest_positions)
        areas = cloth.vertex_areas[strip.tip]
        total_force = load * strip.stiffness / length**2 * strip.width
        forces[strip.tip, 1] = -total_force * (areas / areas.sum())
        terms.append(DeadLoad(cloth, forces))
    s, (x, drop) = exact_elastica(weight, load)
    rest = cloth.rest_positions
    guess = rest.copy()  # on the elastica: near the answer, not it
    free = rest[:, 0] > strip.cell
    guess[free, 0] = np.interp(rest[free, 0], s, x)
    guess[free, 1] = -np.interp(rest[free, 0], s, drop)
    strength = (weight + load) * strip.stiffness / ELASTICA_MATERIAL.areal_density / sim.GRAVITY
    bent = minimum(terms, guess, tolerance=1e-6 * strength)
    return strip.chord(bent) / length, np.array([x[-1], drop[-1]])


@ELASTICA(
    {
        **{f"end_loaded_cantilever_{load:g}": {"load": load} for load in (1.0, 3.0, 10.0)},
        "heavy_elastica_10": {"weight": 10.0},
    },
    tolerance=3e-3,
)
@ELASTICA(
    {f"heavy_elastica_{weight:g}": {"weight": weight} for weight in (100.0, 1000.0)}, tolerance=6e-3
)
@ELASTICA({"heavy_elastica_1": {"weight": 1.0}}, tolerance=1e-4)
def tip_distance(weight: float = 0.0, load: float = 0.0) -> float:
    """Return the distance of a cantilever's tip to the elastica, over its length, worst of the families.

    Where all diagonals lean one way, as in family "right", the strip twists and is no elastica.
    """
    bent = (bent_strip(family, weight, load) for family in SYMMETRIC)
    return max(float(np.linalg.norm(ours - exact)) for ours, exact in bent)


E2 = 32.965  # [N/m] membrane modulus
STRING = sim.Material(young_modulus=E2 / 0.47e-3, poisson_ratio=0.0, thickness=0.47e-3)
WEIGHT = STRING.areal_density * sim.GRAVITY  # [N/m^2]
SPAN = 0.8  # [m] between the ends of the catenary
STRING_CELLS = (12, 24, 48)


def string_stretch(force: float) -> float:
    """Return s with E2 s (s^2 - 1)/2 = force [N/m]."""
    from scipy.optimize import brentq

    return brentq(lambda s: E2 * s * (s * s - 1) / 2 - force, 1.0, 3.0, xtol=1e-15)


def exact_catenary() -> dict[str, float]:
    """Return the horizontal "force" per width on an end [N/m] and the "sag" [m] of the elastic catenary.

    X is measured from the lowest point.
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq

    def over_half(force: float, vertical: bool) -> float:
        def share(X: float) -> float:
            N = float(np.hypot(force, WEIGHT * X))
            return string_stretch(N) * (WEIGHT * X if vertical else force) / N

        return quad(share, 0, 0.5, epsabs=1e-13)[0]

    force = brentq(lambda H: 2 * over_half(H, False) - SPAN, 0.01, 10.0, xtol=1e-14)
    return {"force": force, "sag": over_half(force, True)}


@known_answer(["catenary_force"], unit="N/m", tolerance=2e-4, reason="second order in 1/48 of the length")
@known_answer(["catenary_sag"], unit="m", tolerance=1e-4, reason="second order in 1/48 of the length")
@cache
def catenary() -> dict[str, tuple[float, float]]:
    """Return horizontal force per width, or sag, of an elastic catenary, 1 m over a span of 0.8 m."""
    measured, exact = _catenary(STRING_CELLS[-1]), exact_catenary()
    return {f"catenary_{name}": (measured[name], exact[name]) for name in exact}


@known_answer(expected=2.0, tolerance=0.1, reason="12, 24 and 48 cells are few")
def catenary_order() -> float:
    """Return the order in h of the sag of an elastic catenary."""
    exact = exact_catenary()["sag"]
    return order(lambda columns: abs(_catenary(columns)["sag"] - exact), STRING_CELLS)


def _catenary(columns: int) -> dict[str, float]:
    width = 2.0 / columns
    points, faces = right_grid(2, columns, width, 1.0)
    cloth = flat_cloth(points, faces, STRING, held=ends(points), lies=True)
    start = cloth.rest_positions * [SPAN, 1.0, 1.0] - [0.5 * SPAN, 0.0, 0.0]
    start[:, 1] = -0.28 * (1 - (2 * start[:, 0] / SPAN) ** 2)  # near the answer, not it
    terms = [energies.StretchStVK(cloth), energies.Gravity(cloth)]
    x = minimum(terms, start, tolerance=1e-9)
    force = -sim.Potential(terms).gradient(x)[points[:, 0] < 1e-9, 0].sum() / width
    middle = np.abs(points[:, 0] - 0.5) < 1e-9
    return {"force": float(force), "sag": float(-x[middle, 1].mean())}


BUCKLING_STIFFNESS = 1e-5  # [J] so small that the strip hardly sags in plane before it buckles
BUCKLING_MATERIAL = sim.Material(poisson_ratio=0.3, bending_stiffness=BUCKLING_STIFFNESS)
CRITICAL = {"end": 4.0126, "weight": 12.85}  # total load, over (EI GJ)^0.5 / L^2
BUCKLING_ROWS = (4, 8)


@known_answer(
    {"lateral_buckling": {}}, expected=1.0, tolerance=0.03, smoke=False,
    reason="the clamp holds back warping over a width, 4 % of the length",
)  # fmt: skip
def critical_load(load: str = "end", slender: float = 0.04) -> float:
    """Return the load at which a strip on edge buckles sideways, over the closed form.

    Args:
        load: on the "end", or "weight".
        slender: width over length.

    The free edges lack half a hinge, an error of first order in the cell: two meshes are extrapolated.
    """
    coarse, fine = (_ratio(rows, load, slender) for rows in BUCKLING_ROWS)
    return 2 * fine - coarse


def _ratio(rows: int, load: str, slender: float) -> float:
    columns = round(rows * ROW / slender)
    h = 1 / (columns - 0.5)  # the clamp lies half-way between the two pinned columns
    width = rows * h * ROW
    points, faces = rectangle("equilateral", columns, rows, columns * h, width)
    points -= [h / 2, width / 2]
    cloth = flat_cloth(points, faces, BUCKLING_MATERIAL, held=points[:, 0] < 0.51 * h)
    D = BUCKLING_STIFFNESS / 4
    exact = CRITICAL[load] * width * D * np.sqrt((1 - NU**2) * 2 * (1 - NU))
    forces = np.zeros((len(points), 3))
    if load == "weight":
        forces[:, 1] = -exact * cloth.vertex_areas / width
    else:
        tip = np.flatnonzero(points[:, 0] > 1 - 1e-9)
        # Shear of a beam: least at the free edges.
        share = 1.0 - (2 * np.abs(points[tip, 1]) / width) ** 2
        forces[tip, 1] = -exact * share / share.sum()
    return buckling_factor(cloth, forces)


def buckling_factor(cloth: sim.Cloth, forces: np.ndarray) -> float:
    """Return the factor on dead loads (V, 3) [N] at which a flat sheet in the plane z = 0 gives way sideways.

    Raises RuntimeError where the sheet in its plane does not converge.
    """
    import scipy.sparse as sp
    import scipy.sparse.linalg as spla

    strain, stiff = energies.StretchStVK(cloth), energies.BendHinge(cloth)
    # Keeps the loaded strip in its plane, where hinges do no work.
    stiff.stiffness = 1e5 * stiff.stiffness
    flat = minimum([strain, stiff, DeadLoad(cloth, forces)], cloth.rest_positions, tolerance=1e-9)
    free = np.flatnonzero(cloth.free)

    def out_of_plane(potential: sim.Potential, x: np.ndarray) -> sp.csc_matrix:
        return sp.csc_matrix(potential.hessian(x)[2::3][:, 2::3][free][:, free])

    bending = out_of_plane(sim.Potential([energies.BendHinge(cloth)]), cloth.rest_positions)
    stress = out_of_plane(sim.Potential([strain]), flat)
    # (bending + factor stress) w = 0: 1/factor is the largest eigenvalue of -stress against bending.
    start = np.ones(len(free))
    values = spla.eigsh(-stress, k=1, M=bending, which="LA", v0=start, return_eigenvectors=False)
    return 1 / float(values[0])


INNER, OUTER, LOAD = 6.0, 10.0, 0.8  # [m] radii, [N/m] on the free lip
SZE = (13.891, 17.528)  # [m] lifts of the inner and the outer corner of shells
YOUNG = 21e6
ANNULUS_THICKNESS = 0.03
D = YOUNG * ANNULUS_THICKNESS**3 / 12  # [J] of the plate, nu = 0
C11 = 1 / 4  # of scaled hinges on equilateral triangles, over k
ANNULUS_ROWS = (8, 16)  # of triangles between the radii
STAGES = 12
ANNULUS_MATERIAL = sim.Material(
    young_modulus=YOUNG, poisson_ratio=0.0, thickness=ANNULUS_THICKNESS, density=1.0,
    bending_stiffness=D / C11,
)  # fmt: skip


@known_answer(
    {"slit_annulus_inner": {"side": "inner"}, "slit_annulus_outer": {"side": "outer"}},
    unit="m", tolerance=0.08, smoke=False, long=True,
    reason="half of what 3 % of bending stiffness changes; the limit of three meshes is 0.04 m off",
)  # fmt: skip
def corner(side: str) -> tuple[float, float]:
    """Return the lift of the free lip's corner, "inner" or "outer", on infinitely fine meshes, and of shells.

    Edges on the border have no hinge, an error of first order in the cell: two meshes are extrapolated.
    """
    coarse, fine = (lift_lip(rows, D) for rows in ANNULUS_ROWS)
    place = ("inner", "outer").index(side)
    return float((2 * fine - coarse)[place]), SZE[place]


@cache
def lift_lip(
    rows: int, zero: float, material: sim.Material = ANNULUS_MATERIAL, family: str = "equilateral"
) -> np.ndarray:
    """Return the lifts [m] of the free lip's inner and outer corner, with so many rows of triangles.

    zero: D [J] of a plate that is made one of nu = 0; at 0 it is that of hinges alone.

    Raises RuntimeError where a stage of the load does not converge.
    """
    width = np.log(OUTER / INNER)
    columns = round(2 * np.pi / width * rows * (ROW if family == "equilateral" else 1.0))
    flat, faces = rectangle(family, columns, rows, 2 * np.pi, width)
    h = 2 * np.pi / (columns - 0.5)
    # The clamp: half-way between two pinned columns.
    turn = flat[:, 0] * columns / (columns - 0.5) - h / 2
    radius = INNER * np.exp(flat[:, 1])
    rest = np.stack([radius * np.cos(turn), 0.0 * turn, -radius * np.sin(turn)], axis=1)
    cloth = sim.Cloth(rest, faces, material, pins=np.flatnonzero(turn < 0.6 * h))
    terms: list[energies.Energy] = [energies.StretchStVK(cloth), energies.BendHinge(cloth)]
    if zero:
        terms.append(GaussianCurvature(cloth, -NU * zero))
    lip = np.flatnonzero(turn > 2 * np.pi - 1e-6)
    lip = lip[np.argsort(radius[lip])]
    share = np.gradient(radius[lip])
    share[[0, -1]] /= 2
    forces = np.zeros_like(rest)
    x = rest.copy()
    x[:, 1] = 1e-3 * turn**2
    x[cloth.pins] = rest[cloth.pins]
    for stage in range(1, STAGES + 1):
        forces[lip, 1] = LOAD * share * (stage / STAGES) ** 2
        x = minimum([*terms, DeadLoad(cloth, forces)], x, tolerance=1e-4)
    return x[lip[[0, -1]], 1]
