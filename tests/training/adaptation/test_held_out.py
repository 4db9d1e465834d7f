# SPDX-License-Identifier: Apache-2.0
"""Frames that are held out, and data that are refused."""

from __future__ import annotations

import pytest

from doorstate.errors import DatasetError
from doorstate.training.adaptation.held_out import check_labels, hold_out
from doorstate.types import STATES


def frames(count: int, **columns: list[str]) -> list[dict[str, str]]:
    """Return frames whose states take turns."""
    return [
        {"state": STATES[number % 3], **{name: values[number] for name, values in columns.items()}}
        for number in range(count)
    ]


def held_out(lines: list[dict[str, str]]) -> list[dict[str, str]]:
    return [line for line, is_out in zip(lines, hold_out(lines), strict=True) if is_out]


def test_too_few_frames_and_missing_states_are_refused() -> None:
    check_labels(["closed", "semi_open", "open", "open", "closed"])
    with pytest.raises(DatasetError, match=r"4 labelled frames"):
        check_labels(["closed", "semi_open", "open", "open", "no_door", "unknown"])
    with pytest.raises(DatasetError, match=r"no open door among 14 labelled frames") as refused:
        check_labels(["closed"] * 7 + ["semi_open"] * 7)
    assert refused.value.field == "state"
    with pytest.raises(DatasetError, match=r"no semi-open and no open door among 5 clouds"):
        check_labels(["closed"] * 5, "clouds")


def test_whole_doors_are_held_out() -> None:
    lines = frames(24, door=[f"d{number // 6}" for number in range(24)], moment=["m"] * 24)
    out = held_out(lines)
    assert len({line["door"] for line in out}) == 1
    assert len(out) == 6
    assert hold_out(lines) == hold_out(lines)


def test_a_door_that_alone_shows_a_state_is_kept() -> None:
    lines = [
        {"state": state, "door": door}
        for door, states in {"a": ["closed", "semi_open"] * 3, "b": ["open"] * 6}.items()
        for state in states
    ]
    # Neither door can be spared, so that the last frames of each state are held out.
    assert [line["state"] for line in held_out(lines)] == ["open"]
    spare = [*lines, *({"state": state, "door": "c"} for state in STATES)]
    assert {line["door"] for line in held_out(spare)} == {"a"}


def test_moments_are_held_out_where_no_doors_are_named() -> None:
    lines = frames(12, door=[""] * 12, moment=[f"m{number // 3}" for number in range(12)])
    assert len({line["moment"] for line in held_out(lines)}) == 1
    assert len(held_out(lines)) == 3


def test_the_last_frames_of_each_state_are_held_out_otherwise() -> None:
    assert [number for number, is_out in enumerate(hold_out(frames(24))) if is_out] == list(range(18, 24))


def test_few_frames_are_all_trained_on() -> None:
    assert not any(hold_out(frames(9, door=[f"d{number}" for number in range(9)])))
