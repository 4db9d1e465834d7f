# SPDX-License-Identifier: Apache-2.0
"""Outputs and scores of a network on the samples of a loader."""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import lightning_fabric
import numpy as np
import torch
from sklearn.metrics import accuracy_score, f1_score
from torch import Tensor
from torch.nn import functional

from doorstate.dataset.loader import CloudLoader
from doorstate.networks.base import PointNetwork
from doorstate.networks.head_layers import head_outputs
from doorstate.networks.heads import IGNORE_INDEX, POINT_HEADS, STATE
from doorstate.types import PARTS, STATES

_BATCH_SIZE = 32


class NetworkOutputs(NamedTuple):
    """Outputs of a network for M samples in order, and their labels."""

    loss: float  # mean cross entropy of the states
    probabilities: np.ndarray  # (M, 3)
    labels: np.ndarray  # (M,) int64, IGNORE_INDEX without a state
    head_values: dict[str, np.ndarray]  # by head, (M, num_values), in the network's units
    part_counts: np.ndarray | None  # (parts, parts) points by true and predicted part

    @property
    def has_state(self) -> np.ndarray:
        """(M,) True where the sample has a state."""
        mask: np.ndarray = self.labels != IGNORE_INDEX
        return mask

    @property
    def macro_f1(self) -> float:
        """Mean F1 of the three states, 0 to 1."""
        true, predicted = self._states()
        return float(f1_score(true, predicted, labels=range(len(STATES)), average="macro", zero_division=0))

    @property
    def accuracy(self) -> float:
        """Share of correct states, 0 to 1."""
        return float(accuracy_score(*self._states()))

    def _states(self) -> tuple[np.ndarray, np.ndarray]:
        return self.labels[self.has_state], self.probabilities.argmax(1)[self.has_state]


@torch.no_grad()
def network_outputs(
    network: PointNetwork, loader: CloudLoader, fabric: lightning_fabric.Fabric
) -> NetworkOutputs:
    """Return the outputs of a network for all samples of a loader, which yields them on the device of the network."""
    network.eval()
    outputs: defaultdict[str, list[Tensor]] = defaultdict(list)
    part_counts = None
    for batch in loader.in_order(_BATCH_SIZE):
        with fabric.autocast():
            batch_outputs = head_outputs(network, batch.points, batch.neighbourhoods)
        if PARTS in batch_outputs:
            predicted = batch_outputs.pop(PARTS).argmax(-1).cpu().numpy()
            counts = POINT_HEADS[PARTS].confusion(batch.targets[PARTS].cpu().numpy(), predicted)
            part_counts = counts if part_counts is None else part_counts + counts
        for name, values in batch_outputs.items():
            outputs[name].append(values.float())
        outputs["labels"].append(batch.labels)
    joined = {name: torch.cat(values).cpu() for name, values in outputs.items()}
    logits, labels = joined.pop(STATE), joined.pop("labels")
    loss = functional.cross_entropy(logits, labels, ignore_index=IGNORE_INDEX).item()
    head_values = {name: values.numpy() for name, values in joined.items()}
    return NetworkOutputs(loss, logits.softmax(1).numpy(), labels.numpy(), head_values, part_counts)
