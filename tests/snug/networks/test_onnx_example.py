"""The example that writes a network as an ONNX file: the file alone gives the network's roll-out."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from snug.garments.templates import find_template
from snug.motion.library import make_motion
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel

EXAMPLE = Path(__file__).resolve().parents[3] / "docs/examples/onnx_file.py"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the exporter, about its own parts
@pytest.mark.parametrize("name", ["snug-tshirt", "pbns-tshirt"])  # with a state and without
def test_the_file_alone_gives_the_roll_out(tmp_path, body, name):
    runtime = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnxscript")
    dressed = DressedBody(body, find_template("tshirt").tailor(body, vertices=1000))
    motion, model = make_motion("kick"), TrainedModel.load(name)
    runpy.run_path(str(EXAMPLE))["write"](model, dressed, str(tmp_path / "a.onnx"))
    session = runtime.InferenceSession(str(tmp_path / "a.onnx"))
    features = dressed.features(motion, model.recipe, feature_set=model.network.feature_set).numpy()
    turns, pelvis = dressed.transforms(motion.poses).numpy(), dressed.pelvis(motion)
    state = [np.zeros(entry.shape, np.float32) for entry in session.get_inputs() if entry.name == "state"]
    assert len(state) == model.network.sequential
    expected = roll_out(model, dressed, motion).positions
    for frame, now in enumerate(features):
        inputs = {"features": now, "transforms": turns[frame]} | dict(zip(["state"], state))
        positions, *state = session.run(None, inputs)
        assert np.abs(positions + pelvis[frame] - expected[frame]).max() < 2e-5
