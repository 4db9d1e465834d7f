# SPDX-License-Identifier: Apache-2.0
"""Rough places of known doors, from Python and from text."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.errors import ConfigError
from doorstate.inference.known import USUAL_WIDTH_M, DoorHint, ImageBox, Known, door_known

_METRES = st.floats(0.1, 10)


@given(x_m=_METRES, y_m=_METRES, yaw_deg=st.floats(-180, 180), width_m=st.floats(0.5, 2.4))
def test_poses_are_read_as_they_are_written(x_m: float, y_m: float, yaw_deg: float, width_m: float) -> None:
    expected = DoorHint(x_m, y_m, yaw_deg, width_m)
    for text in (f"{x_m} {y_m} {yaw_deg} {width_m}", f"[{x_m}, {y_m},{yaw_deg}, {width_m}]"):
        assert DoorHint.parse(text) == expected
    assert DoorHint.parse(f"{x_m},{y_m}") == DoorHint(x_m, y_m, None, USUAL_WIDTH_M)


def test_boxes_are_read_in_pixels() -> None:
    assert DoorHint.parse(box="100, 20, 300, 470.4") == DoorHint(box=ImageBox(100, 20, 300, 470))


@pytest.mark.parametrize(
    ("pose", "box", "field"),
    [
        ("1", None, "door_pose"),
        ("1 2 3 4 5", None, "door_pose"),
        ("ahead", None, "door_pose"),
        ("nan 1", None, "door_pose"),
        ("0 0", None, "door_pose"),
        ("300 0", None, "door_pose"),
        ("2 0 90 9", None, "door_pose"),
        (None, "1 2 3", "door_box"),
        (None, "9 0 3 4", "door_box"),
        (None, "-1 0 3 4", "door_box"),
        ("2 0", "1 2 3 4", "door_pose"),
    ],
)
def test_other_texts_are_errors(pose: str | None, box: str | None, field: str) -> None:
    with pytest.raises(ConfigError) as caught:
        DoorHint.parse(pose, box)
    assert caught.value.field == field


@given(st.text(max_size=40))
def test_any_text_is_a_place_or_an_error(text: str) -> None:
    for arguments in ({"pose": text}, {"box": text}):
        try:
            hint = DoorHint.parse(**arguments)
        except ConfigError:
            continue
        assert hint.box is not None or math.isfinite(hint.distance_m)


def test_a_hint_is_a_pose_or_a_box() -> None:
    for wrong in (
        lambda: DoorHint(),
        lambda: DoorHint(1.0),
        lambda: DoorHint(1.0, 2.0, box=ImageBox(0, 0, 1, 1)),
    ):
        with pytest.raises(ConfigError):
            wrong()


def test_a_place_says_that_the_door_is_known() -> None:
    assert door_known(False) is False
    assert Known(door_known(True)).has_door
    hint = door_known(False, "2 0.5")
    assert Known(hint).has_door
    assert Known(hint).hint == DoorHint(2.0, 0.5)
    assert Known(True).hint is None
