"""Processes that share a batch: alone nothing changes, and two of them train what one trains."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from snug.named_recipes import PAPER
from snug.networks.tensor_file import read_tensors, write_tensors
from snug.recipe import DEFAULT
from snug.training.device import find_device
from snug.training.optimisation_step import Trainer
from snug.training.process_group import ALONE, Group, GroupError, join_group
from tests.snug.training.dressing import swaying, tube_dress

RECIPES = {
    "default": replace(DEFAULT, mixed=0.0, contact_refresh=0.1),
    "paper": replace(PAPER, contact_refresh=0.1),
}
STEPS = 12


def trained(recipe, group, where):
    """The weights and anchors after a few steps, and the losses."""
    trainer = Trainer("snug", tube_dress(), [swaying(144)], steps=STEPS, seed=0, recipe=recipe, group=group)
    losses = [trainer.step(number)["loss"] for number in range(STEPS)]
    tensors, _ = trainer.state()
    write_tensors(where, tensors, {"losses": losses})


def test_alone_gives_back_what_it_gets():
    tensor = torch.arange(4.0)
    assert ALONE.gathered(tensor) is tensor and ALONE.sent(tensor, 0) is tensor
    assert ALONE.agreed(2.5) == 2.5 and ALONE.part(16) == slice(0, 16) and ALONE.writes
    assert join_group(find_device("cpu")) == (ALONE, torch.device("cpu"))


def test_windows_are_shared_evenly_or_not_at_all():
    assert [Group(rank, 4).part(16) for rank in (0, 3)] == [slice(0, 4), slice(12, 16)]
    with pytest.raises(GroupError, match=r"16 windows .* 3 processes"):
        Group(0, 3).part(16)
    assert not Group(1, 2).writes


CHILD = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import torch
torch.set_num_threads(1)
from tests.snug.training.test_process_group import RECIPES, trained
from snug.training.device import find_device
from snug.training.process_group import join_group, leave_group
group, device = join_group(find_device("cpu"))
trained(RECIPES[sys.argv[2]], group, Path(sys.argv[3]) / f"{group.rank}.safetensors")
leave_group()
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["default", "paper"])
def test_two_processes_train_what_one_trains(name, tmp_path):
    """Equal to rounding, for sums are taken in another order; and the two are equal to the bit."""
    script = tmp_path / "child.py"
    script.write_text(CHILD)
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    command = [str(script), str(Path(__file__).resolve().parents[3]), name, str(tmp_path)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run([*launch, *command], check=True, env=environment, timeout=300)
    trained(RECIPES[name], ALONE, tmp_path / "one.safetensors")
    (zero, first), (one, second), (alone, single) = (
        read_tensors(tmp_path / f"{stem}.safetensors") for stem in ("0", "1", "one")
    )
    assert first["losses"] == second["losses"] and zero.keys() == one.keys() == alone.keys()
    assert all(torch.equal(zero[key], one[key]) for key in zero)
    assert first["losses"] == pytest.approx(single["losses"], rel=2e-4)
    # Adam divides by the size of the gradient, so that rounding moves weights of small gradients by a step.
    moved = alone["network.offsets.weight"]
    assert (zero["network.offsets.weight"] - moved).norm() < 0.02 * moved.norm()
    assert torch.equal(zero["order"], alone["order"]) and torch.equal(
        zero["contact.age"], alone["contact.age"]
    )


@pytest.mark.slow
def test_command_under_torchrun_writes_once(tmp_path):
    out = tmp_path / "small.safetensors"
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    command = ["-m", "snug.train", "--vertices", "200", "--steps", "4", "--hold-out", "walk", "-o", str(out)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    shown = subprocess.run([*launch, *command], env=environment, timeout=300, capture_output=True, text=True)
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.count("4 steps in") == 1 and [path.name for path in tmp_path.iterdir()] == [out.name]
