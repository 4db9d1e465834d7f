# SPDX-License-Identifier: Apache-2.0
"""The state of a door over time: a small Bayes filter that does not flicker, and waiting for a state to hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from doorstate.errors import ConfigError
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.types import STATES, DoorState, Points


@dataclass(frozen=True)
class FilteredState:
    """What a stream says of the door so far."""

    state: DoorState | None  # None: too little evidence for any
    probabilities: dict[str, float]  # by state; they sum to one
    since_s: float  # stamp from which on the state, or its absence, has held


class StateFilter:
    """Forward filter of a hidden Markov chain with three states; equations and defaults in docs/deployment.md.

    Between frames, probabilities decay towards uniform. A frame with a state multiplies them by its own
    probabilities to a power that grows with the time since the last frame, so that the answer does not depend on the
    frame rate; a frame without a state adds nothing. Stamps may be irregular; one before the last starts anew.

    Args:
        stay_per_s: probability that a door is in the same state a second later; chosen: forgets all in about 3 s
            without frames, as a person opens or closes a door in 1 to 2 s.
        evidence_s: time between frames that count in full; chosen: frames of a standing robot err alike.
        most_weight: of one frame, however long the last is ago; chosen: with `floor`, no one frame can
            bring a fresh filter to `enter`.
        floor: least probability that a frame can give a state; chosen: above the networks' error rate on simulated
            doors, and rules give zeros.
        enter: a state is taken on when its probability reaches this.
        leave: a state is given up, for None, when its probability falls below this.

    Raises:
        ConfigError: values that are no probabilities in this order.
    """

    def __init__(
        self,
        *,
        stay_per_s: float = 0.7,
        evidence_s: float = 0.3,
        most_weight: float = 0.5,
        floor: float = 0.02,
        enter: float = 0.8,
        leave: float = 0.5,
    ) -> None:
        uniform = 1 / len(STATES)
        if not (uniform < stay_per_s < 1 and uniform < leave <= enter < 1 and enter > 0.5):
            raise ConfigError("a filter needs 1/3 < stay_per_s < 1, 1/3 < leave <= enter < 1 and enter > 0.5")
        if not (evidence_s > 0 and 0 < most_weight <= 1 and 0 < floor < uniform):
            raise ConfigError("a filter needs evidence_s > 0, 0 < most_weight <= 1 and 0 < floor < 1/3")
        self._forgetting_per_s = -math.log((stay_per_s - uniform) / (1 - uniform))
        self._evidence_s, self._most_weight, self._floor = evidence_s, most_weight, floor
        self._enter, self._leave = enter, leave
        self._belief = np.full(len(STATES), uniform)
        self._state: DoorState | None = None
        self._stamp_s: float | None = None
        self._since_s = 0.0

    def update(self, prediction: Prediction, stamp_s: float) -> FilteredState:
        """Take in one frame.

        Args:
            prediction: of a network or a rule; its state None is no evidence.
            stamp_s: when the frame was taken, on any clock.

        Raises:
            ConfigError: the stamp is not finite.
        """
        if not math.isfinite(stamp_s):
            raise ConfigError(f"a frame's stamp must be a number of seconds, not {stamp_s}")
        if self._stamp_s is None or stamp_s < self._stamp_s:
            self._belief = np.full(len(STATES), 1 / len(STATES))
            self._state, self._since_s, self._stamp_s = None, stamp_s, stamp_s
        elapsed_s = stamp_s - self._stamp_s
        kept = math.exp(-self._forgetting_per_s * elapsed_s)
        self._belief = kept * self._belief + (1 - kept) / len(STATES)
        if prediction.state is not None:
            given = np.array([prediction.probabilities[state] for state in STATES])
            weight = min(self._most_weight, elapsed_s / self._evidence_s)
            self._belief = self._belief * ((1 - len(STATES) * self._floor) * given + self._floor) ** weight
        self._belief = self._belief / self._belief.sum()
        self._stamp_s = stamp_s
        likeliest = int(self._belief.argmax())
        state = self._state
        if self._belief[likeliest] >= self._enter:
            state = DoorState(likeliest)
        elif state is not None and self._belief[state] < self._leave:
            state = None
        if state != self._state:
            self._state, self._since_s = state, stamp_s
        named = {name: float(p) for name, p in zip(STATES, self._belief, strict=True)}
        return FilteredState(self._state, named, self._since_s)


class Holding:
    """For how long the filter and frame after frame have agreed on a state.

    Args:
        longest_gap_s: between frames with a state; after a longer one the holding begins anew. Chosen: at walking
            pace a robot goes half a metre in it.
    """

    def __init__(self, longest_gap_s: float = 0.5) -> None:
        self._longest_gap_s = longest_gap_s
        self._seen_s = -math.inf  # the last frame with a state
        self._unbroken_s = 0.0  # from then on frames with a state came without a gap

    def update(self, prediction: Prediction, filtered: FilteredState, stamp_s: float) -> float | None:
        """Take in one frame and what the filter says after it.

        Returns:
            Seconds for which the filter's state has held, or None if this frame has another one or none.
        """
        if prediction.state is None:
            return None
        if not 0 <= stamp_s - self._seen_s <= self._longest_gap_s:
            self._unbroken_s = stamp_s
        self._seen_s = stamp_s
        if filtered.state != prediction.state:
            return None
        return stamp_s - max(filtered.since_s, self._unbroken_s)


def wait_for(
    state: DoorState | str,
    stream: Iterable[tuple[float, Points | Prediction]],
    timeout_s: float,
    hold_s: float = 1.0,
    *,
    predictor: Callable[[Points], Prediction] | None = None,
    state_filter: StateFilter | None = None,
    longest_gap_s: float = 0.5,
) -> bool:
    """Whether the door comes to be in a state, and stays in it for a while, before the time is up.

    Time is that of the stamps, so that a recording gives the answer of the live stream; where frames may stop coming,
    let the iterator end. True is said at a frame that has the state itself, never at one without a state.

    Args:
        state: such as "open".
        stream: (stamp in seconds, cloud or prediction), in the order taken; read no further than needed.
        timeout_s: from the first stamp on.
        hold_s: how long the filtered state must have held.
        predictor: of clouds; the packaged weights if not given.
        state_filter: with other parameters than the default, or a past.
        longest_gap_s: as of `Holding`.

    Raises:
        ConfigError: no such state, seconds below zero, or a stamp that is not finite.
        CloudContentError: as of the predictor.
    """
    wanted = DoorState[state.upper()] if isinstance(state, str) and state in STATES else state
    if not isinstance(wanted, DoorState):
        raise ConfigError(f"no state {state!r}: there are {', '.join(STATES)}")
    if not (timeout_s >= 0 and hold_s >= 0):
        raise ConfigError(f"timeout_s {timeout_s} and hold_s {hold_s}: both are seconds, zero or more")
    state_filter = state_filter or StateFilter()
    holding = Holding(longest_gap_s)
    last_s: float | None = None
    waited_s = 0.0
    for stamp_s, frame in stream:
        if isinstance(frame, Prediction):
            prediction = frame
        else:
            predictor = predictor or Predictor.load()
            prediction = predictor(frame)
        filtered = state_filter.update(prediction, stamp_s)
        waited_s += max(0.0, stamp_s - last_s) if last_s is not None else 0.0
        last_s = stamp_s
        if waited_s > timeout_s:
            return False
        held_s = holding.update(prediction, filtered, stamp_s)
        if prediction.state == wanted and held_s is not None and held_s >= hold_s:
            return True
    return False
