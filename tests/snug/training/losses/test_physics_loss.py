"""The loss is the simulator's energy, its fast backward is the derivative of the definition, and contact
planes are where an independent search finds them."""

from dataclasses import replace

import igl
import numpy as np
import pytest
import torch

from reference_sim.energies import BendHinge, ContactPenalty, Gravity, StretchStVK
from snug.body.skinning import skin
from snug.kernels.contact import byte_normals
from snug.kernels.skinning import from_lanes, to_lanes
from snug.named_recipes import PAPER, PBNS_SPRINGS, RECIPES
from snug.recipe import DEFAULT, Recipe
from snug.training.contact_cache import EXACT, PARTS, ContactCache, Patch
from snug.training.physics_loss import ClosedForm, PhysicsLoss, make_contact
from tests.snug.training.dressing import beside_skin, planes_of, swaying, tube_dress

DT = 1 / 30


def posed_batch(dtype=torch.float64, seed=0):
    """Crumpled garments in three poses: x (1, 3, V, 3) relative to the pelvis, and planes near them."""
    dressed, motion = tube_dress(), swaying()
    random = np.random.default_rng(seed)
    frames = [5, 6, 7]
    rest = dressed.rest().double() + torch.as_tensor(random.normal(0, 0.006, (3, dressed.vertices, 3)))
    x = skin(rest, dressed.weights(5).double(), dressed.transforms(motion.poses[frames]).double())[None]
    contact = ContactPenalty(dressed.cloth)
    samples = contact.sample_matrix @ x[0, 0].numpy()
    normals = random.normal(size=(1, 3, *samples.shape))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    points = np.stack([contact.sample_matrix @ x[0, t].numpy() for t in range(3)])[None] - 0.002 * normals
    return dressed, x.to(dtype), torch.as_tensor(points), torch.as_tensor(normals)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("term", ["strain", "bending", "gravity"])
def test_closed_form_backward_is_the_derivative_of_the_definition(term, dtype):
    dressed, x, *_ = posed_batch(dtype)
    energy = {E.name: E for E in (StretchStVK, BendHinge, Gravity)}[term](dressed.cloth)
    fast, slow = x.clone().requires_grad_(), x.double().requires_grad_()
    weight = torch.tensor([[1.0, -2.0, 0.5]])  # each configuration has its own factor from above
    value = ClosedForm.apply(fast, energy)
    (value * weight).sum().backward()
    exact = energy.energy(slow).sum(-1)
    (exact * weight).sum().backward()
    tolerance = 1e-10 if dtype == torch.float64 else 2e-4  # float32 of 1e-6 m on centimetre edges
    assert value.shape == (1, 3) and fast.grad.dtype == dtype
    assert slow.grad.norm() > 1e-3
    assert torch.allclose(value.double(), exact, rtol=tolerance)
    assert (fast.grad.double() - slow.grad).norm() < tolerance * slow.grad.norm()


@pytest.mark.parametrize("windows", [1, 16, 17])
def test_energies_in_lanes_are_the_definitions_and_their_derivatives(windows):
    """All terms of a recipe together, whose gradients the kernels add up."""
    dressed, x, *_ = posed_batch()
    frames = torch.cat([x, x.flip(1)], 1) + 0.01 * torch.arange(6.0)[:, None, None] ** 2
    random = np.random.default_rng(windows)
    x = (frames + torch.as_tensor(random.normal(0, 0.003, (windows, *frames.shape[1:])))).float()
    recipe = replace(DEFAULT, terms=("strain", "bending", "gravity", "inertia"))
    ahead = 0.01 * torch.as_tensor(random.normal(size=(windows, 6, 3))).float()
    evaluations = []
    for kernels in (True, False):
        loss = PhysicsLoss(dressed.cloth, recipe, dt=DT, kernels=kernels)
        at = (x if kernels else x.double()).clone().requires_grad_()
        terms = loss(at, ahead, None)
        (0.1 * torch.stack(list(terms.values()))).sum().backward()
        evaluations.append(([value.detach().double() for value in terms.values()], at.grad.double()))
    (fast, gradient), (slow, exact) = evaluations
    assert not fast[3][:, :2].any() and (fast[3][:, 2:] > 0).all()
    for one, other in zip(fast, slow):
        assert one.shape == (windows, 6) and torch.allclose(one, other, rtol=1e-4)
    assert exact.norm() > 1e-3 and (gradient - exact).norm() < 2e-4 * exact.norm()


def test_energies_in_lanes_are_not_weighed():
    dressed, x, *_ = posed_batch(torch.float32)
    terms = PhysicsLoss(dressed.cloth, DEFAULT, dt=DT)(x.requires_grad_(), torch.zeros(1, 3, 3), None)
    with pytest.raises(ValueError, match="weigh none"):
        (terms["strain"] + 2 * terms["bending"]).sum().backward()


@pytest.mark.parametrize("form", ["length_area", "none"])
@pytest.mark.parametrize("material", ["stvk", "springs"])
def test_hinges_are_those_of_the_recipe(material, form):
    dressed, x, *_ = posed_batch()
    recipe = Recipe(terms=("bending",), material=material, bending=form)
    terms = PhysicsLoss(dressed.cloth, recipe, dt=DT)(x, torch.zeros(1, 3, 3), None)
    hinges = BendHinge(dressed.cloth, scaling=form)
    expected = [hinges.value_and_gradient(frame)[0] for frame in x[0].numpy()]
    assert terms["bending"][0].tolist() == pytest.approx(expected, rel=1e-12)
    assert DEFAULT.bending == PAPER.bending == "length_area" != RECIPES["printed-bending"].bending


def found(patch: Patch, anchors: np.ndarray, weights: np.ndarray, positions: np.ndarray) -> np.ndarray:
    weights = weights / PARTS if weights.dtype == np.uint8 else weights
    corners = positions[patch.faces[anchors]]
    return corners[:, 0] + np.einsum("sc,sci->si", weights, corners[:, 1:] - corners[:, :1])


def test_contact_search_finds_the_closest_allowed_point():
    contact = ContactPenalty(tube_dress().cloth)
    # A region this small leaves many a sample's nearest skin out of bounds when the trunk bends.
    patch, *posed = beside_skin(contact, [8], region=0.07)
    skin_now, garment = (x[0].numpy() for x in posed)
    samples = (contact.sample_matrix @ garment + [0.0, 0.05, 0.0]).astype(np.float32)
    # Some of them are drawn to where they may touch, so that all distances from nothing to 8 cm occur.
    touched = found(patch, *patch.search(samples, skin_now, exact=True), skin_now)
    random = np.random.default_rng(7)
    samples = touched + random.uniform(0, 1, (len(samples), 1)).astype(np.float32) * (samples - touched)
    anchors = random.integers(0, len(patch.faces), len(samples))
    faces, barycentric = patch.search(samples, skin_now, anchors)
    assert barycentric.sum(1).max() < 1 + 1e-5 and barycentric.min() > -1e-5
    distance = np.linalg.norm(found(patch, faces, barycentric, skin_now) - samples, axis=1)
    reach = np.linalg.norm(patch.centroids[None] - patch.sample_rest[:, None], axis=2)  # (S, Q)
    shortest, moved = np.full(len(samples), np.nan), 0
    for s in range(0, len(samples), 7):
        allowed = np.flatnonzero(reach[s] < patch.region)
        if len(allowed) == 0:
            continue
        assert reach[s, faces[s]] < patch.region
        point, mesh = samples[s : s + 1].astype(float), skin_now.astype(float)
        exact = igl.point_mesh_squared_distance(point, mesh, patch.faces[allowed].astype(np.int64))[0]
        free = igl.point_mesh_squared_distance(point, mesh, patch.faces.astype(np.int64))[0]
        shortest[s] = np.sqrt(exact[0])
        moved += bool(free[0] < exact[0] - 1e-6)
    near, far = shortest < EXACT, shortest >= EXACT
    assert near.sum() > 10 and far.sum() > 40 and moved > 5
    assert np.abs(distance - shortest)[near].max() < 1e-6
    # Farther away an old anchor may stand, but none at more than twice the distance.
    assert (distance < 2 * shortest + 1e-6)[far].all() and (distance > 1.01 * shortest)[far].any()
    # Unless every answer is to be exact, wherever it began.
    exact = patch.search(samples, skin_now, anchors, exact=True)
    first = np.linalg.norm(found(patch, *exact, skin_now) - samples, axis=1)
    assert np.abs(first - shortest)[near | far].max() < 1e-6


@pytest.mark.parametrize("recipe", [DEFAULT, PBNS_SPRINGS], ids=["cubic", "squared"])
def test_energy_at_anchors_is_that_of_their_planes(recipe):
    contact = make_contact(tube_dress().cloth, recipe)
    patch, posed, garment = beside_skin(contact, [2, 9])
    # The back lies a little off the skin, the front deep under it.
    x, skin_now = garment - torch.tensor([0.0, 0.0, 0.05]), posed.numpy()
    anchors, frames = ContactCache(patch, 3), np.array([2, 0])
    normals = byte_normals(skin_now, patch.faces)
    for row, frame in enumerate(frames):
        samples = (contact.sample_matrix @ x[row].numpy()).astype(np.float32)
        anchors.requery(int(frame), samples, skin_now[row])

    def energies():
        lanes, rows = to_lanes(x[:, None]), np.arange(2)[:, None]
        gradients = np.zeros_like(lanes)
        values = anchors.energy(contact, lanes, gradients, frames[:, None], rows, skin_now, normals)
        return (from_lanes(array, 2, 1)[:, 0].numpy() for array in (values, gradients))

    values, gradients = energies()
    points, directions = planes_of(anchors, frames, np.arange(2), skin_now, normals)
    for row in range(2):
        contact.points, contact.normals = points[row], directions[row]
        value, gradient = contact.value_and_gradient(x[row].numpy().astype(float))
        assert value > 1e-3 and values[row] == pytest.approx(value, rel=1e-4)
        assert np.linalg.norm(gradients[row] - gradient) < 1e-4 * np.linalg.norm(gradient)
    x[1, 3] = np.nan
    values, _ = energies()
    assert np.isfinite(values[0]) and np.isnan(values[1])
