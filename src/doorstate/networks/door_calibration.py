# SPDX-License-Identifier: Apache-2.0
"""Probability of a door from what the network and the finder hold of a candidate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.types import DECISION_THRESHOLD

Values = NDArray[np.float64]

_LEAST = 1e-4  # both are rounded, so that 0 and 1 are not certain


class DoorCalibration(FrozenModel):
    """Logistic regression of a door's presence on the logits of the head `door` and of the finder's score.

    Training shows more doors than there are among candidates, so that the head alone is too sure of them.
    """

    door: float
    score: float
    offset: float
    # Less is no door. Only the candidates within 0.35 m of a door count as it in the fit; of the others that overlap
    # it, the likeliest is answered for.
    min_probability: float = Field(default=DECISION_THRESHOLD, gt=0, lt=1)

    def probabilities(self, p_door: Values, score: Values) -> Values:
        """Return the probabilities of doors, (M,), from those of the network and the scores of the candidates."""
        logits = door_features(p_door, score) @ (self.door, self.score, self.offset)
        return np.asarray(1 / (1 + np.exp(-logits)))


def door_features(p_door: Values, score: Values) -> Values:
    """Return the inputs of the regression for M candidates, (M, 3): two logits and 1."""
    door, finder = (np.clip(values, _LEAST, 1 - _LEAST) for values in (p_door, score))
    return np.stack([np.log(door / (1 - door)), np.log(finder / (1 - finder)), np.ones_like(door)], axis=1)
