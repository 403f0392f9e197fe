"""Reference solver, its variants, and L-BFGS stopped early, as methods.

Reference simulation with energies of another material, evaluated by the energies that the scene declares.

It is judged, as every method, by the energies that the scene declares. Its start is theirs too.

Perturbed reference: the reference from a start moved a little, which shows the spread of valid answers.

Wrinkling cloth has several minima, and which one is reached hangs on the last digits. What these runs differ
by is the uncertainty of whatever is compared with the reference.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.method import Method
from benchmarks.scene import BuiltScene
from benchmarks.scenes.self_contact import crossing, demand_uncrossed, with_self_contact
from reference_sim.energies.bend_hinge import BendHinge
from reference_sim.energies.energy import Energy
from reference_sim.energies.stretch_spring import StretchSpring
from reference_sim.energies.stretch_stvk import StretchStVK
from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS
from reference_sim.time_loop import simulate_with
from reference_sim.time_step import TimeStepper
from reference_sim.trajectory import Trajectory
from snug.training.physics_loss import BENDING


@dataclass
class Simulation(Method):
    """Simulation whose steps are minimised to a tolerance, or stopped after `max_iterations` a step."""

    options: dict[str, Any]
    scene: BuiltScene | None = None
    stepper: TimeStepper | None = None
    announced: bool = False

    def prepare(self, scene: BuiltScene) -> None:
        """Settle the start, set the solver up, and compile by two frames that are thrown away."""
        self.scene = scene
        # Solvers that stop early are approximations of the declared terms, and a function that makes a
        # minimiser knows no terms that join a step late.
        declared_alone = "max_iterations" in self.options or callable(self.options.get("method"))
        self.stepper = TimeStepper(
            scene.cloth,
            scene.energies if declared_alone else scene.simulated_energies,
            dt=scene.dt,
            obstacle=scene.obstacle,
            **self.options | {"substeps": scene.substeps * self.options.get("substeps", 1)},
        )
        self._simulate(frames=min(2, scene.frames))

    def run(self) -> Trajectory:
        """Simulate all frames, with the solver as it was when it was set up."""
        assert self.scene is not None and self.stepper is not None
        self.stepper.start_again()
        # Hours at the paper's scale: a bar with the time left, a microsecond of a frame's milliseconds.
        # Once: short runs are done again until enough time is measured.
        label = self.scene.name if self.scene.dressed and not self.announced else None
        self.announced = True
        return self._simulate(frames=self.scene.frames, progress=label)

    def _simulate(self, *, frames: int, progress: str | None = None) -> Trajectory:
        scene, stepper = self.scene, self.stepper
        assert scene is not None and stepper is not None
        return simulate_with(
            stepper,
            frames=frames,
            start=scene.start,
            velocity=scene.start_velocity,
            pin_positions=scene.pin_positions,
            progress=progress,
        )


def make_simulation(*, models: Path, seed: int, **options: Any) -> Simulation:
    """Make a simulation with the reference's tolerance and time step, or with those in the options."""
    return Simulation(options=options)


def make_fast_lbfgs(*, models: Path, seed: int, iterations: int) -> Simulation:
    """Make a simulation whose every step is `iterations` of compiled L-BFGS."""
    return Simulation(options={"method": CompiledLBFGS, "max_iterations": iterations})


@dataclass(kw_only=True)
class OtherMaterial(Simulation):
    """Reference simulation with some energies exchanged. exchange: one of EXCHANGES."""

    exchange: str

    def prepare(self, scene: BuiltScene) -> None:
        """Exchange the energies and prepare; the start stays that of the scene's own material."""
        start = scene.start_state
        energies, minimised = (
            tuple(map(EXCHANGES[self.exchange], terms)) for terms in (scene.energies, scene.minimised)
        )
        super().prepare(
            dataclasses.replace(scene, energies=energies, minimised=minimised, settle=lambda: start)
        )


def _printed_bending(term: Energy) -> Energy:
    """Return hinges as the SNUG paper prints them, k/2 theta^2 each, not scaled; other terms as they are."""
    if not isinstance(term, BendHinge):
        return term
    return BendHinge(term.cloth, scaling="none", rest_angles=term.rest_angles)


def _springs(term: Energy) -> Energy:
    """Return k (l - l0)^2 of each edge, which recipe `springs` trains on, in place of the membrane."""
    return StretchSpring(term.cloth) if isinstance(term, StretchStVK) else term


def _pbns_springs(term: Energy) -> Energy:
    """Return PBNS's springs and hinges, as recipe `pbns-springs` has them; the weight is the scene's."""
    exchanged = _printed_bending(_springs(term))
    if isinstance(exchanged, BendHinge):
        exchanged.stiffness = np.full(len(exchanged.stencils), 2.0 * BENDING)
    return exchanged


EXCHANGES = {"printed-bending": _printed_bending, "springs": _springs, "pbns-springs": _pbns_springs}


def make_other_material(*, models: Path, seed: int, exchange: str) -> OtherMaterial:
    """Make the reference with that exchange."""
    return OtherMaterial(options={}, exchange=exchange)


@dataclass
class PerturbedStart(Simulation):
    """Simulation from a start whose free vertices are each moved by `shift` [m] in a random direction.

    The directions are seeded by the shift, so that every run is perturbed differently.
    """

    shift: float = 0.0

    def prepare(self, scene: BuiltScene) -> None:
        """Move the start and prepare the simulation."""
        seed = np.float64(self.shift).view(np.uint64)
        direction = np.random.default_rng(int(seed)).standard_normal(scene.start.shape)
        direction *= self.shift / np.linalg.norm(direction, axis=1, keepdims=True)
        direction[scene.cloth.pins] = 0.0
        start = scene.start_state + np.stack([direction, np.zeros_like(direction)])
        super().prepare(dataclasses.replace(scene, settle=lambda: start))


def make_perturbed_start(*, models: Path, seed: int, shift: float) -> PerturbedStart:
    """Make the reference from a start perturbed by `shift` [m]."""
    return PerturbedStart(options={}, shift=shift)


class SelfContact(Simulation):
    """Reference simulation with self-contact, from the scene's start, or from one of its own."""

    def prepare(self, scene: BuiltScene) -> None:
        """Settle the garment anew, with self-contact, where the cloth of the scene's start crosses itself.

        Raises ValueError where that start cannot be had without a crossing.
        """
        energies, settle = with_self_contact(scene.energies), scene.settle_uncrossed
        if settle is not None and crossing(scene.start, energies):
            scene = dataclasses.replace(scene, settle=settle)
        demand_uncrossed(scene.start, energies, scene.name)
        super().prepare(dataclasses.replace(scene, minimised=energies))


def make_self_contact(*, models: Path, seed: int) -> SelfContact:
    """Make the reference with self-contact."""
    return SelfContact(options={})
