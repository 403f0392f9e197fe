"""A small garment for tests of the networks: a tube around the trunk, 150 vertices, made in milliseconds."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import torch

from snug.body.parametric_body import Body
from snug.body.skinning import skin
from snug.garments.garment import Garment
from snug.garments.meshing import nearest_body_vertices
from snug.garments.templates import find_template
from snug.kinds import KINDS
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.recipe import DEFAULT, Recipe
from snug.training.contact_cache import PARTS, Patch
from snug.training.optimisation_step import Trainer
from snug.training.train_network import train_network

AROUND, RINGS = 15, 10
PLAIN = replace(DEFAULT, mixed=0.0)


@cache
def tube_dress() -> DressedBody:
    """From the hips to below the arms, 3 cm and more off the body in the T-pose."""
    body = Body.load()
    trunk = body.skinning_weights[:, [0, 3, 6, 9]].sum(axis=1) > 0.5
    low, high = body.joint_template[0, 1], body.joint_template[9, 1]
    points = body.template[trunk]
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = []
    for height in np.linspace(low, high, RINGS):
        near = points[np.abs(points[:, 1] - height) < 0.03]
        centre, half = (near.max(0) + near.min(0)) / 2, np.ptp(near, axis=0) / 2 + 0.04
        ring = [
            centre[0] + half[0] * np.sin(angle),
            np.full(AROUND, height),
            centre[2] + half[2] * np.cos(angle),
        ]
        rings.append(np.stack(ring, axis=1))
    positions = np.concatenate(rings)
    index = np.arange(AROUND * RINGS).reshape(RINGS, AROUND)
    a, b = index[:-1], np.roll(index[:-1], -1, axis=1)
    c, d = index[1:], np.roll(index[1:], -1, axis=1)
    faces = np.concatenate(
        [np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)]
    )
    nearest = nearest_body_vertices(body, positions)
    weights = np.asarray(body.skinning_weights)[nearest]
    return DressedBody(body, Garment("tube", positions, faces, nearest, weights))


@cache
def tailored(kind: str, vertices: int) -> Garment:
    """A garment of a template on the package's body, tailored once."""
    return find_template(kind).tailor(Body.load(), vertices=vertices)


def swaying(frames: int = 24, *, name: str = "sway", degrees: float = 25.0, fps: float = 30.0) -> Motion:
    """The trunk bends and turns while the body walks along z with a hop."""
    t = np.arange(frames) / fps
    poses = np.zeros((frames, 24, 3))
    poses[:, 3, 2] = np.deg2rad(degrees) * np.sin(2 * np.pi * t)
    poses[:, 6, 1] = np.deg2rad(degrees) * np.sin(2 * np.pi * 0.7 * t)
    translations = np.stack([0 * t, 0.05 * np.abs(np.sin(3 * t)), 1.2 * t], axis=1)
    return Motion(name, poses, translations, fps=fps)


def leaning(motion: Motion) -> Motion:
    """The same motion with the root bent forward and to a side."""
    poses = motion.poses.copy()
    poses[:, 0] += [0.3, 0.0, 0.2]
    return Motion(motion.name, poses, motion.translations, fps=motion.fps)


def beside_skin(contact, frames: list[int], **region) -> tuple[Patch, torch.Tensor, torch.Tensor]:
    """The patch of skin that samples may touch; it (T, P, 3) and the tube in frames of swaying(), posed."""
    dressed = tube_dress()
    patch = Patch(contact.rest_samples, dressed.body.rest_vertices(), dressed.body.faces, **region)
    weights = torch.as_tensor(dressed.body.skinning_weights[patch.body_vertices]).float()
    transforms = dressed.transforms(swaying().poses[frames])
    posed = skin(torch.as_tensor(patch.rest), weights, transforms)
    return patch, posed, skin(dressed.rest(), dressed.weights(5), transforms)


def planes_of(anchors, frames, rows, positions, normals) -> tuple[np.ndarray, np.ndarray]:
    """Points and unit normals (N, S, 3) at the anchors of frames, float64; bodies are rows of (R, P, 3)."""
    corners = anchors.patch.faces[np.asarray(anchors.faces)[frames]]
    last = np.asarray(anchors.barycentric)[frames] / PARTS
    weights = np.concatenate([1 - last.sum(-1, keepdims=True), last], -1)
    every = np.asarray(rows)[:, None, None]
    points, directions = ((weights[..., None] * a[every, corners]).sum(-2) for a in (positions, normals))
    return points, directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def make_trainer(recipe: Recipe = PLAIN, kind: str = "snug", *, motions=None, trainer=Trainer, **options):
    """A trainer of a kind for the tube, on one swaying motion unless others are given."""
    options = {"steps": 400, "seed": 0, **options}
    return trainer(kind, tube_dress(), motions or [swaying(30)], recipe=recipe, **options)


def stand_in(motion: Motion) -> np.ndarray:
    """World vertices (T, V, 3) [m] in place of a simulation: the tube, the wider the more it bends."""
    bend = torch.as_tensor(motion.poses[:, 3, 2]).float()[:, None, None]
    offsets = (0.05 + 0.1 * bend) * tube_dress().rest() + torch.tensor([0.0, -0.01, 0.0])
    return tube_dress().skin(motion, smoothing=20, offsets=offsets)


def short(kind: str = "snug", *, motions=None, dressed=None, recipe: Recipe = PLAIN, **options):
    """A network after 7 steps, taught by stand-ins for simulations where its kind needs some."""
    motions = motions or [swaying(30)]
    if kind in KINDS and not KINDS[kind].physics:
        options = {"trajectories": {motion.name: stand_in(motion) for motion in motions}, **options}
    options = {"steps": 7, "seed": 0, "every": 4, "progress": False, **options}
    return train_network(kind, dressed or tube_dress(), motions, recipe=recipe, **options)


def random_model(kind: str, dressed: DressedBody, motions, *, seed: int, recipe: Recipe | None = None):
    """A network after one step from a random last layer; from the recipe's, of zeros, it is skinning."""
    recipe = replace(recipe or KINDS[kind].recipe, zero_last_layer=False)
    return short(kind, motions=motions, dressed=dressed, recipe=recipe, seed=seed, steps=1)
