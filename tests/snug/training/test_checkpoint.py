"""A run that was stopped, or killed at any moment, and resumed ends with the bits of an unbroken one."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from reference_sim import Material
from snug.named_recipes import DYNAMIC, PAPER, SANTESTEBAN2019, SUPERVISED, TAILORNET
from snug.networks import tensor_file
from snug.networks.dressed_body import DressedBody
from snug.networks.tensor_file import TensorFileError, read_tensors
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT
from snug.training import checkpoint as checkpoints
from snug.training import train_to_file
from snug.training.checkpoint import Checkpoint
from snug.training.train_network import train_network
from snug.training.train_to_file import digest_inputs
from snug.training.training_loop import Interrupted
from snug.training.validation import Validation
from tests.snug.training.dressing import swaying, tube_dress

PLAIN = replace(DEFAULT, mixed=0.0)
STEPS = 12
# 28 windows and 16 in a batch: every stop is within an epoch.
CLIPS = [swaying(30)]


def shaken(motion):
    """World vertices (T, V, 3) [m] that a simulation might have come to."""
    noise = np.random.default_rng(7).normal(scale=0.01, size=(motion.frames, tube_dress().vertices, 3))
    return tube_dress().skinned(motion) + noise


def short(kind="snug", *, dressed=None, steps=STEPS, seed=0, recipe=PLAIN, clips=CLIPS, **options):
    options = {"progress": False, "every": 5, **options}
    if kind not in ("snug", "pbns") and "trajectories" not in options:
        options["trajectories"] = {clip.name: shaken(clip) for clip in clips}
    dressed = tube_dress() if dressed is None else dressed
    return train_network(kind, dressed, clips, steps=steps, seed=seed, recipe=recipe, **options)


def same_model(a, b):
    for one, other in zip(a.network.state_dict().values(), b.network.state_dict().values(), strict=True):
        assert torch.equal(one, other)
    for one, other in zip(a.history, b.history, strict=True):
        names = [name for name in one if not name.startswith("seconds")]
        assert [one[name] for name in names] == [other[name] for name in names]
    assert a.summary == b.summary


def asked_after(steps):
    """A stop request that comes after so many steps."""
    count = iter(range(10_000))
    return lambda: next(count) + 1 >= steps


@pytest.mark.parametrize(
    ("kind", "recipe"),
    [
        ("snug", replace(DEFAULT, mixed=2.0)),
        ("snug", PAPER),
        ("pbns", PLAIN),
        ("dynamic", replace(DYNAMIC, pretraining=3)),
        ("supervised", SUPERVISED),
        ("santesteban2019", SANTESTEBAN2019),
        ("tailornet", TAILORNET),
    ],
    ids=["mixed", "paper", "pbns", "dynamic", "supervised", "santesteban2019", "tailornet"],
)
def test_a_stopped_run_resumes_bit_for_bit(kind, recipe, tmp_path, narrow):
    whole = short(kind, recipe=recipe)
    path = tmp_path / "run.safetensors"
    for number, steps in enumerate((3, 5)):  # twice, the second time on a resumed run
        checkpoint = Checkpoint(path=path, resume=number > 0)
        with pytest.raises(Interrupted, match=f"after step {(3, 8)[number]} of {STEPS}"):
            short(kind, recipe=recipe, checkpoint=checkpoint, stop=asked_after(steps))
    checkpoint = Checkpoint(path=path, resume=True)
    resumed = short(kind, recipe=recipe, checkpoint=checkpoint)
    same_model(whole, resumed)
    assert resumed.history[-1]["step"] == STEPS and list(tmp_path.iterdir()) == [path]
    checkpoint.delete()
    assert not list(tmp_path.iterdir())


def test_validation_resumes_bit_for_bit(tmp_path):
    validation = Validation(motions=[swaying(20, name="other", degrees=30.0)], every=4, patience=5)
    whole = short(steps=24, validation=validation)
    checkpoint = Checkpoint(path=tmp_path / "run.safetensors", resume=True)
    with pytest.raises(Interrupted):
        short(steps=24, validation=validation, checkpoint=checkpoint, stop=asked_after(14))
    same_model(whole, short(steps=24, validation=validation, checkpoint=checkpoint))
    assert whole.summary["validation"]["motions"] == ["other"]


CHILD = """
import sys
import torch
torch.set_num_threads(int(sys.argv[3]))
sys.path.insert(0, sys.argv[1])
from tests.snug.training.test_checkpoint import short
from snug.training.checkpoint import Checkpoint
from pathlib import Path
short(steps=4000, checkpoint=Checkpoint(path=Path(sys.argv[2]), steps=3, minutes=0))
"""


def test_a_killed_run_resumes_bit_for_bit(tmp_path):
    """kill -9 while the child writes checkpoints as fast as it can; a run resumed from what lies there."""
    path = tmp_path / "run.safetensors"
    threads = str(torch.get_num_threads())  # whatever the tests before this one have left in the environment
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, str(Path(__file__).resolve().parents[3]), str(path), threads]
    )
    deadline = time.monotonic() + 120
    while not path.is_file() and time.monotonic() < deadline:
        assert child.poll() is None
        time.sleep(0.01)
    time.sleep(0.2)
    child.send_signal(signal.SIGKILL)
    child.wait()
    done = read_tensors(path)[1]["done"]
    assert 3 <= done < 4000 and done % 3 == 0
    runs = []
    # Steps of the schedule must agree, so both go a little further and stop at the same step.
    for resume in (True, False):
        checkpoint = Checkpoint(path=path if resume else tmp_path / "whole.safetensors", resume=resume)
        stop = asked_after(7 if resume else done + 7)
        with pytest.raises(Interrupted, match=f"after step {done + 7} of"):
            short(steps=4000, checkpoint=checkpoint, stop=stop)
        runs.append(read_tensors(checkpoint.path)[0])
    assert runs[0].keys() == runs[1].keys()
    assert all(torch.equal(runs[0][name], runs[1][name]) for name in runs[0])


def test_files_are_the_users_own(tmp_path):
    (tmp_path / "plain").touch()
    path = tensor_file.write_tensors(tmp_path / "a.safetensors", {"a": torch.zeros(2)}, {})
    assert path.stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_checkpoint_of_another_run_is_refused(tmp_path):
    path = tmp_path / "run.safetensors"
    with pytest.raises(Interrupted):
        short(checkpoint=Checkpoint(path=path), stop=asked_after(2))
    again = Checkpoint(path=path, resume=True)
    with pytest.raises(TensorFileError, match="seed 0 there, 1 here"):
        short(checkpoint=again, seed=1)
    with pytest.raises(TensorFileError, match="another recipe"):
        short(checkpoint=again, recipe=replace(PLAIN, h0_sigma=0.1))
    with pytest.raises(TensorFileError, match="another data"):
        short(checkpoint=again, clips=[swaying(31)])
    threads = torch.get_num_threads()
    torch.set_num_threads(threads + 1)
    try:
        with pytest.raises(TensorFileError, match=f"threads {threads} there, {threads + 1} here"):
            short(checkpoint=again)
    finally:
        torch.set_num_threads(threads)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(TensorFileError, match=r"run\.safetensors"):
        short(checkpoint=again)
    path.unlink()
    same_model(short(), short(checkpoint=again))  # killed before its first checkpoint: from the beginning


def test_a_checkpoint_of_an_older_version_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "run.safetensors"
    monkeypatch.setattr(checkpoints, "CHECKPOINT_FORMAT", "snug-checkpoint-6")
    with pytest.raises(Interrupted):
        short(checkpoint=Checkpoint(path=path), stop=asked_after(2))
    monkeypatch.undo()
    with pytest.raises(TensorFileError, match=r"run\.safetensors: no checkpoint of this version"):
        short(checkpoint=Checkpoint(path=path, resume=True))


def test_a_checkpoint_of_other_targets_or_cloth_is_refused(tmp_path):
    dressed = tube_dress()
    simulated = {"sway": dressed.skinned(CLIPS[0], smoothing=20)}
    checkpoint = Checkpoint(path=tmp_path / "run.safetensors", resume=True)
    with pytest.raises(Interrupted):
        short("supervised", trajectories=simulated, checkpoint=checkpoint, stop=asked_after(2))
    with pytest.raises(TensorFileError, match="another data"):
        short("supervised", trajectories={"sway": simulated["sway"] + 0.01}, checkpoint=checkpoint)
    checkpoint.delete()
    with pytest.raises(Interrupted):
        short(checkpoint=checkpoint, stop=asked_after(2))
    stiff = DressedBody(dressed.body, replace(dressed.garment, material=Material(young_modulus=1e6)))
    checkpoint.delete()
    clip = swaying(16, name="held")
    with pytest.raises(Interrupted):
        short(checkpoint=checkpoint, stop=asked_after(2), validation=Validation(motions=[clip]))
    shaken_clip = replace(clip, poses=1.1 * clip.poses)
    with pytest.raises(TensorFileError, match="another data"):
        short(checkpoint=checkpoint, validation=Validation(motions=[shaken_clip]))
    checkpoint.delete()
    with pytest.raises(Interrupted):
        short(checkpoint=checkpoint, stop=asked_after(2))
    body = replace(dressed.body, template=1.01 * dressed.body.template)
    for other, named in ((DressedBody(body, dressed.garment), "another data"), (stiff, "another material")):
        with pytest.raises(TensorFileError, match=named):
            short(dressed=other, checkpoint=checkpoint)


def no_space(*_):
    raise OSError("no space left")


def test_command_resumes_what_it_interrupted(tailored_once, tmp_path, monkeypatch, capsys, refused):
    from snug import train as module

    out = tmp_path / "small.safetensors"
    arguments = ["--vertices", "200", "--steps", "8", "-o", str(out), "--resume"]
    library = [swaying(20), swaying(16, name="held")]
    monkeypatch.setattr(train_to_file, "choose_motions", lambda options, data: (library[:1], library[1:]))
    monkeypatch.setattr(module._StopRequest, "__call__", lambda self: True)
    assert module.main(arguments) == 130
    assert "step 1 of 8" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["small.checkpoint.safetensors"]
    assert module.main(arguments[:-1]) == 130  # without --resume: from the beginning, but not without a word
    assert "small.checkpoint.safetensors of a stopped run will be replaced" in capsys.readouterr().out
    monkeypatch.setattr(module._StopRequest, "__call__", lambda self: False)
    with monkeypatch.context() as full:
        full.setattr(TrainedModel, "save", no_space)
        assert module.main(arguments) == 2
    assert capsys.readouterr().err.endswith("snug.train: no space left\n")
    assert [path.name for path in tmp_path.iterdir()] == ["small.checkpoint.safetensors"]
    assert module.main(arguments) == 0
    shown = capsys.readouterr().out
    assert "8 steps" in shown and "validation" in shown and "ms a step" in shown
    assert [path.name for path in tmp_path.iterdir()] == ["small.safetensors"]
    assert module.main(arguments) == 0 and "nothing to resume" in capsys.readouterr().out
    dressed = tube_dress()
    heavier = replace(dressed.garment, skinning_weights=np.roll(dressed.garment.skinning_weights, 1, axis=1))
    rounder = replace(dressed.body, shape_directions=2 * dressed.body.shape_directions)
    others = (dressed, DressedBody(dressed.body, heavier), DressedBody(rounder, dressed.garment))
    assert len({digest_inputs(other, library, [], {}) for other in others}) == 3
    before = out.read_bytes()
    others = {"seed": "1", "recipe": "paper", "steps": "9", "vertices": "300", "model": "pbns"}
    for name, value in others.items():
        error = refused("small.safetensors: of another ", module.main, [*arguments, f"--{name}", value])
        assert f"of another {name}" in error.replace("number of ", "")
    for other in ([swaying(21)], [swaying(16, name="held")]), ([swaying(20)], []):
        monkeypatch.setattr(train_to_file, "choose_motions", lambda options, data, other=other: other)
        refused("of another body, garment or motions", module.main, arguments)
    monkeypatch.setattr(train_to_file, "choose_motions", lambda options, data: (library[:1], library[1:]))
    assert out.read_bytes() == before
    monkeypatch.setattr(module._StopRequest, "__call__", lambda self: True)
    assert module.main([*arguments[:-1], "--seed", "1"]) == 130
    assert "small.safetensors will be replaced when this training has ended" in capsys.readouterr().out
    assert out.read_bytes() == before


def test_garments_are_trained_one_after_another_and_those_that_ended_stay(
    tailored_once, tmp_path, monkeypatch, capsys
):
    from snug import train as module

    monkeypatch.setattr(train_to_file, "choose_motions", lambda options, data: ([swaying(20)], []))
    arguments = ["--vertices", "200", "--steps", "3", "-o", str(tmp_path / "mine.safetensors"), "--resume"]
    arguments += ["--garment", "tshirt", "--garment", "tunic"]
    asked = iter([False, False, False, True])  # in the first step of the second
    monkeypatch.setattr(module._StopRequest, "__call__", lambda self: next(asked))
    assert module.main(arguments) == 130
    shirt = tmp_path / "mine-tshirt.safetensors"
    before = shirt.read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {shirt.name, "mine-tunic.checkpoint.safetensors"}
    monkeypatch.setattr(module._StopRequest, "__call__", lambda self: False)
    assert module.main(arguments) == 0 and "nothing to resume" in capsys.readouterr().out
    assert shirt.read_bytes() == before
    models = {path.name: TrainedModel.load(path) for path in tmp_path.iterdir()}
    assert set(models) == {shirt.name, "mine-tunic.safetensors"}
    assert {model.steps for model in models.values()} == {3}
    assert models[shirt.name].vertices != models["mine-tunic.safetensors"].vertices
