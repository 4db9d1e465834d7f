# SPDX-License-Identifier: Apache-2.0
"""Work of two processes that train together; its functions run in them."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Mapping
from pathlib import Path
from unittest.mock import patch

import torch
from torch import Tensor, distributed, nn

from doorstate.dataset.roles import Role
from doorstate.dataset.store import open_dataset
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.head_layers import add_heads, joint_losses
from doorstate.training.config import RunConfig
from doorstate.training.ranks import Ranks
from doorstate.training.run import train_run
from doorstate.training.trainer import Trainer
from tests.training.runs import RECIPE, run_config

NETWORKS = ("pointnet", "pointnet2", "dgcnn", "pointcnn", "point2sequence", "mvcnn")
SIZE, BATCH = 2, 4
# At a low rate, roundings of float32 do not grow from step to step.
QUIET = RECIPE.model_copy(update={"epochs": 2, "learning_rate": 1e-5})


def run_in_two_processes(work: Callable[..., None], folder: Path, *arguments: object) -> None:
    """Call `work(ranks, folder, *arguments)` in two processes of one group."""
    context = multiprocessing.get_context("spawn")
    processes = [
        context.Process(target=_join, args=(work, Ranks(rank, SIZE), folder, *arguments))
        for rank in range(SIZE)
    ]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    assert [process.exitcode for process in processes] == [0, 0]


def training_step(name: str, ranks: Ranks) -> dict[str, Tensor]:
    """Loss, gradients and running statistics of a step on this rank's part of a batch, in float64."""
    torch.manual_seed(0)
    network = create_network(name)
    add_heads(network, ["door"])
    network.double()
    network.use_ranks(ranks.size)
    points = torch.rand(BATCH, 160, 3, dtype=torch.float64) * 2 - 1
    labels = torch.arange(BATCH) % 3
    share = BATCH // ranks.size
    own = slice(ranks.rank * share, (ranks.rank + 1) * share)
    targets = {"door": torch.ones(share, 1, dtype=torch.float64)}
    with no_dropout():
        losses, _ = joint_losses(network, points[own], labels[own], targets)
    loss = torch.stack([*losses.values()]).sum()
    loss.backward()
    mean = ranks.average(network, loss.detach())
    return {"loss": mean, **gradients(network), **dict(network.named_buffers())}


def gradients(network: PointNetwork) -> dict[str, Tensor]:
    """Gradients by name, those that are zero but for rounding left out."""
    found = {f"grad {name}": p.grad for name, p in network.named_parameters() if p.grad is not None}
    return {name: grad for name, grad in found.items() if grad.abs().max() > 1e-12}


def no_dropout() -> patch:
    """Leave dropout out: ranks draw other numbers than one process."""
    return patch.object(nn.Dropout, "forward", lambda self, values: values)


def write_steps_and_runs(ranks: Ranks, folder: Path, dataset: Path, roles: Mapping[str, Role]) -> None:
    """Write the steps of all networks, a whole run, and one that was stopped and continued."""
    steps = {name: training_step(name, ranks) for name in NETWORKS}
    torch.save(steps, folder / f"steps{ranks.rank}.pt")
    prepared = open_dataset(dataset)

    def run(name: str) -> None:
        metrics = train_run(quiet_config(), prepared, roles, folder / name, (), "cpu", ranks)
        assert metrics["test_samples"] > 0

    with no_dropout():
        run("whole")
        with patch.object(Trainer, "train_epoch", _stop_before_epoch(1, Trainer.train_epoch)):
            try:
                run("stopped")
            except KeyboardInterrupt:
                ranks.wait()
        assert (folder / "stopped" / "checkpoint.pt").is_file()
        run("stopped")


def quiet_config() -> RunConfig:
    """Return the configuration of a short run that two processes repeat."""
    return run_config(network="pointnet", recipe=QUIET)


def _stop_before_epoch(last: int, train_epoch: Callable[..., None]) -> Callable[..., None]:
    def stopped(self: Trainer, epoch: int) -> None:
        if epoch == last:
            raise KeyboardInterrupt
        train_epoch(self, epoch)

    return stopped


def _join(work: Callable[..., None], ranks: Ranks, folder: Path, *arguments: object) -> None:
    torch.set_num_threads(1)
    distributed.init_process_group(
        "gloo", init_method=f"file://{folder / 'group'}", rank=ranks.rank, world_size=ranks.size
    )
    work(ranks, folder, *arguments)
    distributed.destroy_process_group()
