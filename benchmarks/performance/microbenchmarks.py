"""Microbenchmarks: a solver step, a search of contact, a training step, a frame of a network.

Each class is one of asv: `setup` makes what its function `time_...` then does again and again. Times
belong to the machine that they were taken on: compare ratios.
"""

from __future__ import annotations

import itertools

import numpy as np

from benchmarks.assets import embedded_motions
from benchmarks.meshes import lying, rectangle
from benchmarks.methods.declared_networks import TRAININGS
from reference_sim.cloth import Cloth
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.contact_penalty import ContactPenalty
from reference_sim.energies.gravity import Gravity
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.geometry.closest_point import FaceSearch
from reference_sim.material import Material
from reference_sim.obstacle import DEFAULT_REGION
from reference_sim.time_loop import State, TimeStepper
from snug.body.parametric_body import Body
from snug.garments.templates import TSHIRT, find_template
from snug.motion.library import TRAIN
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import prepare_frames
from snug.training.optimisation_step import Trainer
from snug.training.train_network import untrained_model

DT = 1 / 30  # [s]
NOISE = 1e-4  # [m] of the flat start, which would otherwise be a saddle
VERTICES = (1000, 4400)  # of the T-shirt, about
MOTIONS = TRAIN[:3]


def dressed_body(vertices: int) -> DressedBody:
    """Return the body in a T-shirt of about so many vertices."""
    body = Body.load()
    return DressedBody(body, find_template(TSHIRT).tailor(body, vertices=vertices))


class SolverStep:
    """The first time step of a sheet, side x side vertices, that falls from two pinned corners."""

    params = ((32, 64, 128), ("newton", "lbfgs"))

    def setup(self, side: int, method: str) -> None:
        """Make the sheet, flat but for noise."""
        points, faces = rectangle("right", side - 1, side - 1, 1.0, 1.0)
        cloth = Cloth(lying(points), faces[:, ::-1], Material(), pins=[0, side - 1])
        terms = [StretchStVK(cloth), BendHinge(cloth), Gravity(cloth)]
        self.stepper = TimeStepper(cloth, terms, dt=DT, method=method)
        x = cloth.rest_positions + np.random.default_rng(0).normal(0, NOISE, cloth.rest_positions.shape)
        x[cloth.pins] = cloth.rest_positions[cloth.pins]
        self.start = State(x, np.zeros_like(x))

    def time_step(self, side: int, method: str) -> None:
        """Minimise to the default tolerance."""
        self.stepper.advance(1, self.start, None)


class ContactSearch:
    """Closest faces of the walking body to all contact samples of a T-shirt."""

    params = (VERTICES,)

    def setup(self, vertices: int) -> None:
        """Skin the T-shirt to two frames of the walk, and search the first."""
        dressed, (walk,) = dressed_body(vertices), embedded_motions(["walk"])
        body, contact = dressed.body, ContactPenalty(dressed.garment.cloth())
        before, self.samples = (contact.sample_matrix @ x for x in dressed.skinned(walk)[:2])
        start, self.positions = body.vertices(walk.poses[:2], walk.translations[:2])
        self.search = FaceSearch(body.faces, body.shaped()[body.faces].mean(axis=1))
        self.listed = self.search.listed(contact.rest_samples, DEFAULT_REGION)
        self.search.refit(start)
        self.hints = self.search.nearest(before, hints=None, samples=self.listed).faces

    def time_search(self, vertices: int) -> None:
        """Search from the answers of the frame before, the body's new pose included."""
        self.search.refit(self.positions)
        self.search.nearest(self.samples, hints=self.hints, samples=self.listed)


class TrainingStep:
    """A step of a training on a CPU; the supervised network learns from skinned vertices here."""

    params = (("snug", "supervised", "pbns"), VERTICES)
    timeout = 600.0

    def setup(self, network: str, vertices: int) -> None:
        """Do what a training does before its first step."""
        training, dressed, motions = TRAININGS[network], dressed_body(vertices), embedded_motions(MOTIONS)
        targets = (
            {motion.name: dressed.skinned(motion) for motion in motions} if training.simulated else None
        )
        self.trainer = Trainer(
            training.kind, dressed, motions, steps=10_000, seed=0, recipe=training.recipe,
            trajectories=targets,
        )  # fmt: skip
        self.numbers = itertools.count()

    def time_step(self, network: str, vertices: int) -> None:
        """Do the next step."""
        self.trainer.step(next(self.numbers))


class NetworkFrame:
    """A frame of a network and its skinning on one core. Weights are random: no time depends on them."""

    params = (("snug", "pbns", "tailornet", "santesteban2019"), VERTICES)

    def setup(self, network: str, vertices: int) -> None:
        """Make the inputs of all frames of a motion, which then comes again and again."""
        training, dressed, motions = TRAININGS[network], dressed_body(vertices), embedded_motions(MOTIONS)
        model = untrained_model(training.kind, dressed, motions, seed=0, recipe=training.recipe)
        start = prepare_frames(model, dressed, motions[0])
        self.frames = (frame for _ in itertools.count() for frame in start())

    def time_frame(self, network: str, vertices: int) -> None:
        """Compute the next frame."""
        next(self.frames)
