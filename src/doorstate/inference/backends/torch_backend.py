# SPDX-License-Identifier: Apache-2.0
"""Network run by torch."""

from __future__ import annotations

import torch

from doorstate.inference.backends.base import Outputs
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import head_outputs
from doorstate.networks.heads import STATE, head_columns
from doorstate.types import Points


class TorchBackend:
    """Network in evaluation mode, in the number type of its weights.

    Args:
        network: classifier; is changed to evaluation mode.
        card: card of its weights.
        device: device to run on; the network is moved there.
    """

    num_points = None

    def __init__(self, network: PointNetwork, card: WeightsCard, device: str = "cpu") -> None:
        self.network = network.eval().to(device)
        self.card = card

    def __call__(self, points: Points) -> Outputs:
        """Run the network on (B, n, 3) metres in farthest-point order."""
        weight = next(self.network.parameters())
        normalization = self.card.normalization
        with torch.inference_mode():
            normalized = torch.from_numpy(normalization(points)).to(weight.device, weight.dtype)
            outputs = head_outputs(self.network, normalized, with_points=False)
            probabilities = (outputs.pop(STATE) / self.card.temperature).softmax(1).cpu().numpy()
        heads = {name: values.cpu().numpy() for name, values in outputs.items()}
        return Outputs(probabilities, head_columns(heads, normalization.placement(points)))
