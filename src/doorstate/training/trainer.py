# SPDX-License-Identifier: Apache-2.0
"""Training loop of one run: epochs of shuffled batches, validation, the best weights, checkpoints."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial

import lightning_fabric
import numpy as np
import torch
from torch import Tensor

from doorstate.dataset.loader import Batch, CloudLoader
from doorstate.errors import ConfigError, RunError
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import joint_losses
from doorstate.networks.layers.batch_norm import set_batchnorm
from doorstate.networks.weights import save_weights
from doorstate.training.checkpoint import Checkpoint, EpochProgress, TrainingState
from doorstate.training.config import RunConfig
from doorstate.training.data import EpochLoaders, RunData
from doorstate.training.environment import compile_if_possible
from doorstate.training.network_outputs import network_outputs
from doorstate.training.optimizers import create_optimizers
from doorstate.training.ranks import ALONE, Ranks
from doorstate.training.run_folder import RunFolder
from doorstate.training.schedules import RateSchedule, Resolution, batchnorm_momentum, resolution_of_epoch

_POSITION_INTERVAL_S = 1.0
_CHECKPOINT_INTERVAL_S = 180.0  # within an epoch, which can take a quarter of an hour


class Trainer:
    """Training of one network, continued from the checkpoint of its folder.

    Everything random in an epoch follows from (seed, fold, epoch), so a run that was killed and continued ends with the
    same weights as one that was not, given the same number of threads.
    """

    def __init__(
        self,
        config: RunConfig,
        fabric: lightning_fabric.Fabric,
        network: PointNetwork,
        data: RunData,
        run: RunFolder,
        ranks: Ranks = ALONE,
    ) -> None:
        """Prepare the training.

        Args:
            config: configuration of a run with at least one epoch.
            fabric: device and precision.
            network: initial weights.
            data: samples.
            run: folder for weights, log and checkpoint, which the first rank writes.
            ranks: processes that train together, each on an equal part of every batch.

        Raises:
            RunError: the checkpoint is damaged.
            ConfigError: the ranks cannot share a batch equally.
        """
        self.config, self.fabric, self.data, self.run, self.ranks = config, fabric, data, run, ranks
        self.network = network.to(fabric.device)
        self.network.use_ranks(ranks.size)
        recipe = config.recipe
        if recipe.batch_size % ranks.size:
            raise ConfigError(
                f"{ranks.size} processes cannot share batches of {recipe.batch_size}",
                field="batch_size",
                expected=f"a multiple of {ranks.size}",
            )
        self.iterations_per_epoch = max(
            1, min(data.num_train, recipe.clouds_per_epoch or data.num_train) // recipe.batch_size
        )
        self.optimizers = create_optimizers(recipe, network)
        self.schedule = RateSchedule(recipe, self.optimizers, self.iterations_per_epoch, config.num_points)
        self._state_loss = network.training_loss
        self._joint_losses: Callable[..., tuple[dict[str, Tensor], Tensor]] = partial(joint_losses, network)
        if recipe.compile:
            self._state_loss = compile_if_possible(self._state_loss)
            self._joint_losses = compile_if_possible(self._joint_losses)
        self._loaders: tuple[Resolution, EpochLoaders] | None = None
        self._checkpoint = Checkpoint(run.checkpoint, network, self.optimizers, self.schedule)
        self.state = self._checkpoint.load()

    def train(self) -> TrainingState:
        """Run the remaining epochs; the run's folder then holds the best weights.

        Raises:
            RunError: the loss is not finite.
        """
        for epoch in range(len(self.state.log), self.config.recipe.epochs):
            self.train_epoch(epoch)
        return self.state

    def train_epoch(self, epoch: int) -> None:
        """Train, validate, keep the weights if they are the best, and write log and checkpoint."""
        done_s = 0.0 if self.state.progress is None else self.state.progress.seconds
        started = time.perf_counter() - done_s
        resolution = resolution_of_epoch(self.config.recipe, epoch, self.config.num_points)
        loaders = self._loaders_at(resolution)
        rate, loss = self._train_batches(epoch, loaders.train, started)
        entry = {
            "epoch": epoch,
            "points": resolution.num_points,
            "centres": resolution.centre_share,
            "lr": rate,
            "train_loss": loss,
        }
        score = (0.0, float(epoch))  # without validation samples the last epoch is the best
        if len(loaders.val) and self.ranks.is_first:
            validation = network_outputs(self.network, loaders.val, self.fabric)
            score = (validation.macro_f1, -validation.loss)
            entry |= {"val_loss": validation.loss, "val_macro_f1": validation.macro_f1}
        # Weights are used at full resolution, so an epoch on coarser clouds is never the best.
        is_full = resolution == Resolution(self.config.num_points, 1.0)
        if is_full and score > self.state.best_score:
            self.state.best_score, self.state.best_epoch = score, epoch
            if self.ranks.is_first:
                save_weights(self.run.weights, self.network, self._card())
        self.state.log.append(entry | {"seconds": time.perf_counter() - started})
        self._save_checkpoint(None)

    def train_step(self, batch: Batch) -> Tensor:
        """Return the loss of a batch, without waiting for it, and update the weights."""
        recipe = self.config.recipe
        self.network.zero_grad(set_to_none=True)
        with self.fabric.autocast():
            loss = self._loss(batch)
        loss.backward()  # type: ignore[no-untyped-call]
        loss = self.ranks.average(self.network, loss.detach())
        if recipe.gradient_clip is not None:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), recipe.gradient_clip)
        for optimizer in self.optimizers:
            optimizer.step()
        return loss

    @property
    def neighbours_are_fixed(self) -> bool:
        """True if no change of a cloud changes its neighbourhoods, so that one search is enough."""
        augmentation = self.config.recipe.augmentation
        if not self.config.recipe.corruption.changes_nothing:
            return False
        if self.network.neighbours_are_scale_invariant:
            return augmentation.is_similarity
        return augmentation.is_rigid

    def _loaders_at(self, resolution: Resolution) -> EpochLoaders:
        """Return the loaders at a resolution, and set the network to it; those of the last epoch are kept."""
        if self._loaders is None or self._loaders[0] != resolution:
            self.network.use_centres(resolution.centre_share)
            loaders = self.data.epoch_loaders(
                resolution.num_points,
                self.network.neighbourhoods,
                self.neighbours_are_fixed,
                self.config.recipe.corruption,
            )
            self._loaders = resolution, loaders
        return self._loaders[1]

    def _train_batches(self, epoch: int, loader: CloudLoader, started: float) -> tuple[float, float]:
        """Return the last learning rate and the mean loss of an epoch."""
        config, recipe = self.config, self.config.recipe
        torch.manual_seed(config.torch_seed(epoch + 1))  # dropout
        losses: list[float | Tensor] = []
        rate = 0.0
        if self.state.progress is not None:
            losses, rate, generator, _ = [*self.state.progress.losses], *self.state.progress[1:]
            torch.set_rng_state(generator)
            self.state.progress = None
        self.network.train(not recipe.frozen)
        position_s = checkpoint_s = time.perf_counter()
        for batch in loader.shuffled(
            recipe.batch_size,
            recipe.augmentation,
            (config.seed, config.fold, epoch),
            skip=len(losses),
            limit=recipe.clouds_per_epoch,
            no_door_share=recipe.no_door_share,
            own_share=recipe.own_share,
            part=self.ranks,
        ):
            rate = self.schedule.rate
            momentum = batchnorm_momentum(recipe, self.schedule.iteration, self.iterations_per_epoch)
            if momentum is not None:
                set_batchnorm(self.network, momentum=momentum)
            if self.ranks.is_first and time.perf_counter() - position_s > _POSITION_INTERVAL_S:
                position_s = time.perf_counter()
                self.run.write_position(self.schedule.iteration / self.iterations_per_epoch)
            if self.fabric.device.type != "cpu" or self.ranks.size > 1:
                # A checkpoint holds the state of one generator, that of the first rank's processor.
                torch.manual_seed(config.torch_seed(epoch + 1, len(losses), self.ranks.rank))
            losses.append(self.train_step(batch))
            self.schedule.step()
            if time.perf_counter() - checkpoint_s > _CHECKPOINT_INTERVAL_S:
                checkpoint_s = time.perf_counter()
                self._save_checkpoint(
                    EpochProgress([*map(float, losses)], rate, torch.get_rng_state(), checkpoint_s - started)
                )
        mean = float(np.mean([*map(float, losses)]))
        if not math.isfinite(mean):
            raise RunError(
                f"the loss is {mean} in epoch {epoch}",
                path=self.run.path,
                hint="try a lower learning_rate in the recipe",
            )
        return rate, mean

    def _loss(self, batch: Batch) -> Tensor:
        recipe = self.config.recipe
        if not self.config.heads:
            loss, _ = self._state_loss(
                batch.points, batch.labels, recipe.label_smoothing, batch.neighbourhoods
            )
            return loss
        losses, _ = self._joint_losses(
            batch.points,
            batch.labels,
            batch.targets,
            recipe.label_smoothing,
            batch.neighbourhoods,
            recipe.part_points,
        )
        weighted = [recipe.loss_weights.get(name, 1.0) * head_loss for name, head_loss in losses.items()]
        return torch.stack(weighted).sum()

    def _save_checkpoint(self, progress: EpochProgress | None) -> None:
        if not self.ranks.is_first:
            return
        self.state.progress = progress
        self._checkpoint.save(self.state)
        self.state.progress = None
        self.run.write_log(self.state.log)

    def _card(self) -> WeightsCard:
        config, dataset = self.config, self.data.dataset
        source, normalization = dataset.description, dataset.normalization
        extra = f", and {self.data.num_extra} additional samples" if self.data.extra else ""
        return WeightsCard(
            network=config.network,
            network_options=config.all_network_options,
            num_points=config.num_points,
            heads=config.heads,
            input=source.input,
            scale_m=normalization.scale_m,
            # A crop is limited by its box.
            max_depth_m=dataset.depth_range_m if source.crops is None else None,
            trained_on=f"{source.source}, protocol {config.protocol}, fold {config.fold}{extra}",
        )
