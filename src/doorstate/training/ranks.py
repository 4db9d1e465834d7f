# SPDX-License-Identifier: Apache-2.0
"""Processes that train one network together, each with one device and an equal share of every batch.

They are started by torchrun, or by `launch_ranks`, which is torchrun's own engine. Plain torch.distributed serves:
batch statistics and gradients are means over ranks, and a network's gradients fit one message.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from typing import NamedTuple

import torch
from torch import Tensor, distributed, nn

from doorstate._devices import resolve_device
from doorstate._jobs import default_workers
from doorstate.errors import ConfigError, RunError

_TIMEOUT = timedelta(hours=2)  # the others wait while the first rank validates and tests


class Ranks(NamedTuple):
    """Place of this process among those that train together; by default it is alone."""

    rank: int = 0
    size: int = 1

    @property
    def is_first(self) -> bool:
        """True for the process that writes files, validates and tests."""
        return self.rank == 0

    def wait(self) -> None:
        """Wait for all ranks."""
        if self.size > 1:
            distributed.barrier()

    def agree(self, value: bool) -> bool:
        """Return the value of the first rank."""
        if self.size == 1:
            return value
        values = [value]
        distributed.broadcast_object_list(values)
        return values[0]

    def average(self, network: nn.Module, loss: Tensor) -> Tensor:
        """Replace the gradients of a network by their means over the ranks, and return the mean of their losses."""
        if self.size == 1:
            return loss
        grads = [parameter.grad for parameter in network.parameters() if parameter.grad is not None]
        message = torch.cat([loss.view(1), *(grad.flatten() for grad in grads)])
        distributed.all_reduce(message)
        message /= self.size
        means = torch.split(message[1:], [grad.numel() for grad in grads])
        for grad, mean in zip(grads, means, strict=True):
            grad.copy_(mean.view_as(grad))
        return message[0]


ALONE = Ranks()
"""One process."""


def is_rank() -> bool:
    """Return True in a process that torchrun or `launch_ranks` started."""
    return "LOCAL_RANK" in os.environ and distributed.is_torchelastic_launched()


@contextmanager
def joined_ranks(device_name: str) -> Iterator[tuple[torch.device, Ranks]]:
    """Join the other processes of torchrun within the block; yield the device and place of this process.

    Args:
        device_name: as for `resolve_device`; with several processes "cuda" means one device each.

    Raises:
        ConfigError: there is no such device, or the processes of this machine cannot have one each.
    """
    if not is_rank():
        yield resolve_device(device_name), Ranks()
        return
    ranks = Ranks(int(os.environ["RANK"]), int(os.environ["WORLD_SIZE"]))
    local_size = int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    check_devices(device_name, local_size)
    device = resolve_device(device_name)
    if device.type == "cuda":
        device = torch.device("cuda", int(os.environ["LOCAL_RANK"]) if local_size > 1 else device.index)
        torch.cuda.set_device(device)
    elif "OMP_NUM_THREADS" not in os.environ:
        torch.set_num_threads(max(1, default_workers() // local_size))
    distributed.init_process_group("nccl" if device.type == "cuda" else "gloo", timeout=_TIMEOUT)
    try:
        yield device, ranks
    finally:
        distributed.destroy_process_group()


def check_devices(device_name: str, count: int) -> None:
    """Check that a machine has a device for each of `count` processes; on the processor they share it.

    Raises:
        ConfigError: it has fewer, or one of them is named.
    """
    device = resolve_device(device_name)
    if count == 1 or device.type == "cpu":
        return
    if ":" in device_name:
        raise ConfigError(f"{count} processes cannot share {device_name}", field="device", expected="cuda")
    if count > torch.cuda.device_count():
        raise ConfigError(f"there are {torch.cuda.device_count()} CUDA devices, not {count}", field="devices")


def launch_ranks(count: int, arguments: Sequence[str]) -> None:
    """Run this package's command in `count` processes of this machine, and wait for them.

    Raises:
        RunError: one of them failed; the others are ended.
    """
    from torch.distributed.elastic.multiprocessing.errors import ChildFailedError
    from torch.distributed.launcher.api import LaunchConfig, elastic_launch

    config = LaunchConfig(
        min_nodes=1,
        max_nodes=1,
        nproc_per_node=count,
        rdzv_backend="c10d",
        rdzv_endpoint="127.0.0.1:0",
        local_addr="127.0.0.1",
        max_restarts=0,
        monitor_interval=0.2,
    )
    try:
        elastic_launch(config, sys.executable)("-m", "doorstate", *arguments)
    except ChildFailedError as error:
        raise RunError("a process failed, and the others were ended", hint="see its own message") from error
