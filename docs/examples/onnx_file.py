"""Write one frame of a trained network as an ONNX file.

    python docs/examples/onnx_file.py snug-tshirt snug.onnx

Inputs of the graph: `features` (D,) and `transforms` (J, 3, 4), as the methods of `DressedBody` of
these names give them. Output: `positions` (V, 3) [m], relative to the pelvis. A network that carries a
state has input `state`, zeros before the first frame, and output `next_state` too. Rest shape and
skinning weights are inside.
"""

import sys

import torch
from torch import Tensor, nn

import snug
from snug import find_template, make_motion, skin


class Frame(nn.Module):
    """Features, joint transforms and state of one frame in; positions and next state out."""

    def __init__(self, model: snug.TrainedModel, dressed: snug.DressedBody) -> None:
        super().__init__()
        self.network = model.network
        self.register_buffer("rest", dressed.rest())
        self.register_buffer("weights", dressed.weights(model.recipe.smoothing))

    def forward(
        self, features: Tensor, transforms: Tensor, state: Tensor | None = None
    ) -> tuple[Tensor, ...]:
        """Return positions (V, 3) [m], and the next state of a network that has one."""
        offsets, state = self.network(features[None, None], state)
        positions = skin(self.rest + offsets[0, 0], self.weights, transforms)
        return (positions,) if state is None else (positions, state)


def write(model: snug.TrainedModel, dressed: snug.DressedBody, path: str) -> None:
    """Write the graph of one frame."""
    motion = make_motion("kick").cut(0, 1)
    features = dressed.features(motion, model.recipe, feature_set=model.network.feature_set)[0]
    given = features, dressed.transforms(motion.poses)[0]
    frame = Frame(model, dressed).eval()
    _, *state = frame(*given)
    torch.onnx.export(  # with gradients: without, torch puts in operations of its own
        frame, (*given, *map(torch.zeros_like, state)), path, external_data=False,
        input_names=["features", "transforms", "state"][: 2 + len(state)],
        output_names=["positions", "next_state"][: 1 + len(state)],
    )  # fmt: skip


if __name__ == "__main__":
    body = snug.Body.load()
    worn = snug.DressedBody(body, find_template("tshirt").tailor(body, vertices=1000))
    write(snug.TrainedModel.load(sys.argv[1]), worn, sys.argv[2])
