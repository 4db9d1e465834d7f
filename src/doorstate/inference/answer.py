# SPDX-License-Identifier: Apache-2.0
"""State of one door, or the reason why there is none: what a door and the prediction for a cloud have alike."""

from __future__ import annotations

from collections.abc import Mapping

from doorstate.inference.abstention import Abstention
from doorstate.types import ABSTAINED, DoorState


class StateAnswer:
    """State with its probabilities, or an abstention; a base of data classes."""

    state: DoorState | None
    abstention: Abstention | None  # set exactly where `state` is None
    raw_probabilities: Mapping[str, float] | None  # of a network by state, even where its state is refused

    @property
    def label(self) -> str:
        """Name of the state, or `abstained`."""
        return str(self.state or ABSTAINED)

    @property
    def probabilities(self) -> dict[str, float] | None:
        """Probabilities by state; None without a state, and for a rule, which does not estimate any."""
        return None if self.state is None or self.raw_probabilities is None else dict(self.raw_probabilities)

    @property
    def probability(self) -> float | None:
        """Probability of the state; None where there are no `probabilities`."""
        return None if self.state is None or self.probabilities is None else self.probabilities[self.state]

    @property
    def reason(self) -> str:
        """Sentence of the abstention; empty with a state."""
        return "" if self.abstention is None else str(self.abstention)
