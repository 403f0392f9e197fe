"""Trained networks as ONNX files, for engines and other runtimes that have no torch."""

from __future__ import annotations

import importlib
import io
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from reference_sim.files.atomic_files import replacing
from snug.body.skinning import skin
from snug.motion.motion import Motion
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import RollOutError, demand_fit
from snug.networks.trained_model import TrainedModel

TOLERANCE = 1e-5  # [m] between a vertex by torch and by the file: float32, summed in another order


class OnnxError(ValueError):
    """A network that cannot be written as ONNX, or whose file gives other positions."""


class _Frame(nn.Module):
    """One frame of a network: features, joint transforms and state in; positions and next state out."""

    rest: Tensor
    weights: Tensor

    def __init__(self, model: TrainedModel, dressed: DressedBody, betas: np.ndarray | None) -> None:
        super().__init__()
        self.network = model.network
        self.register_buffer("rest", dressed.rest(betas))
        self.register_buffer("weights", dressed.weights(model.recipe.smoothing))

    def forward(
        self, features: Tensor, transforms: Tensor, state: Tensor | None = None
    ) -> tuple[Tensor, ...]:
        offsets, state = self.network(features[None, None], state)
        positions = skin(self.rest + offsets[0, 0], self.weights, transforms)
        return (positions,) if state is None else (positions, state)


def write_onnx(
    model: TrainedModel,
    dressed: DressedBody,
    motion: Motion,
    path: str | Path,
    betas: np.ndarray | None = None,
) -> float:
    """Write one frame of a trained network as an ONNX file, and check the file on a motion.

    The graph has inputs `features` (D,), see `DressedBody.features`, and `transforms` (J, 3, 4) of the
    joints, see `DressedBody.transforms`; it has output `positions` (V, 3) [m], relative to the pelvis.
    A network that carries a state has input `state` and output `next_state` too: zeros before the first
    frame. Rest shape and skinning weights are inside.

    Args:
        model: a trained network.
        dressed: body and garment that it was trained for.
        motion: T frames on which file and network are compared.
        path: of the file, which is there afterwards whole or not at all.
        betas: shape numbers of the body; None is the mean body.

    Returns:
        The largest difference of a coordinate, over all frames [m].

    Raises:
        OnnxError: the packages are missing, the model does not fit the garment, or a coordinate differs by
            more than TOLERANCE.

    >>> import snug
    >>> from snug.motion import make_motion
    >>> model = snug.TrainedModel.load("snug-tshirt")  # doctest: +SKIP
    >>> write_onnx(model, dressed, make_motion("kick"), "snug.onnx") < 1e-5  # doctest: +SKIP
    True
    """
    try:
        runtime = importlib.import_module("onnxruntime")
        importlib.import_module("onnxscript")
    except ImportError:
        raise OnnxError(f"{path}: needs pip install 'neural-garment-benchmark[onnx]'") from None
    try:
        demand_fit(model, dressed, motion)
    except RollOutError as error:
        raise OnnxError(str(error)) from None
    features = dressed.features(motion, model.recipe, betas, feature_set=model.network.feature_set)
    transforms = dressed.transforms(motion.poses, betas)
    frame = _Frame(model, dressed, betas).eval()
    with replacing(Path(path)) as temporary:
        _, *state = frame(features[0], transforms[0])
        state = [torch.zeros_like(tensor) for tensor in state]
        # With gradients: without, torch puts in operations of its own that no runtime knows.
        with redirect_stdout(io.StringIO()):  # the exporter prints its steps
            torch.onnx.export(
                frame, (features[0], transforms[0], *state), str(temporary), external_data=False,
                input_names=["features", "transforms", "state"][: 2 + len(state)],
                output_names=["positions", "next_state"][: 1 + len(state)],
            )  # fmt: skip
        session = runtime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        theirs, worst = [tensor.numpy() for tensor in state], 0.0
        for now, turn in zip(features, transforms):
            given = {"features": now.numpy(), "transforms": turn.numpy()} | dict(zip(["state"], theirs))
            exported, *theirs = session.run(None, given)
            with torch.no_grad():
                positions, *state = frame(now, turn, *state)
            worst = max(worst, float(np.abs(exported - positions.numpy()).max()))
        if not worst <= TOLERANCE:
            raise OnnxError(f"{path}: a coordinate differs by {worst:.2g} m from the network's; not written")
    return worst
