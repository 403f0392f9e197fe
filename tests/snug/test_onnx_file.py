"""ONNX files of trained networks give the network's positions, or are not written."""

from __future__ import annotations

import importlib
from types import SimpleNamespace

import numpy as np
import pytest

from snug import onnx_file
from snug.garments import find_template
from snug.motion import make_motion
from snug.networks.architectures import make_network
from snug.networks.dressed_body import DressedBody
from snug.networks.roll_out import roll_out
from snug.networks.trained_model import TrainedModel
from snug.onnx_file import OnnxError, write_onnx
from snug.recipes.recipe import DEFAULT


@pytest.fixture(scope="module")
def dressed(body) -> DressedBody:
    return DressedBody(body, find_template("tshirt").tailor(body, vertices=1000))


def test_a_missing_package_and_a_model_of_another_garment_are_named(tmp_path, monkeypatch):
    dressed = SimpleNamespace(vertices=1002)
    motion, path = make_motion("kick"), tmp_path / "small.onnx"
    model = TrainedModel("pbns", make_network("pbns", 141, 4, DEFAULT, seed=0), DEFAULT)

    def missing(name: str) -> None:
        raise ModuleNotFoundError(name)

    with monkeypatch.context() as patch:
        patch.setattr(importlib, "import_module", missing)
        with pytest.raises(OnnxError, match=r"small\.onnx: needs pip install '.*\[onnx\]'"):
            write_onnx(model, dressed, motion, path)
    pytest.importorskip("onnxruntime")
    pytest.importorskip("onnxscript")
    with pytest.raises(OnnxError, match="the model has 4 vertices, the garment 1002"):
        write_onnx(model, dressed, motion, path)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the exporter, about its own parts
@pytest.mark.parametrize("name", ["snug-tshirt", "pbns-tshirt", "supervised-tshirt"])
def test_the_file_alone_gives_the_roll_out(tmp_path, monkeypatch, dressed, name):
    runtime = pytest.importorskip("onnxruntime")
    motion, model = make_motion("kick"), TrainedModel.load(name)
    assert write_onnx(model, dressed, motion, tmp_path / "a.onnx") < 1e-5
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]
    session = runtime.InferenceSession(str(tmp_path / "a.onnx"))
    features = dressed.features(motion, model.recipe, feature_set=model.network.feature_set).numpy()
    turns, pelvis = dressed.transforms(motion.poses).numpy(), dressed.pelvis(motion)
    state = [np.zeros(given.shape, np.float32) for given in session.get_inputs() if given.name == "state"]
    assert len(state) == model.network.sequential
    expected = roll_out(model, dressed, motion).positions
    for frame, now in enumerate(features):
        given = {"features": now, "transforms": turns[frame]} | dict(zip(["state"], state))
        positions, *state = session.run(None, given)
        assert np.abs(positions + pelvis[frame] - expected[frame]).max() < 2e-5
    monkeypatch.setattr(onnx_file, "TOLERANCE", -1.0)
    with pytest.raises(OnnxError, match=r"b\.onnx: a coordinate differs by .* m"):
        write_onnx(model, dressed, motion, tmp_path / "b.onnx")
    assert not (tmp_path / "b.onnx").exists()
