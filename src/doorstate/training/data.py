# SPDX-License-Identifier: Apache-2.0
"""Samples of one run by their role, and the loaders of an epoch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import torch

from doorstate.clouds.corruption import Corruption
from doorstate.dataset.loader import CloudLoader
from doorstate.dataset.neighbour_cache import FindNeighbours
from doorstate.dataset.roles import Role
from doorstate.dataset.shares import samples_of_share
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import DatasetError
from doorstate.types import STATES

_ROLES: tuple[Role, ...] = ("train", "val", "test")
_MIN_SAMPLES = 2  # of each role


class EpochLoaders(NamedTuple):
    """Loaders of the training and of the validation samples at one resolution."""

    train: CloudLoader
    val: CloudLoader


class RunData:
    """Samples of one fold by role, and data sets that are trained on in addition."""

    def __init__(
        self,
        dataset: PreparedDataset,
        roles: Mapping[str, Role],
        heads: Sequence[str],
        extra_datasets: Sequence[PreparedDataset] = (),
        device: torch.device | None = None,
        train_share: float = 1.0,
    ) -> None:
        """Sort the samples.

        Args:
            dataset: data set of the fold.
            roles: {sample_id: role}.
            heads: names of heads; the loaders return their targets.
            extra_datasets: data sets of which all samples are trained on.
            device: device of the batches; None is the processor.
            train_share: share of the scenes that are trained on.

        Raises:
            DatasetError: a role has too few samples, or none with a state.
        """
        self.dataset, self.heads = dataset, heads
        self.extra = [
            (extra, samples_of_share(extra, extra.sample_ids, train_share)) for extra in extra_datasets
        ]
        self.device = device or torch.device("cpu")
        self.samples: dict[Role, list[str]] = {
            role: [sample for sample, sample_role in roles.items() if sample_role == role] for role in _ROLES
        }
        self.samples["train"] = samples_of_share(dataset, self.samples["train"], train_share)
        self._check_roles()

    @property
    def num_extra(self) -> int:
        """Number of samples of the additional data sets."""
        return sum(len(samples) for _, samples in self.extra)

    @property
    def num_train(self) -> int:
        """Number of training samples, additional ones included."""
        return len(self.samples["train"]) + self.num_extra

    def loader(self, role: Role, num_points: int) -> CloudLoader:
        """Return a loader of the fold's samples of one role, without neighbourhoods."""
        return CloudLoader(self.dataset, self.samples[role], num_points, heads=self.heads, device=self.device)

    def epoch_loaders(
        self,
        num_points: int,
        find_neighbours: FindNeighbours,
        keep_train_neighbours: bool,
        corruption: Corruption | None = None,
    ) -> EpochLoaders:
        """Return the loaders of an epoch.

        Args:
            num_points: points of each cloud.
            find_neighbours: search of the network, done once per validation cloud.
            keep_train_neighbours: search only once per training cloud too.
            corruption: losses of the training clouds; validation clouds have none.
        """
        train = CloudLoader(
            self.dataset,
            self.samples["train"],
            num_points,
            find_neighbours if keep_train_neighbours else None,
            self.heads,
            self.extra,
            corruption,
            self.device,
        )
        val = CloudLoader(
            self.dataset, self.samples["val"], num_points, find_neighbours, self.heads, device=self.device
        )
        return EpochLoaders(train, val)

    def _check_roles(self) -> None:
        present = [role for role in _ROLES if self.samples[role]]
        # All samples are trained on (weights for use) or tested (finished weights); otherwise all roles are needed.
        required = present if present in (["train"], ["test"]) else _ROLES
        for role in required:
            samples, folder = self.samples[role], self.dataset.folder
            if len(samples) < _MIN_SAMPLES:
                raise DatasetError(
                    f"{len(samples)} samples for {role}: the data set is too small for this split",
                    path=folder,
                )
            if all(self.dataset.rows[self.dataset.index_of(name)]["state"] not in STATES for name in samples):
                raise DatasetError(
                    f"no sample with a state of a door for {role}: the data set is too small for this split",
                    path=folder,
                )
