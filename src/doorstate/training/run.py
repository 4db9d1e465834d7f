# SPDX-License-Identifier: Apache-2.0
"""One run: train one network on one fold in one folder, and test it."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import lightning_fabric
import torch

from doorstate._devices import describe_device, has_fast_bf16, resolve_device
from doorstate._environment import describe_environment
from doorstate._locks import owned_folder
from doorstate._memory import keep_freed_memory
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, WeightsError
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.card_file import read_card
from doorstate.networks.head_layers import add_heads
from doorstate.networks.heads import head_columns
from doorstate.networks.weights import load_into, save_weights
from doorstate.training.checkpoint import TrainingState
from doorstate.training.config import RunConfig
from doorstate.training.contents import contents_of_run, keep_contents
from doorstate.training.data import RunData
from doorstate.training.network_outputs import network_outputs
from doorstate.training.ranks import ALONE, Ranks
from doorstate.training.recipes import Recipe
from doorstate.training.run_folder import RunFolder, write_head_outputs, write_predictions
from doorstate.training.trainer import Trainer


def train_run(
    config: RunConfig,
    dataset: PreparedDataset,
    roles: Mapping[str, Role],
    folder: Path,
    extra_datasets: Sequence[PreparedDataset] = (),
    device: str | torch.device = "auto",
    ranks: Ranks = ALONE,
) -> dict[str, Any]:
    """Train, choose the epoch on the validation samples, and evaluate the test samples once.

    Args:
        config: configuration of the run.
        dataset: data set of the run.
        roles: {sample_id: role} of the fold. Without validation and test samples the last epoch is kept and nothing is
            tested, which makes weights for use.
        folder: folder of the run; a finished run is returned, an unfinished one continued.
        extra_datasets: opened data sets of `config.extra_train_datasets`.
        device: name of a device as for `--device`, or the device of this process.
        ranks: processes that train together (`training.ranks`); the first validates, tests and writes.

    Returns:
        Metrics as in `metrics.json`, the same on all ranks.

    Raises:
        ConfigError: there are no epochs and no weights to start from, or there is no such device.
        RunError: the folder holds another run or began with other data, or the loss is not finite.
        FolderInUseError: another process works in the folder.
        DatasetError: a role has too few samples.
        WeightsError: the weights to start from are missing or do not fit.
    """
    if config.recipe.epochs == 0 and config.start_from is None:
        raise ConfigError(
            "a run of 0 epochs needs weights to start from", field="epochs", expected="1 or more"
        )
    place = resolve_device(device) if isinstance(device, str) else device
    with owned_folder(folder) if ranks.is_first else nullcontext():
        metrics = _train(config, dataset, roles, RunFolder(folder), extra_datasets, place, ranks)
    ranks.wait()
    return RunFolder(folder).read_metrics() if metrics is None else metrics


def _train(
    config: RunConfig,
    dataset: PreparedDataset,
    roles: Mapping[str, Role],
    run: RunFolder,
    extra_datasets: Sequence[PreparedDataset],
    device: torch.device,
    ranks: Ranks,
) -> dict[str, Any] | None:
    """Return the metrics on the first rank, None on the others; arguments and errors are those of `train_run`."""
    if ranks.is_first:
        place = {"device": describe_device(device), "ranks": ranks.size}
        run.claim(config.model_dump(mode="json"), describe_environment() | place)
    extra_folders = [extra.folder for extra in extra_datasets]

    def check_unchanged() -> None:
        if ranks.is_first:
            keep_contents(run.path, contents_of_run(dataset.folder, roles, extra_folders, config.start_from))

    check_unchanged()
    if ranks.agree(run.finished):
        return run.read_metrics()
    data = RunData(dataset, roles, config.heads, extra_datasets, device, config.train_share)
    keep_freed_memory()
    fabric = create_fabric(config.recipe, device)
    with torch.random.fork_rng([device] if device.type == "cuda" else []):
        torch.manual_seed(config.torch_seed(0))
        network = build_network(config)
        state = TrainingState()
        if config.recipe.epochs:
            state = Trainer(config, fabric, network, data, run, ranks).train()
        if not ranks.is_first:
            return None
        if config.recipe.epochs == 0:
            save_weights(run.weights, network, read_card(Path(str(config.start_from))))
        metrics = evaluate_run(config, fabric, network, data, run, state)
    check_unchanged()
    run.finish(metrics)
    return metrics


def build_network(config: RunConfig) -> PointNetwork:
    """Return the network of a run with its initial weights.

    Raises:
        WeightsError: the weights to start from are missing or do not fit.
    """
    network = create_network(config.network, **config.all_network_options)
    add_heads(network, config.heads)
    if config.start_from is not None:
        path = Path(config.start_from)
        card = read_card(path)
        if (card.network, card.network_options) != (config.network, config.all_network_options):
            raise WeightsError(
                f"made for {card.network} {card.network_options or ''}".rstrip(),
                path=path,
                expected=config.network,
            )
        if card.heads != config.heads:
            raise WeightsError(
                f"has the heads {', '.join(card.heads) or 'none'}",
                path=path,
                expected=", ".join(config.heads) or "no heads",
            )
        load_into(network, path)
    return network


def evaluate_run(
    config: RunConfig,
    fabric: lightning_fabric.Fabric,
    network: PointNetwork,
    data: RunData,
    run: RunFolder,
    state: TrainingState,
) -> dict[str, Any]:
    """Write the predictions of the best weights for validation and test samples; return the metrics."""
    load_into(network, run.weights)
    network.to(fabric.device)
    metrics: dict[str, Any] = {
        "method": config.network,
        "fold": config.fold,
        "best_epoch": state.best_epoch,
        "seconds": sum(entry["seconds"] for entry in state.log),
        "train_samples": data.num_train,
        "val_samples": len(data.samples["val"]),
        "test_samples": len(data.samples["test"]),
    }
    roles: tuple[tuple[Role, Path, Path], ...] = (
        ("val", run.validation, run.validation_heads),
        ("test", run.predictions, run.head_outputs),
    )
    for role, path, heads_path in roles:
        if not data.samples[role]:
            continue
        loader = data.loader(role, config.num_points)
        outputs = network_outputs(network, loader, fabric)
        mask = outputs.has_state
        samples = [name for name, has_state in zip(data.samples[role], mask, strict=True) if has_state]
        write_predictions(path, samples, outputs.labels[mask], outputs.probabilities[mask])
        metrics |= {f"{role}_macro_f1": outputs.macro_f1, f"{role}_accuracy": outputs.accuracy}
        if outputs.head_values:
            columns = head_columns(outputs.head_values, loader.placement)
            write_head_outputs(heads_path, data.samples[role], columns)
        if role == "test" and outputs.part_counts is not None:
            metrics["test_part_counts"] = outputs.part_counts.tolist()
    return metrics


def create_fabric(recipe: Recipe, device: torch.device) -> lightning_fabric.Fabric:
    """Return a device and the precision of a recipe on it."""
    logging.getLogger("lightning_fabric").setLevel(logging.WARNING)  # it announces the precision of every run
    bf16 = recipe.precision == "bf16" or (recipe.precision == "auto" and has_fast_bf16(device))
    return lightning_fabric.Fabric(
        accelerator=device.type,
        devices=[device.index or 0] if device.type == "cuda" else 1,
        precision="bf16-mixed" if bf16 else "32-true",
    )


@contextmanager
def torch_threads(count: int | None) -> Iterator[None]:
    """Set the number of torch's threads within the block; None leaves it unchanged."""
    before = torch.get_num_threads()
    torch.set_num_threads(count or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)
