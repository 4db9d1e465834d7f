# SPDX-License-Identifier: Apache-2.0
"""A network asked by torch."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from doorstate.clouds.preparation import centroids, normalize
from doorstate.networks.base import PointNetwork
from doorstate.networks.head_layers import head_outputs
from doorstate.networks.heads import STATE, head_columns
from doorstate.networks.heads.spec import Columns
from doorstate.types import Points


class TorchBackend:
    """A network with its temperature, in evaluation mode.

    Args:
        network: classifier; changes to evaluation mode.
        temperature: logits are divided by it.
    """

    def __init__(self, network: PointNetwork, temperature: float) -> None:
        self.network = network.eval()
        self.temperature = temperature

    def ask(
        self, points: Points, kind: type[np.floating] = np.float32
    ) -> tuple[NDArray[np.float32], Columns]:
        """Probabilities (B, 3), and what further heads say, (B,) each, of (B, n, 3) metres in farthest-point order.

        Args:
            points: the clouds.
            kind: the number type of the network's weights.
        """
        with torch.inference_mode():
            outputs = head_outputs(
                self.network, torch.from_numpy(normalize(points).astype(kind)), with_points=False
            )
            calibrated: NDArray[np.float32] = (outputs.pop(STATE) / self.temperature).softmax(1).numpy()
        return calibrated, head_columns(
            {name: values.numpy() for name, values in outputs.items()}, centroids(points)
        )
