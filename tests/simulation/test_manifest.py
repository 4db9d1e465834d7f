# SPDX-License-Identifier: Apache-2.0
"""Manifest lines: every number comes back exactly, and a damaged line is named."""

from __future__ import annotations

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from doorstate._files import read_csv, write_csv
from doorstate.errors import DatasetError
from doorstate.simulation.generate import PRESETS, SampleRow, draw_pose
from doorstate.simulation.manifest import flatten, unflatten

ROW = draw_pose(PRESETS["ogurob"], 0, 0)[0]
_finite = st.floats(allow_nan=False, allow_infinity=False)


@example(x_m=0.0, angle=0.0, width=1.0, sample="\r")
@given(x_m=_finite, angle=_finite, width=_finite, sample=st.text(st.characters(codec="utf-8"), max_size=12))
@settings(deadline=None, max_examples=80)
def test_every_row_comes_back(
    tmp_path_factory: pytest.TempPathFactory, x_m: float, angle: float, width: float, sample: str
) -> None:
    door = ROW.door.model_copy(update={"opening_width_m": width, "hinge": "right"})
    row = ROW.model_copy(
        update={"x_m": x_m, "opening_angle_deg": angle, "door": door, "same_image_as": sample}
    )
    path = tmp_path_factory.mktemp("manifest") / "manifest.csv"
    write_csv(path, [flatten(row), flatten(ROW)])
    assert [unflatten(columns) for columns in read_csv(path)] == [row, ROW]


def test_nested_settings_are_columns_of_their_own() -> None:
    columns = flatten(ROW)
    assert columns["door.swing"] == "towards"
    assert columns["camera.max_depth_m"] == "5.0"
    assert list(columns)[:3] == ["sample_id", "pose_id", "state"]


def test_columns_of_others_are_left_out() -> None:
    assert unflatten(flatten(ROW) | {"region": "green", "note.text": "?"}) == ROW


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("x_m", None),
        ("x_m", "wide"),
        ("x_m", "nan"),
        ("state", "ajar"),
        ("door.hinge", "top"),
        ("door.colour", "red"),
    ],
)
def test_a_damaged_line_is_named_in_one_line(column: str, value: str | None) -> None:
    columns = flatten(ROW)
    if value is None:
        del columns[column]
    else:
        columns[column] = value
    with pytest.raises(DatasetError) as caught:
        unflatten(columns)
    assert f"manifest line {ROW.sample_id}, column {column}: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_extra_field_of_a_row_is_refused() -> None:
    with pytest.raises(ValueError, match="colour"):
        SampleRow.model_validate(ROW.model_dump() | {"colour": "red"})
