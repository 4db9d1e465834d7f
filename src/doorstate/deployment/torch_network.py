# SPDX-License-Identifier: Apache-2.0
"""A network asked by torch."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from doorstate.clouds.preparation import normalize
from doorstate.networks.base import PointNetwork
from doorstate.types import Points


class TorchNetwork:
    """A network with its temperature, in evaluation mode.

    Args:
        network: classifier; changes to evaluation mode.
        temperature: logits are divided by it.
    """

    def __init__(self, network: PointNetwork, temperature: float) -> None:
        self.network = network.eval()
        self.temperature = temperature

    def probabilities(self, points: Points) -> NDArray[np.float32]:
        """(B, 3) probabilities of (B, n, 3) metres in farthest-point order."""
        with torch.inference_mode():
            logits = self.network(torch.from_numpy(normalize(points)))
            calibrated: NDArray[np.float32] = (logits / self.temperature).softmax(1).numpy()
        return calibrated
