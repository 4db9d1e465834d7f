# SPDX-License-Identifier: Apache-2.0
"""Bayes filter for the state of a door over time, so that single frames do not make it flicker."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import ConfigError
from doorstate.inference.prediction import Prediction
from doorstate.types import STATES, DoorState

_UNIFORM = 1 / len(STATES)


@dataclass(frozen=True)
class FilteredState:
    """State of a door after all frames so far."""

    state: DoorState | None  # None: too little evidence for any
    probabilities: dict[str, float]  # by state; they sum to one
    since_s: float  # stamp from which on the state, or its absence, has held


class StateFilter:
    """Forward filter of a hidden Markov chain with three states; docs/deployment.md has the equations.

    Between frames, probabilities decay towards uniform. A frame with a state multiplies them by its own probabilities
    to a power that grows with the time since the last frame, so that the result does not depend on the frame rate. The
    state of a rule, which has no probabilities, counts as one with probability 1: `min_likelihood` bounds it. A frame
    without a state adds nothing. Stamps may be irregular; one before the last resets the filter.

    Args:
        stay_probability: probability that a door is in the same state a second later; chosen: forgets all in about 3 s
            without frames, as a person opens or closes a door in 1 to 2 s.
        full_weight_s: time between frames of weight one; chosen: frames of a standing robot have similar errors.
        max_weight: largest weight of one frame, however long ago the last is; chosen: with `min_likelihood`, no single
            frame can bring a new filter to `enter_probability`.
        min_likelihood: least factor of a frame for a state; chosen: above the networks' error rate on simulated doors,
            and rules give certain states.
        enter_probability: a state begins when its probability reaches this.
        leave_probability: a state ends, in None, when its probability falls below this.

    Raises:
        ConfigError: values that are no probabilities in this order.
    """

    def __init__(
        self,
        *,
        stay_probability: float = 0.7,
        full_weight_s: float = 0.3,
        max_weight: float = 0.5,
        min_likelihood: float = 0.02,
        enter_probability: float = 0.8,
        leave_probability: float = 0.5,
    ) -> None:
        if not _UNIFORM < stay_probability < 1:
            raise ConfigError("out of range", field="stay_probability", expected="1/3 to 1")
        if not (_UNIFORM < leave_probability <= enter_probability < 1 and enter_probability > 0.5):
            raise ConfigError(
                "out of order",
                field="enter_probability",
                expected="1/3 < leave_probability <= enter_probability < 1, and above 0.5",
            )
        if not (full_weight_s > 0 and 0 < max_weight <= 1):
            raise ConfigError(
                "out of range", field="max_weight", expected="0 to 1, and full_weight_s above 0"
            )
        if not 0 < min_likelihood < _UNIFORM:
            raise ConfigError("out of range", field="min_likelihood", expected="0 to 1/3")
        self._decay_per_s = -math.log((stay_probability - _UNIFORM) / (1 - _UNIFORM))
        self._full_weight_s, self._max_weight = full_weight_s, max_weight
        self._min_likelihood = min_likelihood
        self._enter_probability, self._leave_probability = enter_probability, leave_probability
        self._belief: NDArray[np.float64] = np.full(len(STATES), _UNIFORM)
        self._state: DoorState | None = None
        self._since_s = 0.0
        self._stamp_s: float | None = None

    def update(self, prediction: Prediction, stamp_s: float) -> FilteredState:
        """Add one frame.

        Args:
            prediction: prediction for the frame; without a state, or with invalid probabilities, it is no evidence.
            stamp_s: time of the frame, on any clock.

        Raises:
            ConfigError: the stamp is not finite.
        """
        if not math.isfinite(stamp_s):
            raise ConfigError(f"not a time: {stamp_s}", field="stamp_s", expected="seconds")
        if self._stamp_s is None or stamp_s < self._stamp_s:
            self._reset(stamp_s)
            self._stamp_s = stamp_s
        elapsed_s = stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        kept = math.exp(-self._decay_per_s * elapsed_s)
        belief = kept * self._belief + (1 - kept) / len(STATES)
        if prediction.is_evidence:
            belief = belief * self._likelihood(prediction, elapsed_s)
        self._belief = belief / belief.sum()
        state = self._next_state()
        if state != self._state:
            self._state, self._since_s = state, stamp_s
        probabilities = {name: float(p) for name, p in zip(STATES, self._belief, strict=True)}
        return FilteredState(self._state, probabilities, self._since_s)

    def _reset(self, stamp_s: float) -> None:
        self._belief = np.full(len(STATES), _UNIFORM)
        self._state = None
        self._since_s = stamp_s

    def _likelihood(self, prediction: Prediction, elapsed_s: float) -> NDArray[np.float64]:
        """Return (3,) factors by which a frame changes the belief."""
        given = prediction.probabilities or {str(prediction.state): 1.0}
        probabilities = np.array([given.get(state, 0.0) for state in STATES])
        weight = min(self._max_weight, elapsed_s / self._full_weight_s)
        bounded = (1 - len(STATES) * self._min_likelihood) * probabilities + self._min_likelihood
        likelihood: NDArray[np.float64] = bounded**weight
        return likelihood

    def _next_state(self) -> DoorState | None:
        likeliest = int(self._belief.argmax())
        if self._belief[likeliest] >= self._enter_probability:
            return DoorState.from_index(likeliest)
        if self._state is not None and self._belief[self._state.class_index] < self._leave_probability:
            return None
        return self._state
