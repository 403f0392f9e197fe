"""A run that was stopped at any moment, and resumed, ends with the bits of an unbroken one."""

from dataclasses import replace
from functools import cache

import pytest
import torch

from reference_sim import Material
from snug import train
from snug.named_recipes import PAPER, TAILORNET
from snug.networks.dressed_body import DressedBody
from snug.networks.tensor_file import TensorFileError
from snug.networks.trained_model import TrainedModel
from snug.recipe import DEFAULT
from snug.training import checkpoint as checkpoints
from snug.training.checkpoint import Checkpoint
from snug.training.optimisation_step import Trainer
from tests.snug.training.dressing import short, swaying, tube_dress

EVERY_STEP = 1e-9  # [min]


def stopped(call, *arguments, after, **options):
    """Make the call, whose training is interrupted after so many steps."""
    plain = Trainer.step

    def step(trainer, number):
        if number == after:
            raise KeyboardInterrupt
        return plain(trainer, number)

    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Trainer, "step", step)
        call(*arguments, **options)


def same_model(a, b):
    for one, other in zip(a.network.state_dict().values(), b.network.state_dict().values(), strict=True):
        assert torch.equal(one, other)
    for one, other in zip(a.history, b.history, strict=True):
        names = [name for name in one if not name.startswith("seconds")]
        assert [one[name] for name in names] == [other[name] for name in names]
    assert a.summary == b.summary


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("snug", {"recipe": replace(DEFAULT, mixed=2.0)}),
        ("snug", {"recipe": PAPER}),
        ("tailornet", {"recipe": TAILORNET}),
    ],
    ids=["mixed", "paper", "tailornet"],
)
def test_a_stopped_run_resumes_bit_for_bit(kind, options, tmp_path, narrow):
    whole = short(kind, **options)
    checkpoint = Checkpoint(path=tmp_path / "run.safetensors", minutes=EVERY_STEP, resume=True)
    for after in (2, 5):  # the second time a resumed run; of 28 windows a batch has 16: within an epoch
        stopped(short, kind, checkpoint=checkpoint, after=after, **options)
    resumed = short(kind, checkpoint=checkpoint, **options)
    same_model(whole, resumed)
    assert resumed.history[-1]["step"] == 7 and list(tmp_path.iterdir()) == [checkpoint.path]
    checkpoint.delete()
    assert not list(tmp_path.iterdir())


def no_space(*_):
    raise OSError("no space left")


def interrupt(*_):
    raise KeyboardInterrupt


def test_command_resumes_what_was_interrupted(tmp_path, monkeypatch, capsys):
    out = tmp_path / "small.safetensors"
    arguments = ["--steps", "4", "-o", str(out), "--resume"]
    monkeypatch.setattr(train, "choose_garment", lambda options, body: tube_dress().garment)
    monkeypatch.setattr(train, "choose_motions", lambda *_: [swaying(20)])
    monkeypatch.setattr(train, "CHECKPOINT_MINUTES", EVERY_STEP)
    stopped(train.main.__wrapped__, arguments, after=2)
    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "step", interrupt)
        assert train.main(arguments) == 130
    assert "--resume goes on" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["small.checkpoint.safetensors"]
    with monkeypatch.context() as full:
        full.setattr(TrainedModel, "save", no_space)
        assert train.main(arguments) == 2
    assert capsys.readouterr().err.endswith("snug.train: no space left\n")
    assert [path.name for path in tmp_path.iterdir()] == ["small.checkpoint.safetensors"]
    assert train.main(arguments) == 0
    output = capsys.readouterr().out
    assert "4 steps" in output
    assert [path.name for path in tmp_path.iterdir()] == ["small.safetensors"]
    assert train.main(arguments) == 0 and "nothing to resume" in capsys.readouterr().out


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """The checkpoint of a training of a kind that was interrupted after a step."""

    @cache
    def interrupted(kind):
        path = tmp_path_factory.mktemp(kind) / "run.safetensors"
        checkpoint = Checkpoint(path=path, minutes=EVERY_STEP, resume=True)
        stopped(short, kind, checkpoint=checkpoint, after=1)
        return checkpoint

    return interrupted


DRESSED = tube_dress()
STIFF = replace(DRESSED.garment, material=Material(young_modulus=1e6))


@pytest.mark.parametrize(
    ("kind", "then", "now", "message"),
    [
        ("snug", {"seed": 1}, (), "another seed"),
        ("snug", {"dressed": DressedBody(DRESSED.body, STIFF)}, (), "another material"),
        ("supervised", {"trajectories": {"sway": DRESSED.skin(swaying(30))}}, (), "another data"),
        ("snug", {}, (torch, "get_num_threads", lambda: 7), "another threads"),
        ("snug", {"kernels": False}, (), "another kernels"),
        (
            "snug",
            {},
            (checkpoints, "CHECKPOINT_FORMAT", "snug-checkpoint-99"),
            "no checkpoint of this vers",
        ),
    ],
)
def test_a_checkpoint_of_another_run_is_refused(kind, then, now, message, left, monkeypatch):
    checkpoint = left(kind)
    if now:
        monkeypatch.setattr(*now)
    with pytest.raises(TensorFileError, match=message):
        short(kind, checkpoint=checkpoint, **then)
