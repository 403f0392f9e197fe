"""Roll-outs: a trained network run over a motion, one frame at a time, as an application would.

Times of frames are those of network and skinning, one compiled call each (CompiledFrame); their
inputs come from `prepare_frame_inputs`. Many bodies at once go through torch.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import torch
from torch import Tensor

from reference_sim.trajectory import Trajectory
from snug.body.skinning import skin
from snug.kernels.one_frame import VERTEX_BLOCK, run_frame, skin_frame
from snug.motion.motion import Motion
from snug.networks.dressed_body import FEATURE_SETS, DressedBody
from snug.networks.frame_layout import FramePlan, blocks_of_vertices
from snug.networks.garment_network import GarmentNetwork
from snug.networks.trained_model import TrainedModel, digest_triangles
from snug.recipe import DEFAULT

WARM_UP = 10  # frames computed and thrown away, before the caller starts a clock
RATE_TOLERANCE = 1e-4  # of a frame rate
SKINNING = {"method": "skinning"}  # provenance without a network
QUASI_STATIC_FRAMES = 30  # for which a pose is held before its output counts as static


def roll_out(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    quasi_static: bool = False,
) -> Trajectory:
    """Compute the garment's positions in each frame of a motion.

    The state starts at zero and is carried from frame to frame.

    Args:
        model: a trained network.
        dressed: the body and the garment that the model was trained for.
        motion: T frames.
        betas: shape numbers of the body; None is the mean body.
        quasi_static: give instead, for each frame, the output after that pose was held still for 30
            frames: the network's static answer. Nothing of it is timed.

    Returns:
        World positions (T, V, 3) [m], float64; status `diverged` if one is not finite.

    Raises:
        ValueError: if the model does not fit the garment or the motion.

    >>> roll_out(TrainedModel.load("snug.safetensors"), dressed, motion).status  # doctest: +SKIP
    'ok'
    """
    if not quasi_static:
        return prepare_roll_out(model, dressed, motion, betas)()
    features, state = _features(model, dressed, motion, betas, still=True)[:, None], None
    with torch.inference_mode():  # all frames as a batch
        for _ in range(QUASI_STATIC_FRAMES if model.network.sequential else 1):
            offsets, state = model.network(features, state)
        positions = dressed.skin(motion, betas, smoothing=model.recipe.smoothing, offsets=offsets[:, 0])
    return _trajectory(model, dressed, motion, positions, np.arange(motion.frames), np.empty(0))


def prepare_roll_out(
    model: TrainedModel | None,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    kept: np.ndarray | None = None,
    earlier: Motion | None = None,
    postprocess: Callable[[np.ndarray, int], np.ndarray] | None = None,
) -> Callable[[], Trajectory]:
    """Prepare all frames; return a function that gives the trajectory of `roll_out`.

    Every frame is computed; the trajectory holds those whose numbers are `kept`, None for all.
    `postprocess` is applied to each frame's positions (V, 3) [m] and number. All else: see
    `prepare_frames`.
    """
    frames = prepare_frames(model, dressed, motion, betas, earlier=earlier)
    numbers = np.arange(motion.frames) if kept is None else kept
    places = {int(frame): place for place, frame in enumerate(numbers)}
    if not set(places) <= set(range(motion.frames)):
        raise ValueError(f"kept frames {sorted(places)}: {motion.name} has 0 to {motion.frames - 1}")

    def run() -> Trajectory:
        positions, seconds = np.empty((len(numbers), dressed.vertices, 3)), np.empty(len(numbers))
        clock = time.perf_counter()
        for frame, x in enumerate(frames()):
            x = x if postprocess is None else postprocess(x, frame)
            elapsed = time.perf_counter() - clock
            if frame in places:
                positions[places[frame]], seconds[places[frame]] = x, elapsed
            clock = time.perf_counter()
        return _trajectory(model, dressed, motion, positions, numbers, seconds)

    return run


def prepare_batch(
    model: TrainedModel, dressed: DressedBody, motion: Motion, *, copies: int
) -> Callable[[], np.ndarray]:
    """Return a function that computes `copies` bodies at once, (T, copies, V, 3) [m], float32.

    Positions are relative to the pelvis. Frame follows frame, as the state is carried. Raises
    ValueError.
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
    model: TrainedModel | None,
    dressed: DressedBody,
    motion: Motion,
    positions: np.ndarray,
    numbers: np.ndarray,
    seconds: np.ndarray,
) -> Trajectory:
    """Return the trajectory of world positions (T, V, 3) [m] of the frames `numbers` of the motion."""
    finite = np.isfinite(positions).all()
    method = dict(method=model.kind, recipe=model.recipe.name, seed=model.seed) if model else SKINNING
    return Trajectory(
        positions=positions,
        faces=dressed.garment.faces,
        times=numbers / motion.fps,
        frame_seconds=seconds,
        status="ok" if finite else "diverged",
        reason="" if finite else "the network gave a position that is not finite",
        provenance=method | dict(motion=motion.name),
    )


class CompiledFrame:
    """A compiled call that skins an unposed garment (V, 3) [m] by weights (V, J)."""

    def __init__(self, rest: Tensor, weights: Tensor, network: GarmentNetwork | None = None) -> None:
        order, *joints = blocks_of_vertices(weights.numpy())
        unposed = np.zeros((3, VERTEX_BLOCK * (len(joints[0]) - 1)), np.float32)
        unposed[:, : len(order)] = rest.numpy()[order].T
        self._skinning = unposed, *joints, order
        self._operations, self.size = None, unposed.size
        if network is not None:
            plan = FramePlan(order, unposed.shape[1], pins=network.pins, scale=network.output_scale)
            network.lay_out(plan, plan.add_normalised(network.input_mean, network.input_std))
            self._operations, self.size = plan.operations(), plan.size

    def __call__(
        self,
        features: np.ndarray,
        transforms: np.ndarray,
        pelvis: np.ndarray,
        work: np.ndarray,
        out: np.ndarray,
    ) -> None:
        """Write the world vertices into `out` (V, 3) [m] float64, and the state after this frame into `work`.

        work: `size` zeros, or as the frame before left it; features (D,) float32, unused without a
        network; transforms of the joints (J, 3, 4) float32; pelvis (3,) [m] float64.
        """
        if self._operations is None:  # without a network no more than skinning is compiled
            skin_frame(work, *self._skinning, transforms, pelvis, out)
        else:
            run_frame(*self._operations, features, *self._skinning, transforms, pelvis, work, out)


def prepare_frames(
    model: TrainedModel | None,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    earlier: Motion | None = None,
) -> Callable[[], Iterator[np.ndarray]]:
    """Return a function that starts the frames of `roll_out`, each (V, 3) [m], computed when asked for.

    Inputs and joint transforms are made, and the network warmed up, before this returns. The inputs know
    the motion `earlier`, and the roll-out starts from the state that it leaves. Without a model it is
    skinning alone, by the weights of the default recipe. Raises ValueError if the model does not fit.
    """
    features, network, recipe = np.empty((motion.frames, 0), np.float32), None, DEFAULT
    if model is not None:
        network, recipe = model.network, model.recipe
        full_motion = earlier.followed_by(motion) if earlier else motion
        features = _features(model, dressed, full_motion, betas).numpy()
    frame = CompiledFrame(dressed.rest(betas), dressed.weights(recipe.smoothing), network)
    transforms, pelvis = dressed.transforms(motion.poses, betas).numpy(), dressed.pelvis(motion, betas)
    past, features = features[: -motion.frames], features[-motion.frames :]
    start, out = np.zeros(frame.size, np.float32), np.empty((dressed.vertices, 3))
    for before in past:
        frame(before, transforms[0], pelvis[0], start, out)

    def frames() -> Iterator[np.ndarray]:
        work = start.copy()
        for now in zip(features, transforms, pelvis):
            out = np.empty((dressed.vertices, 3))
            frame(*now, work, out)
            yield out

    for _ in zip(range(WARM_UP), frames()):
        pass
    return frames


def prepare_frame_inputs(
    model: TrainedModel | None,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None = None,
    *,
    earlier: Motion | None = None,
) -> Callable[[int], tuple[Tensor | None, Tensor, np.ndarray]]:
    """Return a function that makes one frame's inputs from its pose and those before.

    It gives features (D,), or None without a model, joint transforms (24, 3, 4) and pelvis (3,) [m]: the
    same numbers that `prepare_frames` makes for all frames at once. Raises ValueError.
    """
    full_motion = earlier.followed_by(motion) if earlier else motion
    first = full_motion.frames - motion.frames
    past = 0 if model is None else FEATURE_SETS[model.network.feature_set]

    def inputs(frame: int) -> tuple[Tensor | None, Tensor, np.ndarray]:
        now = motion.cut(frame, frame + 1)
        transforms, pelvis = dressed.transforms(now.poses, betas)[0], dressed.pelvis(now, betas)[0]
        if model is None:
            return None, transforms, pelvis
        recent = full_motion.cut(max(first + frame - past, 0), first + frame + 1)
        return _features(model, dressed, recent, betas)[-1], transforms, pelvis

    return inputs


def _features(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
    betas: np.ndarray | None,
    *,
    still: bool = False,
) -> Tensor:
    """Return the network's inputs (T, D).

    Raises ValueError for another garment's model, or one that has learned motions of another rate.
    """
    if model.vertices != dressed.vertices:
        raise ValueError(f"the model has {model.vertices} vertices, the garment {dressed.vertices}")
    if model.triangles and model.triangles != digest_triangles(dressed.garment.faces):
        raise ValueError(
            "the model is of a garment with as many vertices and other triangles: tailor the garment that it "
            "was trained for, or train one for this"
        )
    timeless = not (model.network.sequential or FEATURE_SETS[model.network.feature_set])
    if model.fps and not timeless and abs(model.fps - motion.fps) > RATE_TOLERANCE * model.fps:
        raise ValueError(
            f"the model has learned from {model.fps:g} frames a second, motion {motion.name} has "
            f"{motion.fps:g}: resample it (snug.motion.motion.resample)"
        )
    features = dressed.features(
        motion, model.recipe, betas, feature_set=model.network.feature_set, still=still
    )
    inputs = model.network.input_mean.shape[0]
    if features.shape[1] != inputs:
        raise ValueError(
            f"the model reads {inputs} numbers a frame, this body and motion give {features.shape[1]}"
        )
    return features
