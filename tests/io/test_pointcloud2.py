# SPDX-License-Identifier: Apache-2.0
"""PointCloud2 messages made with NumPy record arrays; contradictory messages."""

from __future__ import annotations

from array import array
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from doorstate.errors import CloudReadError
from doorstate.io.pointcloud2 import points_from_pointcloud2
from tests.hand_made_clouds import image_of_a_rough_wall

DATATYPES = {"f4": 7, "f8": 8, "u1": 2}  # sensor_msgs/PointField


class Field(NamedTuple):
    name: str
    offset: int
    datatype: int
    count: int = 1


PACKED = [Field("x", 0, 7), Field("y", 4, 7), Field("z", 8, 7)]
MESSAGE: dict[str, Any] = {
    "height": 2,
    "width": 3,
    "fields": PACKED,
    "is_bigendian": False,
    "point_step": 12,
    "row_step": 36,
    "data": np.arange(18, dtype="<f4").tobytes(),
}


@st.composite
def messages(draw: st.DrawFn) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Message with its values, at random offsets with random bytes between them."""
    height, width = draw(st.integers(1, 4)), draw(st.integers(1, 5))
    order = draw(st.sampled_from("<>"))
    place, fields, formats = 0, [], []
    for name in draw(st.permutations(["x", "y", "z", "ring"])):
        place += draw(st.integers(0, 5))
        kind = "u1" if name == "ring" else draw(st.sampled_from(["f4", "f8"]))
        fields.append(Field(name, place, DATATYPES[kind], draw(st.sampled_from([1, 1, 0]))))  # 0: left out
        formats.append(order + kind)
        place += np.dtype(kind).itemsize
    point_step = place + draw(st.integers(0, 5))
    row_step = width * point_step + draw(st.integers(0, 7))
    rubbish = draw(st.binary(min_size=1, max_size=8))
    data = np.resize(np.frombuffer(rubbish, np.uint8), height * row_step + draw(st.integers(0, 3)))
    names, offsets = [field.name for field in fields], [field.offset for field in fields]
    record = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": point_step})
    values = draw(npst.arrays(np.float32, (height, width, 3), elements=st.floats(width=32, allow_nan=True)))
    for row in range(height):
        start = row * row_step
        points = data[start : start + width * point_step].view(record)
        for axis, name in enumerate("xyz"):
            points[name] = values[row, :, axis]
    message = {
        "height": height,
        "width": width,
        "fields": fields,
        "is_bigendian": order == ">",
        "point_step": point_step,
        "row_step": row_step,
        "data": draw(st.sampled_from([data, data.tobytes(), array("B", data.tobytes())])),
    }
    return message, values


@given(drawn=messages())
@settings(max_examples=200)
def test_every_layout_gives_its_points(drawn: tuple[dict[str, Any], NDArray[np.float64]]) -> None:
    message, values = drawn
    points = points_from_pointcloud2(**message)
    assert points.dtype == np.float32
    assert points.shape == (values.shape if message["height"] > 1 else values.shape[1:])
    np.testing.assert_array_equal(points.reshape(values.shape), values)


def test_points_are_a_copy_that_outlives_the_message() -> None:
    data = np.frombuffer(MESSAGE["data"], np.uint8).copy()
    points = points_from_pointcloud2(**MESSAGE | {"data": data})
    data[:] = 255
    np.testing.assert_array_equal(points.ravel(), np.arange(18))


def test_doubles_beyond_float32_are_infinite() -> None:
    fields = [Field("x", 0, 8), Field("y", 8, 8), Field("z", 16, 8)]
    data = np.array([1e300, -1e300, 0.1]).tobytes()
    message = MESSAGE | {
        "height": 1,
        "width": 1,
        "fields": fields,
        "point_step": 24,
        "row_step": 24,
        "data": data,
    }
    np.testing.assert_array_equal(points_from_pointcloud2(**message), np.float32([[np.inf, -np.inf, 0.1]]))


@pytest.mark.parametrize("row_step", [0, 12, 35, 37, 10**9])
def test_points_that_fill_the_data_are_read_with_a_wrong_row_step(row_step: int) -> None:
    np.testing.assert_array_equal(
        points_from_pointcloud2(**MESSAGE | {"row_step": row_step}), points_from_pointcloud2(**MESSAGE)
    )


@pytest.mark.parametrize("extent", [(0, 0), (1, 0), (2**32 - 1, 0), (0, 2**32 - 1)])
def test_no_points_are_an_empty_cloud(extent: tuple[int, int]) -> None:
    message = MESSAGE | {"height": extent[0], "width": extent[1], "row_step": 0, "data": b""}
    assert points_from_pointcloud2(**message).shape == (0, 3)


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"fields": []}, "has the fields none"),
        ({"fields": PACKED[:2]}, "has the fields x y"),
        ({"fields": [*PACKED[:2], Field("z", 8, 6)]}, "1 values of datatype 6 as z"),
        ({"fields": [*PACKED[:2], Field("z", 8, 7, 2)]}, "2 values of datatype 7 as z"),
        ({"fields": [Field("x", 0, 7, 3), *PACKED[1:]]}, "3 values of datatype 7 as x"),
        ({"fields": [*PACKED[:2], Field("z", 9, 7)]}, "z at byte 9 is not within 12 bytes"),
        ({"fields": [*PACKED[:2], Field("z", 8, 8)]}, "z at byte 8 is not within 12 bytes"),
        ({"fields": [Field("x", -1, 7), *PACKED[1:]]}, "x at byte -1 is not within 12 bytes"),
        ({"point_step": 0}, "not within 0 bytes a point"),
        ({"row_step": 0, "data": MESSAGE["data"] + b"x"}, "3 points of 12 bytes do not fit into rows of 0"),
        ({"row_step": 35, "data": MESSAGE["data"] + b"x"}, "do not fit into rows of 35"),
        ({"data": MESSAGE["data"][:-1]}, "is truncated: 72 bytes are declared, 71 are there"),
        ({"data": b""}, "is truncated: 72 bytes are declared, 0 are there"),
        ({"height": 2**32 - 1}, "not one camera frame"),
        ({"height": 2**32 - 1, "width": 2**32 - 1, "row_step": 2**36}, "not one camera frame"),
        ({"height": -1}, "is damaged: -1 x 3 points"),
        ({"height": -1, "width": -1}, "is damaged"),
        ({"point_step": -12}, "in steps of -12"),
    ],
)
def test_contradictory_messages_are_read_errors(wrong: dict[str, Any], reason: str) -> None:
    with pytest.raises(CloudReadError) as caught:
        points_from_pointcloud2(**MESSAGE | wrong)
    assert reason in str(caught.value)
    assert str(caught.value).isprintable()


def test_shuffled_points_of_an_image_are_unorganized() -> None:
    wall = image_of_a_rough_wall(60, 80)
    message = MESSAGE | {"height": 60, "width": 80, "row_step": 960}
    np.testing.assert_array_equal(points_from_pointcloud2(**message | {"data": wall.tobytes()}), wall)
    shuffled = np.random.default_rng(0).permutation(wall.reshape(-1, 3))
    np.testing.assert_array_equal(points_from_pointcloud2(**message | {"data": shuffled.tobytes()}), shuffled)
