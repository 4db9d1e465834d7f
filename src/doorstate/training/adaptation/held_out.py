# SPDX-License-Identifier: Apache-2.0
"""Frames to train on and frames to test on: whole doors, or else moments, and a refusal of data that cannot teach."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from doorstate.errors import DatasetError
from doorstate.types import STATES

FEWEST_FRAMES = 5
FEWEST_TO_HOLD_OUT = 10  # fewer are all needed for training
_SHARE = 0.25  # of the frames, at least, is held out
_GROUPS = ("door", "moment")  # columns by which frames depend on each other


def check_labels(states: Iterable[str], what: str = "labelled frames") -> None:
    """Check that every state is there.

    Args:
        states: labels.
        what: name of the things that are labelled.

    Raises:
        DatasetError: there are too few, or a state is missing.
    """
    counts = Counter(state for state in states if state in STATES)
    number = counts.total()
    if number < FEWEST_FRAMES:
        raise DatasetError(
            f"{number} {what} with the state of a door", expected=f"{FEWEST_FRAMES} or more, of all states"
        )
    missing = [state.replace("_", "-") for state in STATES if not counts[state]]
    if missing:
        raise DatasetError(
            f"no {' and no '.join(missing)} door among {number} {what}",
            field="state",
            hint="record and label some of each state",
        )


def hold_out(frames: Sequence[Mapping[str, str]]) -> list[bool]:
    """Return for each frame True if it is held out: about a quarter, so that training keeps every state.

    Whole doors are held out if the frames name several, or else whole moments; otherwise the last frames of each state
    in their order, which is that of time. None are held out of fewer than 10 frames.

    Args:
        frames: columns of each frame, `state` among them.
    """
    if len(frames) < FEWEST_TO_HOLD_OUT:
        return [False] * len(frames)
    for column in _GROUPS:
        names = [frame.get(column, "") for frame in frames]
        if all(names) and len(set(names)) > 1:
            chosen = _groups_to_hold_out(names, [frame["state"] for frame in frames])
            if chosen:
                return [name in chosen for name in names]
    last: list[bool] = [False] * len(frames)
    for state in {frame["state"] for frame in frames}:
        own = [number for number, frame in enumerate(frames) if frame["state"] == state]
        for number in own[len(own) - int(_SHARE * len(own)) :]:
            last[number] = True
    return last


def _groups_to_hold_out(names: Sequence[str], states: Sequence[str]) -> set[str]:
    """Return groups with the least share of frames that is enough; none if training would lose a state."""
    sizes = Counter(names)
    needed = {state for state in states if state in STATES}
    chosen: set[str] = set()
    while sum(sizes[name] for name in chosen) < _SHARE * len(names):
        allowed = [
            name
            for name in sorted(set(names) - chosen)
            if needed
            <= {state for own, state in zip(names, states, strict=True) if own not in chosen | {name}}
        ]
        if not allowed:
            return chosen
        missing = _SHARE * len(names) - sum(sizes[name] for name in chosen)
        chosen.add(min(allowed, key=lambda name: (sizes[name] < missing, abs(sizes[name] - missing), name)))
    return chosen
