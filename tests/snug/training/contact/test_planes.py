"""Contact anchors of a training set: first searches, propagation, and walks in between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from reference_sim.geometry.surface import vertex_normals
from snug.body.skeleton import JOINT
from snug.body.skinning import skin
from snug.kernels.contact import byte_normals, triangle_adjacency
from snug.recipe import DEFAULT
from snug.training import contact_planes
from snug.training.augmentation import augment
from snug.training.contact_planes import MARKED, NEAR, REACH
from tests.reference_sim.meshes import sphere
from tests.snug.training.dressing import PLAIN, make_trainer, swaying, tube_dress

MOTIONS = [swaying(30), swaying(11, name="slow", degrees=10.0)]


def test_across_a_side_lies_the_face_that_shares_it():
    faces = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]])
    assert triangle_adjacency(faces).tolist() == [[1, -1, -1], [2, -1, 0], [-1, -1, 1]]


def test_normals_of_more_frames_than_lanes_are_those_of_each():
    vertices, faces = sphere(2, 0.1)
    moved = vertices + np.random.default_rng(0).normal(scale=0.01, size=(21, *vertices.shape))
    normals = byte_normals(moved.astype(np.float32), faces.astype(np.int32))
    exact = 127 * np.array([vertex_normals(frame, faces) for frame in moved])
    assert normals.dtype == np.int8 and np.abs(normals - exact).max() < 0.5 + 1e-3


@pytest.mark.parametrize("kernels", [True, False])
def test_what_is_no_number_or_not_trusted_moves_no_anchor(kernels):
    trainer = make_trainer(motions=MOTIONS, kernels=kernels)
    contact = trainer.contact
    before = [
        torch.as_tensor(table).clone() for table in (contact.cache.faces, contact.cache.barycentric)
    ]

    def kept():
        now = (contact.cache.faces, contact.cache.barycentric)
        return [torch.equal(torch.as_tensor(table), copy) for table, copy in zip(now, before)]

    batch = trainer.data.batch(np.arange(4), None)
    posed = contact.bodies.pose(batch)
    x = skin(batch.rest, trainer.weights, batch.transforms) - torch.tensor([0.0, 0.0, 0.08])
    for vertices, trusted, moved in ((torch.nan * x, True, False), (x, False, False), (x, True, True)):
        trainer.loss(vertices, batch.lead, contact.planes(batch, posed, vertices))
        assert all(kept()) == (vertices is not x)
        contact.settle(batch.frames, trusted=trusted)
        assert all(kept()) == (not moved)


def patch_of(contact, motion, frames, betas):
    """The patch of the body of that shape in frames of the motion, from the pelvis."""
    body = tube_dress().body
    whole = body.vertices(motion.poses[frames], motion.translations[frames], betas=betas)
    pelvis = body.joints(betas)[0] + motion.translations[frames][:, None]
    return whole[:, contact.patch.body_vertices] - pelvis


@pytest.mark.parametrize("kernels", [True, False])
def test_a_sampled_shape_is_touched_where_its_body_is(kernels):
    trainer = make_trainer(replace(PLAIN, shape_range=3.0), motions=MOTIONS, kernels=kernels)
    contact = trainer.contact
    betas = np.random.default_rng(2).uniform(-3, 3, (2, 10))
    batch = trainer.data.batch(
        np.array([4, 17]), betas
    )  # windows of the first motion begin at every frame
    rows, positions, _ = contact.bodies.pose(batch)
    assert sorted(rows.tolist()) == list(range(6))
    expected = [patch_of(contact, MOTIONS[0], slice(f, f + 3), shape) for f, shape in zip((4, 17), betas)]
    assert np.allclose(np.asarray(positions)[rows], np.concatenate(expected), atol=1e-4)


@pytest.mark.parametrize("kernels", [True, False])
def test_a_clip_of_another_shape_is_touched_where_its_body_is(kernels):
    recipe = replace(PLAIN, mixed=3.0, shape_range=3.0, shape_of="clip")
    trainer = make_trainer(recipe, motions=MOTIONS, kernels=kernels)
    contact, data = trainer.contact, trainer.data
    assert (contact.bodies.kept is not None) == kernels
    clips = [*MOTIONS, *augment(MOTIONS, trainer.recipe, vertices=trainer.dressed.vertices, seed=0)]
    for place in (1, 2, 3):
        first = data.first[place]
        expected = patch_of(contact, clips[place], slice(3, 6), data.shapes[place])
        rows, positions, _ = contact.bodies.pose(data.at(first + np.array([[3, 4, 5]])))
        assert np.allclose(np.asarray(positions)[rows], expected, atol=1e-4)
        marks = contact.bodies.marks[first + 3 : first + 6]
        assert np.allclose(marks, expected[:, ::MARKED], atol=1e-4)


def propagated(motions, frame, monkeypatch):
    """The frames that have the anchors of `frame`, of 41, once it alone has been searched in a step."""
    monkeypatch.setattr(contact_planes, "REFRESH", 1 / 48)  # one frame a step
    trainer = make_trainer(motions=motions)
    contact = trainer.contact
    searched = []
    requery = contact.cache.requery

    def marked(number, *rest, **how):
        requery(number, *rest, **how)
        searched.append(number)
        contact.cache.faces[number] = 7

    monkeypatch.setattr(contact.cache, "requery", marked)
    trainer.order = np.array([frame - 1, *[0] * 15])
    trainer.step(0)
    assert searched == [frame]
    return np.flatnonzero((contact.cache.faces == 7).all(1)).tolist()


def test_what_is_searched_is_propagated_around_it_but_to_no_other_motion(monkeypatch):
    slow = [swaying(30, degrees=1.0), swaying(11, name="slow", degrees=1.0)]
    assert REACH == 3
    assert propagated(slow, 28, monkeypatch) == [25, 26, 27, 28, 29]
    assert propagated(slow, 20, monkeypatch) == [17, 18, 19, 20, 21, 22, 23]


def test_nothing_is_propagated_to_a_frame_in_which_the_body_is_elsewhere(monkeypatch):
    motion = swaying(41, degrees=1.0)
    motion.poses[19, JOINT["spine1"], 0] += 0.2
    motion.poses[22:, JOINT["left_shoulder"], 2] += 0.3
    height = 0.2  # m: of what the spine carries, far more than NEAR in radians of either turn
    assert 0.2 * height > NEAR
    assert propagated([motion], 20, monkeypatch) == [20, 21]


def test_each_part_of_an_epoch_passes_over_all_motions():
    trainer = make_trainer(motions=[swaying(402)])
    count = len(trainer.data.starts)
    windows = np.concatenate([trainer.draw() for _ in range(count // trainer.windows)])
    assert len(np.unique(windows)) == len(windows) == count
    part = np.sort(windows[: count // DEFAULT.even])
    assert (np.diff(part) == DEFAULT.even).all()


def test_planes_at_nearest_vertices_are_those_of_brute_force():
    """Loss and gradient of a window by the published formulas, in numpy: argmin, dot product, cube."""
    recipe = replace(PLAIN, contact_samples="nearest_vertices", contact_stiffness=1e5)
    garment, body = tube_dress(), tube_dress().body
    trainers = [make_trainer(recipe, motions=MOTIONS, kernels=kernels) for kernels in (True, False)]
    batch = trainers[0].data.batch(np.array([4]), None)
    shift = torch.tensor([0.01, 0.0, 0.08])
    x = (skin(batch.rest, trainers[0].weights, batch.transforms) - shift).requires_grad_()
    shifts = MOTIONS[0].translations[4:7]
    of_body = body.vertices(MOTIONS[0].poses[4:7], shifts) - body.joint_template[0] - shifts[:, None]
    stiffness = 1e5 * garment.cloth.areas.sum() / garment.vertices
    energies, gradient = np.zeros(3), np.zeros((3, garment.vertices, 3))
    for t, (places, skins) in enumerate(zip(x.detach().numpy()[0].astype(float), of_body)):
        a, b, c = (skins[body.faces[:, corner]] for corner in range(3))
        normals = np.zeros_like(skins)
        for corner in range(3):
            np.add.at(normals, body.faces[:, corner], np.cross(b - a, c - a))
        near = np.array([((skins - place) ** 2).sum(1).argmin() for place in places])
        normal = normals[near] / np.linalg.norm(normals[near], axis=1, keepdims=True)
        depth = np.maximum(0.004 - ((places - skins[near]) * normal).sum(1), 0.0)
        energies[t] = stiffness * (depth**3).sum()
        gradient[t] = -3 * stiffness * (depth**2)[:, None] * normal
    assert (depth > 0).sum() > 20
    for trainer in trainers:
        trainer.step(0)
        energy = trainer.loss(x, batch.lead, trainer.nearest.planes(batch, x))["collision"]
        (slope,) = torch.autograd.grad(energy.sum(), x)
        assert np.allclose(energy.detach()[0], energies, rtol=1e-3)
        assert np.allclose(slope[0], gradient, rtol=1e-2, atol=1e-3 * np.abs(gradient).max())
