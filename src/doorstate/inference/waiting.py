# SPDX-License-Identifier: Apache-2.0
"""Wait until a door is in a state, and has been for a while."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from doorstate.errors import ConfigError, unknown_name
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.state_filter import FilteredState, StateFilter
from doorstate.types import STATES, DoorState, Points


class HoldTimer:
    """Time for which the filter and frame after frame have agreed on a state.

    Args:
        max_gap_s: between frames with a state; a longer gap restarts the time. Chosen: at walking pace a robot goes
            half a metre in it.
    """

    def __init__(self, max_gap_s: float = 0.5) -> None:
        self._max_gap_s = max_gap_s
        self._last_s = -math.inf  # the last frame with a state
        self._start_s = 0.0  # of the frames with a state without a gap

    def update(self, prediction: Prediction, filtered: FilteredState, stamp_s: float) -> float | None:
        """Add one frame and the filtered state after it.

        Returns:
            Seconds for which the filter's state has held, or None if this frame has another state or none.
        """
        if not prediction.is_evidence:
            return None
        if not 0 <= stamp_s - self._last_s <= self._max_gap_s:
            self._start_s = stamp_s
        self._last_s = stamp_s
        if filtered.state != prediction.state:
            return None
        return stamp_s - max(filtered.since_s, self._start_s)


def wait_for(
    state: DoorState | str,
    stream: Iterable[tuple[float, Points | Prediction]],
    timeout_s: float,
    hold_s: float = 1.0,
    *,
    predictor: Callable[[Points], Prediction] | None = None,
    state_filter: StateFilter | None = None,
    require_leaf: bool = True,
    max_gap_s: float = 0.5,
) -> bool:
    """Return True when a door is in a state and has been for a while, False when the time is up.

    Of several doors in a cloud, it is the one most in front.

    Time is that of the stamps, so that a recording gives the result of the live stream. If frames may stop coming, end
    the iterator. A frame without a state never ends the waiting with True.

    Args:
        state: state to wait for, such as "open".
        stream: (stamp in seconds, cloud or prediction), in order; it is read no further than needed.
        timeout_s: longest time from the first stamp on.
        hold_s: time for which the filtered state must have held.
        predictor: method for clouds; None loads the packaged weights.
        state_filter: filter to use, with other parameters or earlier frames; None makes a new one.
        require_leaf: wait on if no leaf was seen at an open door, because a pane of glass cannot be excluded. Methods
            that do not look for one (`Prediction.leaf_seen` is None) are not concerned.
        max_gap_s: longest gap between frames with a state (`HoldTimer`).

    Raises:
        ConfigError: no such state, negative seconds, or a stamp that is not finite.
        CloudContentError: as in `Predictor.__call__`.
    """
    target = _parse_state(state)
    for field, seconds in (("timeout_s", timeout_s), ("hold_s", hold_s)):
        if not seconds >= 0:
            raise ConfigError(f"not a duration: {seconds}", field=field, expected="seconds, zero or more")
    state_filter = state_filter or StateFilter()
    timer = HoldTimer(max_gap_s)
    last_s: float | None = None
    waited_s = 0.0
    for stamp_s, frame in stream:
        if isinstance(frame, Prediction):
            prediction = frame
        else:
            predictor = predictor or Predictor.load()
            prediction = predictor(frame)
        filtered = state_filter.update(prediction, stamp_s)
        # Stamps that go back, such as those of a recording in a loop, add no time.
        waited_s += max(0.0, stamp_s - last_s) if last_s is not None else 0.0
        last_s = stamp_s
        if waited_s > timeout_s:
            return False
        held_s = timer.update(prediction, filtered, stamp_s)
        has_held = held_s is not None and held_s >= hold_s
        if has_held and prediction.confirms(target, require_leaf=require_leaf):
            return True
    return False


def _parse_state(state: DoorState | str) -> DoorState:
    try:
        return DoorState(state)
    except ValueError as error:
        raise unknown_name("state", state, STATES, field="state") from error
