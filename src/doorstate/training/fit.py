# SPDX-License-Identifier: Apache-2.0
"""One run: one network trained on one fold, in one folder, resumable; a killed one loses minutes.

Everything random in an epoch comes from (seed, fold, epoch), so a run that was killed and started again ends with the
same weights as one that was not, given the same number of threads.
"""

from __future__ import annotations

import logging
import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import lightning_fabric
import numpy as np
import torch
from pydantic import Field
from sklearn.metrics import accuracy_score, f1_score
from torch import Tensor
from torch.nn import functional

from doorstate._files import atomic_path
from doorstate._memory import keep_freed_memory
from doorstate._models import FrozenModel
from doorstate.dataset.loader import Batch, CloudLoader
from doorstate.dataset.splits import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, DatasetError, RunError, WeightsError
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import add_heads, head_outputs, joint_losses
from doorstate.networks.heads import IGNORE_INDEX, POINT_HEADS, STATE, head_columns
from doorstate.networks.layers import set_batchnorm
from doorstate.networks.weights import load_into, read_card, save_weights
from doorstate.training.environment import bf16_is_quick, compiled, describe_environment
from doorstate.training.optimizers import create_optimizers
from doorstate.training.recipes import Recipe, batchnorm_momentum, learning_rate, resolution_of_epoch
from doorstate.training.run_folder import RunFolder, write_head_outputs, write_predictions
from doorstate.types import NO_DOOR, PARTS, STATES

_ROLES: tuple[Role, ...] = ("train", "val", "test")
_EVALUATION_BATCH = 32
_TELL_EVERY_S = 1.0
_SAVE_EVERY_S = 180.0  # within an epoch, which can take a quarter of an hour


class RunConfig(FrozenModel):
    """What a run trains; kept in its folder, and a folder is continued only with the same."""

    network: str
    network_options: dict[str, Any] = Field(default_factory=dict)
    dataset: str
    protocol: str
    fold: int
    num_points: int
    seed: int
    recipe: Recipe
    start_from: str | None = None  # a weights file to go on from
    heads: tuple[str, ...] = ()  # heads besides the state (networks.heads)
    extra_train_datasets: tuple[
        str, ...
    ] = ()  # data sets whose samples are all learned besides those of the fold


class Evaluation(NamedTuple):
    """Mean loss and class probabilities (M, 3) of samples in order, and what further heads say."""

    loss: float
    probabilities: np.ndarray
    labels: np.ndarray  # (M,) int64, IGNORE_INDEX without a door
    head_values: dict[str, np.ndarray]  # by head, (M, num_values), in the network's units
    part_counts: np.ndarray | None  # (parts, parts) points by true and predicted part

    @property
    def doors(self) -> np.ndarray:
        """(M,) whether the sample has a state."""
        doors: np.ndarray = self.labels != IGNORE_INDEX
        return doors

    @property
    def macro_f1(self) -> float:
        """Mean F1 of the states, 0 to 1, of the samples that have one."""
        return float(f1_score(*self._of_doors(), labels=range(len(STATES)), average="macro", zero_division=0))

    @property
    def accuracy(self) -> float:
        """Share of right answers, 0 to 1, to the samples that have a state."""
        return float(accuracy_score(*self._of_doors()))

    def _of_doors(self) -> tuple[np.ndarray, np.ndarray]:
        return self.labels[self.doors], self.probabilities.argmax(1)[self.doors]


def fit(
    config: RunConfig,
    dataset: PreparedDataset,
    roles: Mapping[str, Role],
    folder: Path,
    more: Sequence[PreparedDataset] = (),
) -> dict[str, Any]:
    """Train, choose the epoch on the validation samples, read the test samples once.

    Args:
        config: what to train.
        dataset: clouds.
        roles: {sample_id: role} of this fold. With neither validation nor test samples the last epoch is kept and
            nothing is tested: that is how weights for use are trained on everything, once a recipe has been chosen.
        folder: of this run; finished runs are returned as they are, begun ones are continued.
        more: clouds of `config.extra_train_datasets`.

    Returns:
        The run's metrics, as in its `metrics.json`.

    Raises:
        ConfigError: nothing is to be trained, and there are no weights to start from.
        RunError: the folder belongs to another run, or the loss is no longer a number.
        DatasetError: a role has no samples.
        WeightsError: the weights to start from are missing or do not fit.
    """
    if config.recipe.epochs == 0 and config.start_from is None:
        raise ConfigError("0 epochs train nothing: set epochs, or start_from to test existing weights")
    run = RunFolder(folder)
    run.claim(config.model_dump(mode="json"), describe_environment())
    if run.finished:
        return run.read_metrics()
    samples = _samples(roles, dataset)
    keep_freed_memory()
    logging.getLogger("lightning_fabric").setLevel(logging.WARNING)  # it announces every run's precision
    fabric = lightning_fabric.Fabric(accelerator="auto", devices=1, precision=_precision(config.recipe))
    with torch.random.fork_rng():
        torch.manual_seed(_seed(config, 0))
        network = _build(config)
        if config.start_from is not None:
            _start_from(network, config)
        trainer = _Trainer(config, fabric, network, dataset, samples, more, run)
        trainer.train()
        metrics = trainer.test()
    run.finish(metrics)
    return metrics


@torch.no_grad()
def evaluate(network: PointNetwork, loader: CloudLoader, fabric: lightning_fabric.Fabric) -> Evaluation:
    """Run a network over all samples of a loader."""
    network.eval()
    found: defaultdict[str, list[Tensor]] = defaultdict(list)
    part_counts = None
    for batch in loader.in_order(_EVALUATION_BATCH):
        on_device = fabric.to_device(batch)
        with fabric.autocast():
            outputs = head_outputs(network, on_device.points, on_device.neighbourhoods)
        if PARTS in outputs:
            predicted = outputs.pop(PARTS).argmax(-1).cpu().numpy()
            counts = POINT_HEADS[PARTS].confusion(batch.targets[PARTS].numpy(), predicted)
            part_counts = counts if part_counts is None else part_counts + counts
        for name, values in outputs.items():
            found[name].append(values.float().cpu())
        found["labels"].append(batch.labels)
    joined = {name: torch.cat(values) for name, values in found.items()}
    logits, labels = joined.pop(STATE), joined.pop("labels")
    loss = functional.cross_entropy(logits, labels, ignore_index=IGNORE_INDEX).item()
    head_values = {name: values.numpy() for name, values in joined.items()}
    return Evaluation(loss, logits.softmax(1).numpy(), labels.numpy(), head_values, part_counts)


class EpochProgress(NamedTuple):
    """How far an epoch is: losses of the iterations done, torch's generator for what is left, and seconds it took."""

    losses: list[float]
    generator: torch.Tensor
    seconds: float = 0.0


class _Trainer:
    def __init__(
        self,
        config: RunConfig,
        fabric: lightning_fabric.Fabric,
        network: PointNetwork,
        dataset: PreparedDataset,
        samples: dict[str, list[str]],
        more: Sequence[PreparedDataset],
        run: RunFolder,
    ) -> None:
        self.config, self.fabric, self.run = config, fabric, run
        self.dataset, self.samples, self.more = dataset, samples, more
        self.network = network.to(fabric.device)
        self.state_loss = network.training_loss
        self.joint_losses: Callable[..., tuple[dict[str, Tensor], Tensor]] = partial(joint_losses, network)
        if config.recipe.compile:
            self.state_loss = compiled(self.state_loss)
            self.joint_losses = compiled(self.joint_losses)
        self.optimizers = create_optimizers(config.recipe, network)
        self.log: list[dict[str, float]] = []
        self.best: tuple[float, float] = (-1.0, -math.inf)
        self.best_epoch = -1
        self.begun: EpochProgress | None = None
        self._resume()

    def train(self) -> None:
        recipe, num_points = self.config.recipe, self.config.num_points
        full = resolution_of_epoch(recipe, recipe.epochs - 1, num_points)
        if recipe.epochs == 0:
            save_weights(self.run.weights, self.network, read_card(Path(str(self.config.start_from))))
        resolution = loader = validation = None
        for epoch in range(len(self.log), recipe.epochs):
            started = time.perf_counter() - (0.0 if self.begun is None else self.begun.seconds)
            wanted = resolution_of_epoch(recipe, epoch, num_points)
            if loader is None or validation is None or wanted != resolution:
                resolution = wanted
                self.network.use_centres(resolution.centres)
                search = self.network.neighbourhoods
                kept = search if self._neighbours_keep() else None
                loader, validation = (
                    CloudLoader(
                        self.dataset, self.samples[role], resolution.points, find, self.config.heads, more
                    )
                    for role, find, more in (("train", kept, self.more), ("val", search, ()))
                )
            rate, loss = self._epoch(epoch, loader, started)
            line = {
                "epoch": epoch,
                "points": resolution.points,
                "centres": resolution.centres,
                "lr": rate,
                "train_loss": loss,
            }
            score = (0.0, float(epoch))  # without validation samples the last epoch is the best
            if len(validation):
                found = evaluate(self.network, validation, self.fabric)
                score = (found.macro_f1, -found.loss)
                line |= {"val_loss": found.loss, "val_macro_f1": found.macro_f1}
            # The final resolution is what counts: an epoch on coarser clouds is never the best of a run.
            if resolution == full and score > self.best:
                self.best, self.best_epoch = score, epoch
                save_weights(self.run.weights, self.network, self._card())
            self.log.append(line | {"seconds": time.perf_counter() - started})
            self._checkpoint()

    def test(self) -> dict[str, Any]:
        load_into(self.network, self.run.weights)
        self.network.to(self.fabric.device)
        metrics: dict[str, Any] = {
            "method": self.config.network,
            "fold": self.config.fold,
            "best_epoch": self.best_epoch,
            "seconds": sum(line["seconds"] for line in self.log),
            **{f"{role}_samples": len(self.samples[role]) for role in ("train", "val", "test")},
        }
        metrics["train_samples"] += self._num_more
        for role, path in (("val", self.run.validation), ("test", self.run.predictions)):
            samples = self.samples[role]
            if samples:
                loader = CloudLoader(self.dataset, samples, self.config.num_points, heads=self.config.heads)
                found = evaluate(self.network, loader, self.fabric)
                doors = [sample for sample, door in zip(samples, found.doors, strict=True) if door]
                write_predictions(path, doors, found.labels[found.doors], found.probabilities[found.doors])
                metrics |= {f"{role}_macro_f1": found.macro_f1, f"{role}_accuracy": found.accuracy}
                if role == "test" and found.head_values:
                    write_head_outputs(
                        self.run.head_outputs, samples, head_columns(found.head_values, loader.centroids)
                    )
                if role == "test" and found.part_counts is not None:
                    metrics["test_part_counts"] = found.part_counts.tolist()
        return metrics

    def _epoch(self, epoch: int, loader: CloudLoader, started: float) -> tuple[float, float]:
        config, recipe = self.config, self.config.recipe
        torch.manual_seed(_seed(config, epoch + 1))  # dropout
        per_epoch = max(1, min(len(loader), recipe.clouds_per_epoch or len(loader)) // recipe.batch_size)
        losses: list[float] = []
        if self.begun is not None:
            losses, generator = self.begun.losses, self.begun.generator
            torch.set_rng_state(generator)
            self.begun = None
        self.network.train()
        rate = 0.0
        told = saved = time.perf_counter()
        batches = loader.shuffled(
            recipe.batch_size,
            recipe.augmentation,
            (config.seed, config.fold, epoch),
            skip=len(losses),
            limit=recipe.clouds_per_epoch,
        )
        for iteration, batch in enumerate(batches, start=epoch * per_epoch + len(losses)):
            rate = learning_rate(recipe, iteration, per_epoch, config.num_points)
            for optimizer in self.optimizers:
                for group in optimizer.param_groups:
                    group["lr"] = rate
            momentum = batchnorm_momentum(recipe, iteration, per_epoch)
            if momentum is not None:
                set_batchnorm(self.network, momentum=momentum)
            if time.perf_counter() - told > _TELL_EVERY_S:
                told = time.perf_counter()
                self.run.write_position(iteration / per_epoch)
            losses.append(self._step(self.fabric.to_device(batch)))
            if time.perf_counter() - saved > _SAVE_EVERY_S:
                saved = time.perf_counter()
                self._checkpoint(EpochProgress(losses, torch.get_rng_state(), saved - started))
        mean = float(np.mean(losses))
        if not math.isfinite(mean):
            raise RunError(f"{self.run.path}: the loss is {mean} in epoch {epoch}; try a lower learning rate")
        return rate, mean

    def _neighbours_keep(self) -> bool:
        augmentation = self.config.recipe.augmentation
        if self.network.neighbours_keep_under_scale:
            return augmentation.is_similarity
        return augmentation.is_rigid

    def _step(self, batch: Batch) -> float:
        self.network.zero_grad(set_to_none=True)
        smoothing = self.config.recipe.label_smoothing
        with self.fabric.autocast():
            if self.config.heads:
                losses, _ = self.joint_losses(
                    batch.points,
                    batch.labels,
                    batch.targets,
                    smoothing,
                    batch.neighbourhoods,
                    self.config.recipe.part_points,
                )
                weights = self.config.recipe.loss_weights
                loss = torch.stack([weights.get(name, 1.0) * each for name, each in losses.items()]).sum()
            else:
                loss, _ = self.state_loss(batch.points, batch.labels, smoothing, batch.neighbourhoods)
        loss.backward()  # type: ignore[no-untyped-call]
        if self.config.recipe.gradient_clip is not None:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), self.config.recipe.gradient_clip)
        for optimizer in self.optimizers:
            optimizer.step()
        return float(loss.detach())

    def _checkpoint(self, begun: EpochProgress | None = None) -> None:
        state = {
            "network": self.network.state_dict(),
            "optimizers": [optimizer.state_dict() for optimizer in self.optimizers],
            "log": self.log,
            "best": list(self.best),
            "best_epoch": self.best_epoch,
            "begun": None if begun is None else list(begun),
        }
        with atomic_path(self.run.checkpoint) as temporary:
            torch.save(state, temporary)
        self.run.write_log(self.log)

    def _resume(self) -> None:
        if not self.run.checkpoint.is_file():
            return
        try:
            state = torch.load(self.run.checkpoint, map_location="cpu", weights_only=True)
        except Exception as error:  # torch raises many kinds for a damaged file
            raise RunError(
                f"{self.run.checkpoint}: cannot be read ({error}); delete the run's folder"
            ) from error
        self.network.load_state_dict(state["network"])
        # Before there were several, it was called otherwise.
        kept = state["optimizers"] if "optimizers" in state else [state["optimizer"]]
        for optimizer, values in zip(self.optimizers, kept, strict=True):
            optimizer.load_state_dict(values)
        self.log, self.best_epoch = state["log"], state["best_epoch"]
        self.best = (state["best"][0], state["best"][1])
        self.begun = EpochProgress(*state["begun"]) if state.get("begun") else None

    @property
    def _num_more(self) -> int:
        return sum(len(each) for each in self.more)

    def _card(self) -> WeightsCard:
        config = self.config
        besides = f", and {self._num_more} samples besides" if self.more else ""
        return WeightsCard(
            network=config.network,
            network_options=_network_options(config),
            num_points=config.num_points,
            heads=config.heads,
            max_depth_m=self.dataset.max_depth_m,
            trained_on=f"{self.dataset.description.source}, protocol {config.protocol}, fold {config.fold}{besides}",
        )


def _build(config: RunConfig) -> PointNetwork:
    network = create_network(config.network, num_classes=len(STATES), **_network_options(config))
    add_heads(network, config.heads)
    return network


def _start_from(network: PointNetwork, config: RunConfig) -> None:
    path = Path(str(config.start_from))
    card = read_card(path)
    if card.network != config.network or card.network_options != _network_options(config):
        raise WeightsError(
            f"{path}: is for {card.network} {card.network_options or ''}, not {config.network}"
        )
    if card.heads != config.heads:
        raise WeightsError(f"{path}: has the heads {card.heads or 'none'}, not {config.heads or 'none'}")
    load_into(network, path)


def _network_options(config: RunConfig) -> dict[str, Any]:
    eps = config.recipe.batchnorm_eps
    return config.network_options | ({} if eps is None else {"batchnorm_eps": eps})


def _precision(recipe: Recipe) -> Any:
    bf16 = recipe.precision == "bf16" or (recipe.precision == "auto" and bf16_is_quick())
    return "bf16-mixed" if bf16 else "32-true"


def _seed(config: RunConfig, epoch: int) -> int:
    return int(np.random.SeedSequence([config.seed, config.fold, epoch]).generate_state(1)[0])


def _samples(roles: Mapping[str, Role], dataset: PreparedDataset) -> dict[str, list[str]]:
    samples: dict[str, list[str]] = {"train": [], "val": [], "test": [], "unused": []}
    for sample, role in roles.items():
        samples[role].append(sample)
    given = [role for role in _ROLES if samples[role]]
    needed = given if given in (["train"], ["test"]) else _ROLES
    for role in needed:
        if len(samples[role]) < 2:
            raise DatasetError(
                f"only {len(samples[role])} samples for {role}: the data set is too small for this split"
            )
        if all(dataset.rows[dataset.index_of(sample)]["state"] == NO_DOOR for sample in samples[role]):
            raise DatasetError(f"no sample with a door to {role}: the data set is too small for this split")
    return samples


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Let torch use `count` threads for a while; None leaves it as it is."""
    before = torch.get_num_threads()
    torch.set_num_threads(count or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)
