"""Tailored garments: topology, even triangles, room around the body, ease, flare, borrowed weights."""

import dataclasses

import igl
import numpy as np
import pytest
import scipy.sparse as sp

from snug.body.skeleton import JOINT
from snug.garments.garment import GarmentError
from snug.garments.templates import GARMENT_TEMPLATES, find_template
from tests.reference_sim.meshes import edge_counts, girth
from tests.snug.body.test_smpl_files import other_mesh
from tests.snug.training.dressing import tailored

KINDS = [pattern.name for pattern in GARMENT_TEMPLATES]
SIZES = [pytest.param(("tshirt", vertices), marks=pytest.mark.slow) for vertices in (300, 4400)]


@pytest.fixture(params=[*((kind, 600) for kind in KINDS), *SIZES])
def garment(request):
    """Every sort, the T-shirt of other sizes too."""
    return tailored(*request.param)


@pytest.fixture(params=["tshirt", "tunic"])
def shirt(request):
    """With sleeves, each vertex with the weights of one body vertex."""
    return tailored(request.param, 600)


def at(body, name):
    return body.joint_template[JOINT[name]]


SLEEVES = {"neck", "left_sleeve", "right_sleeve", "hem"}
ARMHOLES = {"neck", "left_armhole", "right_armhole", "hem"}
LEGS = {"waist", "left_leg", "right_leg"}
OPENINGS = {
    "tshirt": SLEEVES, "tunic": SLEEVES, "long_sleeves": SLEEVES, "tank_top": ARMHOLES, "dress": ARMHOLES,
    "skirt": {"waist", "hem"}, "trousers": LEGS, "shorts": LEGS,
}  # fmt: skip


def test_a_garment_is_a_sphere_with_its_openings_of_even_triangles(garment, request):
    points, faces = garment.rest_positions, garment.faces
    count = request.node.callspec.params["garment"][1]
    assert abs(len(points) - count) <= 0.01 * count
    assert np.array_equal(np.unique(faces), np.arange(len(points)))
    halves, edges, counts = edge_counts(faces)
    assert counts.max() == 2 and len(np.unique(halves, axis=0)) == len(halves)  # consistently wound
    assert set(garment.loops) == OPENINGS[garment.name]
    assert len(points) - len(edges) + len(faces) == 2 - len(garment.loops)  # Euler
    graph = sp.coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(len(points),) * 2)
    assert sp.csgraph.connected_components(graph, directed=False)[0] == 1
    rim = np.concatenate(list(garment.loops.values()))
    assert np.array_equal(np.sort(rim), np.unique(edges[counts == 1]))
    for name, loop in garment.loops.items():
        side = {"left": 1, "right": -1}.get(name.partition("_")[0], 0)
        assert np.sign(np.round(points[loop, 0].mean(), 6)) == side, name
    assert list(garment.pins) == sorted(garment.loops.get("waist", ()))
    assert len(garment.hem) == len(set(garment.hem.tolist())) > 0
    a, b, c = (points[faces[:, k]] for k in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert areas.min() >= 0.5 * areas.mean() and areas.max() <= 2.0 * areas.mean()
    # Law of cosines: the smallest angle is opposite the shortest side.
    sides = np.sort(np.linalg.norm(points[faces] - np.roll(points[faces], 1, axis=1), axis=2), axis=1).T
    cosine = (sides[1] ** 2 + sides[2] ** 2 - sides[0] ** 2) / (2 * sides[1] * sides[2])
    assert np.degrees(np.arccos(cosine)).min() > 15
    mirrored = {tuple(p) for p in np.round(points * [-1, 1, 1] + 0.0, 9).tolist()}
    assert mirrored == {tuple(p) for p in np.round(points + 0.0, 9).tolist()}


def test_a_garment_is_clear_of_the_body_at_vertices_and_within_triangles(body, garment):
    corners = garment.rest_positions[garment.faces]
    shares = np.random.default_rng(3).dirichlet(np.ones(3), size=len(corners))
    inside = np.einsum("fk,fkd->fd", shares, corners)
    vertices = igl.signed_distance(garment.rest_positions, body.template, body.faces)[0]
    within = igl.signed_distance(inside, body.template, body.faces)[0]
    clearance = find_template(garment.name).measures["clearance"]
    # Random points within are not the samples that tailoring looks at.
    assert vertices.min() >= clearance - 1e-9 and within.min() >= clearance - 5e-4


@pytest.mark.slow
def test_the_tunic_is_longer_and_flares_by_what_is_asked(body):
    """Steiner: a convex section grown by d is 2 pi d longer, so d comes back from the girths."""
    tailor = find_template("tunic").tailor
    straight, flared = (tailor(body, vertices=2000, flare=flare) for flare in (0.0, 0.045))
    hem = flared.rest_positions[flared.hem, 1].mean()
    shirt = find_template("tshirt").tailor(body, vertices=2000)
    assert shirt.rest_positions[shirt.hem, 1].mean() - hem == pytest.approx(0.08, abs=1e-3)
    low = [girth(g.rest_positions, g.faces, 1, hem + 0.004) for g in (flared, straight)]
    # A little above the hem, where the cone is 4 mm of its height narrower; chords lose the rest.
    assert (low[0] - low[1]) / (2 * np.pi) == pytest.approx(0.045, abs=0.002)
    above = [
        girth(g.rest_positions, g.faces, 1, at(body, "spine1")[1] + 0.05) for g in (flared, straight)
    ]
    assert above[0] == pytest.approx(above[1], abs=0.01)


@pytest.mark.slow
def test_ease_is_girth_at_waist_and_cuff(body):
    """On a finer mesh, where a section's chords are close to its curve (at 1000 vertices they lose 1 cm)."""
    tailor = find_template("tshirt").tailor
    loose, tight = tailor(body, vertices=2000), tailor(body, ease=0.0, vertices=2000)
    at_waist = [girth(g.rest_positions, g.faces, 1, at(body, "spine1")[1]) for g in (loose, tight)]
    assert at_waist[0] - at_waist[1] == pytest.approx(0.06, abs=0.003)
    # Steiner: a convex section grown by d is 2 pi d longer. Here the arm is convex; the chords
    # cost 2 mm. The waist is as wide as chest and hips ask.
    cuff = loose.rest_positions[:, 0].max() - 0.003
    arm = girth(body.template, body.faces, 0, cuff)
    assert girth(loose.rest_positions, loose.faces, 0, cuff) == pytest.approx(
        arm + 2 * np.pi * 0.015 + 0.06, abs=0.005
    )
    assert (
        at_waist[0]
        > girth(body.template, body.faces, 1, at(body, "spine1")[1]) + 2 * np.pi * 0.015 + 0.06
    )


def test_another_shape_carries_the_shirt_along(body, shirt):
    assert np.array_equal(shirt.rest_for(body, None), shirt.rest_positions)
    assert np.array_equal(shirt.rest_for(body, np.zeros(10)), shirt.rest_positions)
    for sign in (-1.5, 1.5):
        betas = np.zeros(10)
        betas[:3] = sign
        rest = shirt.rest_for(body, betas)
        distance = igl.signed_distance(rest, body.rest_vertices(betas), body.faces)[0]
        assert distance.min() > 0.005
        assert np.abs(rest - shirt.rest_positions).max() > 0.01


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"ease": float("nan")}, "ease=nan"),
        ({"strap": 0.05}, "strap: no measure of a tshirt: use vertices, ease, clearance, sleeve, length"),
        ({"name": "gown"}, "'gown'.*tshirt, tunic, skirt.*dress"),
    ],
)
def test_a_measure_out_of_range_or_of_another_kind_is_named(body, wrong, says):
    with pytest.raises(GarmentError, match=says) as caught:
        find_template(wrong.pop("name", "tshirt")).tailor(body, **wrong)
    assert "\n" not in str(caught.value)


def test_legs_are_as_long_as_asked_and_each_follows_its_own(body):
    wardrobe = {name: tailored(name, 600) for name in ("shorts", "trousers")}
    points = {name: garment.rest_positions for name, garment in wardrobe.items()}
    heights = {name: points[name][wardrobe[name].loops["left_leg"], 1] for name in points}
    ankle = at(body, "left_ankle")[1]
    # Two equations for the crotch, from which both inseams are measured.
    shares = {name: find_template(name).measures["length"] for name in points}
    crotch = {name: (heights[name].mean() - shares[name] * ankle) / (1 - shares[name]) for name in points}
    assert crotch["shorts"] == pytest.approx(crotch["trousers"], abs=0.03)  # they differ in ease
    assert ankle < heights["trousers"].mean() < at(body, "left_knee")[1] < heights["shorts"].mean()
    for name in points:
        assert np.ptp(heights[name]) < 1e-4
        below = points[name][:, 1] < crotch[name] - 0.05
        assert np.abs(points[name][below, 0]).min() > 0.005  # apart
        weights = wardrobe[name].skinning_weights[below & (points[name][:, 0] > 0)]
        foreign = [JOINT[f"right_{joint}"] for joint in ("hip", "knee")]
        assert weights[:, foreign].max() < 0.2 and np.allclose(weights.sum(axis=1), 1.0)


def test_a_dress_follows_both_thighs_below_and_the_skin_above(body):
    dress = tailored("dress", 600)
    body_weights = body.skinning_weights[dress.body_vertices]
    y, hip = dress.rest_positions[:, 1], at(body, "left_hip")[1]
    assert np.array_equal(dress.skinning_weights[y > hip + 0.05], body_weights[y > hip + 0.05])
    _, edges, _ = edge_counts(dress.faces)
    low = (y[edges] < hip - 0.06).all(axis=1)
    steps, borrowed = (
        np.abs(w[edges[low, 0]] - w[edges[low, 1]]).max() for w in (dress.skinning_weights, body_weights)
    )
    assert steps < 0.2 and borrowed > 0.5
    assert np.allclose(dress.skinning_weights.sum(axis=1), 1.0, atol=1e-12)


def test_a_skirt_fits_waist_and_hips_and_has_two_even_rims(body):
    skirt = tailored("skirt", 600)
    points = skirt.rest_positions
    distance = igl.signed_distance(points, body.template, body.faces)[0]
    waist, hem = (points[skirt.loops[name]] for name in ("waist", "hem"))
    hip, knee = (at(body, n)[1] for n in ("left_hip", "left_knee"))
    assert (
        np.ptp(waist[:, 1]) < 1e-4 and np.ptp(hem[:, 1]) < 1e-4 and knee < hem[0, 1] < hip < waist[0, 1]
    )
    assert distance[skirt.pins].max() < 0.012  # the band lies close
    levels = np.linspace(hem[0, 1], waist[0, 1], 10)[1:-1]
    girths = [girth(points, skirt.faces, 1, level) for level in levels]
    assert np.diff(girths).max() < 0 and girths[0] > 1.6 * girths[-1]
    # Between the thighs it follows both, at the sides its own.
    x, (left, right) = (
        points[:, 0],
        (skirt.skinning_weights[:, JOINT[f"{s}_hip"]] for s in ("left", "right")),
    )
    low = np.isin(np.arange(len(x)), skirt.hem)
    assert np.abs(left - right)[low & (np.abs(x) < 0.02)].max() < 0.15
    assert (left - right)[low & (x > 0.25)].min() > 0.3


def child(body):
    """The body shrunk to 70 % of its size, a little shorter still."""
    size = np.array([0.7, 0.63, 0.7])
    return dataclasses.replace(
        body, template=body.template * size, joint_template=body.joint_template * size
    )


CUTS = ("tank_top", "trousers")  # of each kind of cut one
ON_OTHERS = [
    pytest.param(kind, other, marks=[] if kind in CUTS and other is other_mesh else pytest.mark.slow)
    for kind in KINDS
    for other in (other_mesh, child)
]


@pytest.mark.parametrize(("kind", "other"), ON_OTHERS)
def test_every_kind_fits_another_body_and_can_be_simulated(body, kind, other):
    garment = find_template(kind).tailor(other(body), vertices=500)
    assert set(garment.loops) == OPENINGS[kind] and len(garment.cloth().masses) == len(
        garment.rest_positions
    )
