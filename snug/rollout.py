"""Run a trained network over a motion, one frame at a time, as an application would."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.trajectory import Trajectory
from snug.dressed_body import DressedBody
from snug.skinning import skin
from snug.trained_model import TrainedModel, find_kind

WARM_UP = 10  # frames run and thrown away, before whoever times the rest starts a clock
QUASI_STATIC_FRAMES = 30  # frames for which a pose is held before its output counts as static


class RollOutError(ValueError):
    """A model that does not fit the garment or the motion; the message names both numbers."""


def roll_out(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Any,
    betas: np.ndarray | None = None,
    *,
    quasi_static: bool = False,
) -> Trajectory:
    """Positions (T, V, 3) [m], world, float64; the state starts at zero and is carried from frame to frame.

    Inputs and joint transforms are ready before the first frame; every method needs those. quasi_static gives
    instead, for each frame, the output after that pose was held still for a second: what the network thinks
    is static. Nothing is timed here (frame_seconds is NaN): see `predictions`. Raises RollOutError.
    """
    if not quasi_static:
        return ready_to_roll_out(model, dressed, motion, betas)()
    features = _features(model, dressed, motion, betas, still=True)
    rest, weights = dressed.rest(betas), dressed.weights(model.recipe.smoothing)
    posed = _quasi_static(model, features, rest, weights, dressed.transforms(motion.poses, betas))
    origins = dressed.pelvis(motion, betas)
    return _trajectory(model, dressed, motion, posed, origins)


def ready_to_roll_out(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Any,
    betas: np.ndarray | None = None,
    *,
    kept: np.ndarray | None = None,
) -> Callable[[], Trajectory]:
    """What gives the trajectory of `roll_out` when it is called, once: all that comes before is done here.

    kept: the frames that the trajectory holds, or None for all; every one is computed. Raises RollOutError.
    """
    features = _features(model, dressed, motion, betas)
    rest, weights = dressed.rest(betas), dressed.weights(model.recipe.smoothing)
    transforms, origins = dressed.transforms(motion.poses, betas), dressed.pelvis(motion, betas)
    frames = _one_by_one(model, features, rest, weights, transforms)
    held = np.arange(len(features)) if kept is None else kept
    places = {int(frame): place for place, frame in enumerate(held)}

    def run() -> Trajectory:
        posed = np.empty((len(held), *rest.shape), np.float32)
        for frame, vertices in enumerate(frames):
            if frame in places:
                posed[places[frame]] = vertices.numpy()
        whole = _trajectory(model, dressed, motion, posed, origins[held])
        return replace(whole, times=held / motion.fps)

    return run


def ready_for_many(
    model: TrainedModel, dressed: DressedBody, motion: Any, *, copies: int
) -> Callable[[], np.ndarray]:
    """What computes, when called, `copies` bodies in that motion at once: (T, copies, V, 3) [m], float32.

    About the pelvis. Frame follows frame, as the state is carried. Raises RollOutError.
    """
    features = _features(model, dressed, motion, None)[:, None, None].expand(-1, copies, -1, -1)
    rest, weights = dressed.rest(), dressed.weights(model.recipe.smoothing)
    transforms = dressed.transforms(motion.poses)[:, None].expand(-1, copies, -1, -1, -1)

    @torch.inference_mode()
    def run(frames: int = len(features)) -> np.ndarray:
        posed, state = np.empty((frames, copies, *rest.shape), np.float32), None
        for frame in range(frames):
            offsets, state = model.network(features[frame], state)
            posed[frame] = skin(rest + offsets[:, 0], weights, transforms[frame]).numpy()
        return posed

    run(min(WARM_UP, len(features)))
    return run


def _trajectory(
    model: TrainedModel, dressed: DressedBody, motion: Any, posed: np.ndarray, origins: np.ndarray
) -> Trajectory:
    """Vertices posed about the pelvis (T, V, 3), brought to where it is in each frame (T, 3)."""
    positions = posed.astype(np.float64) + origins[:, None]
    finite = bool(np.isfinite(positions).all())
    return Trajectory(
        positions=positions,
        faces=np.asarray(dressed.garment.faces),
        times=np.arange(len(positions)) / motion.fps,
        status="ok" if finite else "diverged",
        reason="" if finite else "the network gave a position that is not finite",
        provenance={
            "method": model.kind,
            "recipe": model.recipe.name,
            "seed": model.seed,
            "motion": motion.name,
        },
        frame_fields={},
    )


def predictions(
    model: TrainedModel, dressed: DressedBody, motion: Any, betas: np.ndarray | None = None
) -> Iterator[np.ndarray]:
    """The frames of `roll_out` one at a time: (V, 3) [m], world, float64, each computed when asked for.

    Inputs and joint transforms are made, and the network warmed up, before this returns. Raises RollOutError.
    """
    features = _features(model, dressed, motion, betas)
    rest, weights = dressed.rest(betas), dressed.weights(model.recipe.smoothing)
    transforms = dressed.transforms(motion.poses, betas)
    pelvis = dressed.pelvis(motion, betas)
    frames = _one_by_one(model, features, rest, weights, transforms)
    return (vertices.numpy().astype(np.float64) + origin for vertices, origin in zip(frames, pelvis))


def skinned_frames(
    dressed: DressedBody, motion: Any, smoothing: int, betas: np.ndarray | None = None
) -> Iterator[np.ndarray]:
    """As `predictions`, of skinning alone, with weights smoothed by that many sweeps."""
    rest, weights = dressed.rest(betas), dressed.weights(smoothing)
    transforms = dressed.transforms(motion.poses, betas)
    pelvis = dressed.pelvis(motion, betas)
    for transform in transforms[:WARM_UP]:
        skin(rest, weights, transform)
    return (skin(rest, weights, t).numpy().astype(np.float64) + at for t, at in zip(transforms, pelvis))


def _features(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Any,
    betas: np.ndarray | None,
    *,
    still: bool = False,
) -> Tensor:
    """The network's inputs (T, D). Raises RollOutError where the model does not fit."""
    if model.vertices != dressed.vertices:
        raise RollOutError(f"the model has {model.vertices} vertices, the garment {dressed.vertices}")
    kind = find_kind(model.kind)
    features = dressed.features(motion, model.recipe, betas, kind=kind.features, still=still)
    inputs = model.network.input_mean.shape[0]
    if features.shape[1] != inputs:
        raise RollOutError(
            f"the model reads {inputs} numbers a frame, this body and motion give {features.shape[1]}"
        )
    return features


def _one_by_one(
    model: TrainedModel, features: Tensor, rest: Tensor, weights: Tensor, transforms: Tensor
) -> Iterator[Tensor]:
    """Skinned vertices (V, 3) of each frame, computed when asked for; the network is warmed up at once."""

    @torch.inference_mode()
    def step(frame: int, state: Any) -> tuple[Tensor, Any]:
        offsets, state = model.network(features[frame][None, None], state)
        return skin(rest + offsets[0, 0], weights, transforms[frame]), state

    def frames() -> Iterator[Tensor]:
        state = None
        for frame in range(len(features)):
            vertices, state = step(frame, state)
            yield vertices

    for frame in range(min(WARM_UP, len(features))):
        step(frame, None)
    return frames()


@torch.inference_mode()
def _quasi_static(
    model: TrainedModel, features: Tensor, rest: Tensor, weights: Tensor, transforms: Tensor
) -> np.ndarray:
    """All frames as a batch, each pose repeated."""
    state = None
    for _ in range(QUASI_STATIC_FRAMES if find_kind(model.kind).sequences else 1):
        offsets, state = model.network(features[:, None], state)
    return skin(rest + offsets[:, 0], weights, transforms).numpy()
