# SPDX-License-Identifier: Apache-2.0
"""From a raw cloud to an answer, on the path that training took."""

from __future__ import annotations

import time
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import torch

from doorstate.clouds.preparation import NUM_POINTS, normalize, prepare_cloud
from doorstate.errors import WeightsError
from doorstate.networks import list_networks
from doorstate.networks.base import PointNetwork
from doorstate.training.weights import WeightsCard, load_weights
from doorstate.types import STATES, DoorState, Points

DEFAULT_NETWORK = "pointnet2"


@dataclass(frozen=True)
class Prediction:
    """What a network or a rule says of one cloud."""

    state: DoorState | None  # None: no answer, for a reason
    probabilities: dict[str, float]  # by state
    points: int  # how many points were looked at
    milliseconds: float  # from raw points to this answer
    reason: str = ""  # why there is no answer
    opening_angle_deg: float | None = None  # where the method tells it


class Predictor:
    """A network with its weights, and the preparation they were trained with.

    Args:
        network: classifier.
        card: of its weights.
        points: how many points to look at.
        thin: sample the points from some rows and columns of an organized cloud, which is several times quicker,
            and not from all as in training (clouds.preparation).
    """

    def __init__(
        self, network: PointNetwork, card: WeightsCard, points: int = NUM_POINTS, *, thin: bool = True
    ) -> None:
        self.network = network.eval()
        self.card = card
        self.points = points
        self.thin = thin

    @classmethod
    def load(
        cls, name_or_path: str | Path = DEFAULT_NETWORK, points: int | None = None, *, thin: bool = True
    ) -> Predictor:
        """Load packaged weights by network name, or any weights file by path.

        Args:
            name_or_path: a name of `packaged_networks()`, or a `.safetensors` file.
            points: how many points to look at; None takes as many as the weights were trained with.
            thin: as of the class.

        Raises:
            WeightsError: no such weights, or they cannot be used.
        """
        path = Path(name_or_path)
        if path.suffix != ".safetensors":
            path = packaged_weights(str(name_or_path))
        network, card = load_weights(path)
        return cls(network, card, points or card.num_points, thin=thin)

    def __call__(self, points: Points) -> Prediction:
        """State of the door in a cloud.

        Args:
            points: (N, 3) or organized (H, W, 3) metres, x forward, y left, z up, NaN where nothing was measured.

        Raises:
            CloudContentError: the cloud cannot be used (clouds.preparation says when).
        """
        started = time.perf_counter()
        prepared = prepare_cloud(points, self.points, thin=self.thin)
        with torch.inference_mode():
            logits = self.network(torch.from_numpy(normalize(prepared.points))[None])
            probabilities = (logits / self.card.temperature).softmax(1)[0].numpy()
        milliseconds = (time.perf_counter() - started) * 1000
        return Prediction(
            DoorState(int(probabilities.argmax())),
            {state: float(p) for state, p in zip(STATES, probabilities, strict=True)},
            len(prepared.points),
            milliseconds,
        )

    def warm_up(self) -> None:
        """Run once on noise, so that the first real cloud is as quick as the others."""
        self(np.random.default_rng(0).normal(2.0, 1.0, (self.points, 3)).astype(np.float32))


def packaged_networks() -> list[str]:
    """Networks whose weights come with the package."""
    return [name for name in list_networks() if _packaged(name).is_file()]


def packaged_weights(network: str) -> Path:
    """Path of the weights that come with the package.

    Raises:
        WeightsError: there are none for this network.
    """
    path = _packaged(network)
    if not path.is_file():
        known = ", ".join(packaged_networks()) or "none"
        raise WeightsError(
            f"no weights for {network!r} in the package (there are: {known}); give --weights FILE"
        )
    return path


def _packaged(network: str) -> Path:
    return Path(str(resources.files("doorstate.deployment"))) / "weights" / f"{network}.safetensors"
