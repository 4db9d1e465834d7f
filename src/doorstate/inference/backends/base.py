# SPDX-License-Identifier: Apache-2.0
"""Interface of the libraries that run a network."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.validity import are_probabilities, is_probability
from doorstate.networks.card import WeightsCard
from doorstate.networks.heads.spec import Columns
from doorstate.types import Points

if TYPE_CHECKING:
    from doorstate.networks.base import PointNetwork


class CloudOutputs(NamedTuple):
    """Outputs of a network for one cloud."""

    probabilities: NDArray[np.float32]  # (3,)
    heads: Mapping[str, float]  # by column of the manifest, metres and degrees in the frame of the cloud

    def are_valid(self) -> bool:
        """Return True for finite numbers, among them probabilities of which those of the states sum to one."""
        return are_probabilities(self.probabilities.tolist()) and all(
            is_probability(value) if name.startswith("p_") else math.isfinite(value)
            for name, value in self.heads.items()
        )


class Outputs(NamedTuple):
    """Outputs of a network for a batch of clouds."""

    probabilities: NDArray[np.float32]  # (B, 3), calibrated
    heads: Columns  # (B,) each, by column of the manifest, metres and degrees in the frame of the clouds
    withheld: NDArray[np.bool_] | None = None  # (B,) True where an exported network gives NaN for heads

    def per_cloud(self) -> list[CloudOutputs]:
        """Return the outputs of every cloud."""
        return [
            CloudOutputs(
                row,
                {
                    name: float(column[number])
                    for name, column in self.heads.items()
                    if not self._is_withheld(number, name)
                },
            )
            for number, row in enumerate(self.probabilities)
        ]

    def _is_withheld(self, number: int, name: str) -> bool:
        """Return True for a head that an exported network does not give; the probability of a door it always gives."""
        if self.withheld is None or not self.withheld[number] or name == "p_door":
            return False
        return bool(np.isnan(self.heads[name][number]))


class Backend(Protocol):
    """Network with its weights, ready to run; threads may share one."""

    card: WeightsCard

    @property
    def num_points(self) -> int | None:
        """Points per cloud that the network takes; None: any number."""

    @property
    def network(self) -> PointNetwork | None:
        """Network as a torch module; None where there is none."""

    def __call__(self, points: Points) -> Outputs:
        """Run the network.

        Args:
            points: (B, n, 3) metres, each cloud in farthest-point order and in the frame of the card's input.
        """


def run_by_size(backend: Backend, clouds: Sequence[Points]) -> list[CloudOutputs]:
    """Run a network on clouds (n, 3) of any sizes, those of equal size together; outputs are in their order."""
    outputs: dict[int, CloudOutputs] = {}
    for size in sorted({len(cloud) for cloud in clouds}):
        numbers = [number for number, cloud in enumerate(clouds) if len(cloud) == size]
        batch = backend(np.stack([clouds[number] for number in numbers]))
        outputs.update(zip(numbers, batch.per_cloud(), strict=True))
    return [outputs[number] for number in range(len(clouds))]
