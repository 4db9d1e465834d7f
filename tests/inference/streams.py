# SPDX-License-Identifier: Apache-2.0
"""Predictions and streams of them, for the tests of the filter and of waiting."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from doorstate.inference.abstention import Abstention
from doorstate.inference.prediction import Prediction
from doorstate.types import DoorState

OPEN, CLOSED, SEMI_OPEN = DoorState.OPEN, DoorState.CLOSED, DoorState.SEMI_OPEN
UNKNOWN = Prediction.abstain(Abstention("hole", {"share": 0.3, "free_reach_m": 4.0}))


def predict(state: DoorState, probability: float = 0.9) -> Prediction:
    rest = (1 - probability) / 2
    return Prediction(
        state,
        1024,
        1.0,
        raw_probabilities={other: probability if other == state else rest for other in DoorState},
    )


def stamped(*parts: tuple[int, Prediction], rate_hz: float = 10.0) -> Iterator[tuple[float, Prediction]]:
    number = itertools.count()
    return iter([(100.0 + next(number) / rate_hz, frame) for count, frame in parts for _ in range(count)])
