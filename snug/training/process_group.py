"""Several processes that train one network together: `torchrun -m snug.train`.

Every process makes the same data and draws the same random numbers for the whole batch, then works on its own
windows. Gradients are averaged by DistributedDataParallel; the energies of all windows are gathered, so that
every process evaluates the same batch; contact anchors that one process moved or found anew, and states that
it caches, are sent to the others. So the run is that of a single process with the same batch up to the
rounding of float32 sums, which are taken in another order, and up to the anchors of a frame that comes twice
in a step: it repeats bit for bit with the same number of processes, and not across numbers. Kind `ncs`
differs by more: each process exchanges codes among its own windows alone.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import torch
from torch import Tensor, nn


class GroupError(ValueError):
    """Processes that cannot share a run; the message says why."""


@dataclass(frozen=True)
class Group:
    """Process `rank` of `size`. Alone, every method returns its argument."""

    rank: int = 0
    size: int = 1

    @property
    def writes(self) -> bool:
        """True for the process that writes files and messages."""
        return self.rank == 0

    def part(self, count: int) -> slice:
        """Return this process's part of `count` places. Raises GroupError if they cannot be shared evenly."""
        if count % self.size:
            raise GroupError(f"{count} windows a step cannot be shared evenly by {self.size} processes")
        share = count // self.size
        return slice(self.rank * share, (self.rank + 1) * share)

    def wrapped(self, network: nn.Module) -> nn.Module:
        """Return the network to call in training: its gradients are means over all processes."""
        if self.size == 1:
            return network
        return nn.parallel.DistributedDataParallel(network, broadcast_buffers=False)

    def gathered(self, tensor: Tensor) -> Tensor:
        """Return the tensors of all processes, one after another along the first axis."""
        if self.size == 1:
            return tensor
        tensor = tensor.contiguous()
        parts = [torch.empty_like(tensor) for _ in range(self.size)]
        torch.distributed.all_gather(parts, tensor)
        return torch.cat(parts)

    def sent(self, tensor: Tensor, owner: int) -> Tensor:
        """Return the owner's tensor; the others give one of the same shape and type."""
        if self.size > 1:
            torch.distributed.broadcast(tensor, src=owner)
        return tensor

    def agreed(self, value: float) -> float:
        """Return the first process's number: devices may differ in the last digit, decisions must not."""
        if self.size == 1:
            return value
        box = [value]
        torch.distributed.broadcast_object_list(box, src=0)
        return box[0]


ALONE = Group()


def join_group(device: torch.device) -> tuple[Group, torch.device]:
    """Return the group that torchrun started this process in, or ALONE; and this process's device."""
    size = int(os.environ.get("WORLD_SIZE", "1"))
    if size == 1:
        return ALONE, device
    if device.type == "cuda":
        device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
        if device.index >= torch.cuda.device_count():
            raise GroupError(f"{device}: more processes than CUDA devices; start fewer with torchrun")
        torch.cuda.set_device(device)
    torch.distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    return Group(torch.distributed.get_rank(), size), device


def leave_group() -> None:
    """End what `join_group` began."""
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        torch.distributed.destroy_process_group()
