"""What the hard motions share: one body, one shirt settled in the walk's first pose, and who puts it on."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .hard_motion_cases import MOTION, ORDINARY_CASE, HardMotion, looped

if TYPE_CHECKING:
    from snug.dressed_body import DressedBody
    from snug.motion import Motion

    from ..presets import Preset
    from ..scene import BuiltScene
    from ..wardrobe import Wardrobe

REFERENCE, FREE = "simulation", "skinning"
STATUS = {"converged": "ok", "max_iterations": "stalled"}  # a simulator's words in those of a row
CHUNK = 500  # frames of a long roll-out whose offsets are held at once

Contestant = tuple[str, int]  # method and seed


@dataclass(frozen=True)
class Trained:
    """A network of this run: the method, its seed and its file."""

    method: str
    seed: int
    path: Path


@dataclass(frozen=True)
class RollOut:
    """Positions (T,V,3) [m] of a contestant, and how it says that it ended: a status of a row, and why."""

    positions: np.ndarray
    status: str = "ok"
    reason: str = ""


@dataclass
class HardStage:
    """Body, shirt, walk and networks: everything that the cases share."""

    wardrobe: Wardrobe
    preset: Preset
    walk: Motion
    networks: tuple[Trained, ...]

    @cached_property
    def dressed(self) -> DressedBody:
        from snug.dressed_body import DressedBody

        return DressedBody(self.wardrobe.body, self.wardrobe.garment)

    @cached_property
    def settled(self) -> np.ndarray:
        """The shirt (V,3) [m] at rest in the walk's first pose."""
        from ..scenes import dressed_scene

        return dressed_scene(MOTION).build(self.preset, self.wardrobe).start

    @cached_property
    def ordinary(self) -> tuple[dict[Contestant, RollOut], dict[Contestant, float]]:
        """The ordinary walk by everybody, and the worst strain energy of each [J]."""
        scene = self.scene(ORDINARY_CASE)
        roll_outs = self.roll_outs(ORDINARY_CASE, scene)
        return roll_outs, {who: float(strains(scene, t.positions).max()) for who, t in roll_outs.items()}

    def scene(self, case: HardMotion) -> BuiltScene:
        """The walk made hard; its material is the one that judges and that the simulator is given."""
        from reference_sim import Cloth, Material, Obstacle

        from ..scene import BuiltScene, Dressed
        from ..scenes.dressed_body import declared_energies

        body, garment = self.wardrobe.body, self.wardrobe.garment
        motion, betas = case.make(self.walk), self.betas(case)
        changed = {name: factor * getattr(Material(), name) for name, factor in case.material.items()}
        cloth = Cloth(garment.rest_positions, garment.faces, dataclasses.replace(Material(), **changed))
        posed = body.vertices(motion.poses, motion.translations, betas)
        return BuiltScene(
            name=f"hard_motions/{case.name}",
            cloth=cloth,
            energies=declared_energies(cloth),
            dt=1.0 / motion.fps,
            frames=motion.frames,
            settle=lambda: self.settled if betas is None else self.put_on(motion, betas),
            # Which faces a vertex may touch is a matter of the body that the shirt was made for.
            obstacle=Obstacle(posed, body.faces, rest_positions=body.shaped()),
            origin_heights=body.joints(betas)[0, 1] + motion.translations[:, 1],
            dressed=Dressed(body, garment, motion),
        )

    def betas(self, case: HardMotion) -> np.ndarray | None:
        if not case.betas:
            return None
        shapes = self.wardrobe.body.shape_count
        if shapes < len(case.betas):
            raise ValueError(f"the body has {shapes} shapes, {case.name} needs {len(case.betas)}")
        return np.pad(case.betas, (0, shapes - len(case.betas)))

    def put_on(self, motion: Motion, betas: np.ndarray) -> np.ndarray:
        """The shirt (V,3) [m] on a body of another shape that stands as in the motion's first frame."""
        body = self.wardrobe.body
        root = body.transforms(motion.poses[:1], motion.translations[:1], betas)[0, 0]
        return self.wardrobe.garment.rest_for(body, betas) @ root[:, :3].T + root[:, 3]

    def roll_outs(self, case: HardMotion, scene: BuiltScene) -> dict[Contestant, RollOut]:
        """By the simulator, by skinning and by every network."""
        from snug.rollout import roll_out
        from snug.trained_model import TrainedModel

        assert scene.dressed is not None
        motion, betas = scene.dressed.motion, self.betas(case)
        found = {(REFERENCE, 0): simulated(scene), (FREE, 0): RollOut(self.skinned(motion, betas))}
        for network in self.networks:
            trajectory = roll_out(TrainedModel.load(network.path), self.dressed, motion, betas)
            rolled = RollOut(trajectory.positions, trajectory.status, trajectory.reason)
            found[network.method, network.seed] = rolled
        return found

    def skinned(self, motion: Motion, betas: np.ndarray | None) -> np.ndarray:
        """(T,V,3) [m] of skinning alone."""
        from snug.recipe import DEFAULT

        return self.dressed.skinned(motion, betas, smoothing=DEFAULT.smoothing)

    def long_roll_out(
        self, network: Trained, frames: int, every: int
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """The walk in a loop of L frames, carried on for `frames` without a reset.

        Returns every `every`-th frame as positions (S,V,3) [m] and their distance to skinning (S,V) [m], and
        the drift: root mean square over the last loop and all vertices of the offset less that of the second
        loop at the same place in it [m]. Raises ValueError for fewer than three loops, which have none.
        """
        import torch

        from snug.skinning import skin
        from snug.trained_model import TrainedModel, find_kind

        model = TrainedModel.load(network.path)
        motion, loop = looped(self.walk, frames)
        features = self.dressed.features(motion, model.recipe, kind=find_kind(model.kind).features)
        rest, weights = self.dressed.rest(), self.dressed.weights(model.recipe.smoothing)
        transforms = self.dressed.transforms(motion.poses)
        last = (frames // loop - 1) * loop
        if last <= loop:
            raise ValueError(f"a drift needs three loops, {3 * loop} frames, not {frames}")
        kept: dict[int, np.ndarray] = {}
        sampled, away, state = [], [], None
        with torch.inference_mode():
            for begin in range(0, frames, CHUNK):
                offsets, state = model.network(features[None, begin : begin + CHUNK], state)
                for frame, offset in enumerate(offsets[0], start=begin):
                    if loop <= frame < 2 * loop or last <= frame < last + loop:
                        kept[frame] = offset.numpy()
                    if frame % every == 0:
                        worn = skin(rest + offset, weights, transforms[frame]).double()
                        bare = skin(rest, weights, transforms[frame]).double()
                        sampled.append(worn.numpy())
                        away.append(torch.linalg.vector_norm(worn - bare, dim=-1).numpy())
        moved = [kept[last + k] - kept[loop + k] for k in range(loop)]
        drift = float(np.sqrt(3.0 * (np.stack(moved).astype(float) ** 2).mean()))
        return np.stack(sampled), np.stack(away), drift


def simulated(scene: BuiltScene) -> RollOut:
    """By the simulator as it is; a step that it gives up says so."""
    from reference_sim import simulate

    trajectory = simulate(
        scene.cloth, scene.energies, dt=scene.dt, frames=scene.frames, obstacle=scene.obstacle,
        start=scene.start,
    )  # fmt: skip
    status = STATUS.get(trajectory.status, trajectory.status)
    if trajectory.frames < scene.frames:
        status = "diverged"
    if "converged" in trajectory.frame_fields and status == "stalled":
        bad = int((trajectory.frame_fields["converged"] < 0.5).sum())
        return RollOut(
            trajectory.positions, status, f"{bad} of {trajectory.frames} frames: {trajectory.reason}"
        )
    return RollOut(trajectory.positions, status, "" if status == "ok" else trajectory.reason)


def strains(scene: BuiltScene, positions: np.ndarray) -> np.ndarray:
    """(T,) [J] of positions (T,V,3) [m]; infinite where a position is not finite."""
    strain = next(term for term in scene.energies if term.name == "strain")
    finite = np.isfinite(positions).all(axis=(1, 2))
    return np.array(
        [strain.value_and_gradient(np.ascontiguousarray(x))[0] if fine else np.inf
         for x, fine in zip(positions, finite)]
    )  # fmt: skip
