"""Run a trained network over a motion, one frame at a time, as an application would.

Times of frames are those of network and skinning, one compiled call each (snug.networks.one_frame); `frame_inputs`
makes what they take as ready. Many bodies at once go through torch.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from reference_sim.trajectory.trajectory import Trajectory
from snug.body.skinning import skin
from snug.networks.dressed_body import FEATURE_SETS, DressedBody
from snug.networks.one_frame import CompiledFrame
from snug.networks.trained_model import TrainedModel, find_kind

if TYPE_CHECKING:
    from snug.motion.motion import Motion

WARM_UP = 10  # frames run and thrown away, before whoever times the rest starts a clock
QUASI_STATIC_FRAMES = 30  # frames for which a pose is held before its output counts as static


class RollOutError(ValueError):
    """A model that does not fit the garment or the motion; the message names both numbers."""


def roll_out(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    quasi_static: bool = False,
) -> Trajectory:
    """Positions (T, V, 3) [m], world, float64; the state starts at zero and is carried from frame to frame.

    Inputs and joint transforms are ready before the first frame. quasi_static gives instead, for each frame,
    the output after that pose was held still for a second: what the network thinks is static; nothing of it
    is timed. Raises RollOutError.
    """
    if not quasi_static:
        return ready_to_roll_out(model, dressed, motion, betas)()
    features = _features(model, dressed, motion, betas, still=True)
    rest, weights = dressed.rest(betas), dressed.weights(model.recipe.smoothing)
    posed = _quasi_static(model, features, rest, weights, dressed.transforms(motion.poses, betas))
    positions = posed.astype(np.float64) + dressed.pelvis(motion, betas)[:, None]
    return _trajectory(model, dressed, motion, positions, np.arange(motion.frames))


def ready_to_roll_out(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    kept: np.ndarray | None = None,
    before: Any = None,
    then: Callable[[np.ndarray, int], np.ndarray] | None = None,
) -> Callable[[], Trajectory]:
    """What gives the trajectory of `roll_out` whenever it is called: all that comes before is done here.

    kept: the frames that the trajectory holds, or None for all; every one is computed. before: as in
    `predictions`. then: what is done with each frame, (V, 3) [m], and its number. Raises RollOutError.
    """
    frames = predictions(model, dressed, motion, betas, before=before)
    held = np.arange(motion.frames) if kept is None else kept

    def run() -> Trajectory:
        given = frames() if then is None else (then(x, frame) for frame, x in enumerate(frames()))
        positions, seconds = collected(given, held)
        return _trajectory(model, dressed, motion, positions, held, seconds)

    return run


def ready_for_many(
    model: TrainedModel, dressed: DressedBody, motion: Motion, *, copies: int
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


def collected(frames: Iterator[np.ndarray], held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of frames (V, 3) computed when asked for, those that `held` (T,) names, (T, V, 3), and the time of each
    (T,) [s]; every one is computed.
    """
    places, seconds = {int(frame): place for place, frame in enumerate(held)}, np.empty(len(held))
    positions, clock = np.empty(0), time.perf_counter()
    for frame, x in enumerate(frames):
        if not len(positions):
            positions = np.empty((len(held), *x.shape))
        before, clock = clock, time.perf_counter()
        if frame in places:
            positions[places[frame]], seconds[places[frame]] = x, clock - before
    return positions, seconds


def _trajectory(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
    positions: np.ndarray,
    held: np.ndarray,
    seconds: np.ndarray | None = None,
) -> Trajectory:
    """World positions (T, V, 3) [m] of those frames of the motion."""
    finite = bool(np.isfinite(positions).all())
    return Trajectory(
        positions=positions,
        faces=np.asarray(dressed.garment.faces),
        times=held / motion.fps,
        frame_seconds=np.empty(0) if seconds is None else seconds,
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
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    before: Any = None,
) -> Callable[[], Iterator[np.ndarray]]:
    """What begins `roll_out` anew whenever it is called: its frames one at a time, (V, 3) [m], world,
    float64, each computed when asked for.

    before: the motion until then, or None; it is known to the inputs, and the state that it leaves is the
    first one. That, inputs and joint transforms are made, and the network warmed up, before this returns.
    Raises RollOutError.
    """
    whole = _joined(before, motion)
    features = _features(model, dressed, whole, betas).numpy()
    frame = CompiledFrame(
        dressed.rest(betas), dressed.weights(model.recipe.smoothing), model.network, precision=model.precision
    )
    return _one_by_one(frame, features, dressed, motion, betas)


def skinned_frames(
    dressed: DressedBody, motion: Motion, smoothing: int, betas: np.ndarray | None = None
) -> Callable[[], Iterator[np.ndarray]]:
    """As `predictions`, of skinning alone, with weights smoothed by that many sweeps."""
    nothing = np.empty((motion.frames, 0), np.float32)
    frame = CompiledFrame(dressed.rest(betas), dressed.weights(smoothing))
    return _one_by_one(frame, nothing, dressed, motion, betas)


def frame_inputs(
    model: TrainedModel | None,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    before: Any = None,
) -> Callable[[int], tuple[Tensor | None, Tensor, np.ndarray]]:
    """What makes the inputs of one frame, as an application does, which has its pose and those before it.

    Features (D,), none without a model, joint transforms (24, 3, 4) and pelvis (3,) [m]: those of the frame
    that `predictions` and `skinned_frames` make for all frames at once. Raises RollOutError.
    """
    whole = _joined(before, motion)
    first = whole.frames - motion.frames
    past = 0 if model is None else FEATURE_SETS[find_kind(model.kind).features]

    def inputs(frame: int) -> tuple[Tensor | None, Tensor, np.ndarray]:
        now = motion.cut(frame, frame + 1)
        transforms, pelvis = dressed.transforms(now.poses, betas)[0], dressed.pelvis(now, betas)[0]
        if model is None:
            return None, transforms, pelvis
        recent = whole.cut(max(first + frame - past, 0), first + frame + 1)
        return _features(model, dressed, recent, betas)[-1], transforms, pelvis

    return inputs


def _joined(before: Motion | None, motion: Motion) -> Motion:
    return motion if before is None else before.followed_by(motion)


def _features(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
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
    frame: CompiledFrame, features: np.ndarray, dressed: DressedBody, motion: Motion, betas: np.ndarray | None
) -> Callable[[], Iterator[np.ndarray]]:
    """What begins the frames of the motion anew, from the state that earlier features leave; it is compiled
    and warmed up at once.
    """
    transforms, pelvis = dressed.transforms(motion.poses, betas).numpy(), dressed.pelvis(motion, betas)
    past, features = features[: -motion.frames], features[-motion.frames :]
    start, out = frame.start(), np.empty((dressed.vertices, 3))
    for earlier in past:
        frame(earlier, transforms[0], pelvis[0], start, out)

    def frames() -> Iterator[np.ndarray]:
        work = start.copy()
        for now in zip(features, transforms, pelvis):
            out = np.empty((dressed.vertices, 3))
            frame(*now, work, out)
            yield out

    for _ in zip(range(WARM_UP), frames()):
        pass
    return frames


@torch.inference_mode()
def _quasi_static(
    model: TrainedModel, features: Tensor, rest: Tensor, weights: Tensor, transforms: Tensor
) -> np.ndarray:
    """All frames as a batch, each pose repeated."""
    state = None
    for _ in range(QUASI_STATIC_FRAMES if find_kind(model.kind).sequences else 1):
        offsets, state = model.network(features[:, None], state)
    return skin(rest + offsets[:, 0], weights, transforms).numpy()
