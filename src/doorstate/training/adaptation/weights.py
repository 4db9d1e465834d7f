# SPDX-License-Identifier: Apache-2.0
"""Adapted weights: moved back towards those they began with until nothing is forgotten, and calibrated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import lightning_fabric
import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import f1_score

from doorstate.dataset.store import PreparedDataset
from doorstate.errors import RunError
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import load_weights
from doorstate.training.calibration import abstain_threshold, at_temperature, fit_temperature
from doorstate.training.data import RunData
from doorstate.training.network_outputs import network_outputs
from doorstate.types import STATES

MOST_FORGOTTEN = 0.01  # of the macro-F1 on simulated clouds
_SHARES = (1.0, 0.75, 0.5, 0.25)  # of the way from the first weights to the trained ones
_WRONG_SHARE = 0.05  # of the answers on held-out samples, at most


class StateProbabilities(NamedTuple):
    """True states of M clouds, and their probabilities at temperature 1."""

    labels: NDArray[np.int64]  # (M,)
    probabilities: NDArray[np.float64]  # (M, 3)

    @property
    def macro_f1(self) -> float:
        """Mean F1 of the three states, 0 to 1."""
        predicted = self.probabilities.argmax(axis=1)
        return float(
            f1_score(self.labels, predicted, labels=range(len(STATES)), average="macro", zero_division=0)
        )


class Adapted(NamedTuple):
    """Adapted network, and what it still knows of simulated doors."""

    network: PointNetwork
    share: float  # of the way from the first weights to the trained ones
    simulated: StateProbabilities
    simulated_f1_before: float


def states_of(
    network: PointNetwork,
    card: WeightsCard,
    fabric: lightning_fabric.Fabric,
    datasets: Sequence[PreparedDataset],
    samples: Sequence[str] | None = None,
) -> StateProbabilities:
    """Run a network on the samples with a state, all of some data sets or some of one."""
    network.to(fabric.device)
    labels, probabilities = [], []
    for dataset in datasets:
        chosen = [
            sample
            for sample in (dataset.sample_ids if samples is None else samples)
            if dataset.rows[dataset.index_of(sample)]["state"] in STATES
        ]
        data = RunData(dataset, dict.fromkeys(chosen, "test"), card.heads, device=fabric.device)
        outputs = network_outputs(network, data.loader("test", card.points_in_use), fabric)
        labels.append(outputs.labels)
        probabilities.append(outputs.probabilities.astype(np.float64))
    return StateProbabilities(np.concatenate(labels), np.concatenate(probabilities))


def keep_knowledge(
    start: Path, trained: Path, fabric: lightning_fabric.Fabric, simulated: Sequence[PreparedDataset]
) -> Adapted:
    """Return the trained network, moved back towards the first weights as far as simulated doors need it.

    Weights between two of one training are a network as good as both (Wortsman et al. 2022).

    Args:
        start: weights file that the training began with.
        trained: weights file of the training.
        fabric: device and precision.
        simulated: held-out simulated clouds.

    Raises:
        RunError: even a quarter of the way loses more than 0.01 of the macro-F1 on them.
    """
    network, card = load_weights(start)
    before = states_of(network, card, fabric, simulated).macro_f1
    first = {name: tensor.clone() for name, tensor in network.cpu().state_dict().items()}
    last = load_weights(trained)[0].state_dict()
    for share in _SHARES:
        mixed = {
            name: tensor + share * (last[name] - tensor) if tensor.is_floating_point() else tensor
            for name, tensor in first.items()
        }
        network.load_state_dict(mixed)
        after = states_of(network, card, fabric, simulated)
        if after.macro_f1 >= before - MOST_FORGOTTEN:
            return Adapted(network, share, after, before)
    raise RunError(
        f"the macro-F1 on simulated doors falls from {before:.3f} to {after.macro_f1:.3f}",
        path=trained,
        hint="label more frames, and check their labels",
    )


def calibrate(simulated: StateProbabilities, site: StateProbabilities | None) -> tuple[float, float]:
    """Return temperature and least probability of an answer, by simulated and held-out clouds with equal weight.

    Args:
        simulated: of held-out simulated clouds.
        site: of held-out clouds of the place, few as they are; None: there are none.
    """
    labels, probabilities = simulated
    if site is not None and len(site.labels):
        rows = np.arange(len(labels)) % len(site.labels)
        labels = np.concatenate([labels, site.labels[rows]])
        probabilities = np.concatenate([probabilities, site.probabilities[rows]])
    temperature = round(fit_temperature(probabilities, labels), 4)
    scaled = at_temperature(probabilities, temperature)
    return temperature, round(min(0.999, abstain_threshold(scaled, labels, _WRONG_SHARE)), 4)
