# SPDX-License-Identifier: Apache-2.0
"""Manifest lines: every value reads back exactly, and errors name line and column."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from doorstate._files import read_csv, write_csv
from doorstate.errors import DatasetError
from doorstate.simulation.manifest import flatten, numbers, unflatten
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.row import Row

ROW = draw_rows(PRESETS["ogurob"], 0, 0)[0]
_metres, _degrees = st.floats(-1e4, 1e4), st.floats(-3600, 3600)


@example(x_m=0.0, angle=0.0, width=1.0, sample="\r")
@given(x_m=_metres, angle=_degrees, width=_metres, sample=st.text(st.characters(codec="utf-8"), max_size=12))
@settings(max_examples=80)
def test_every_row_reads_back(
    tmp_path_factory: pytest.TempPathFactory, x_m: float, angle: float, width: float, sample: str
) -> None:
    door = ROW.scene.door.model_copy(update={"opening_width_m": width, "hinge": "right"})
    changed = {
        "x_m": x_m,
        "opening_angle_deg": angle,
        "scene": ROW.scene.model_copy(update={"door": door}),
        "same_image_as": sample,
    }
    row = ROW.model_copy(update=changed)
    path = tmp_path_factory.mktemp("manifest") / "manifest.csv"
    write_csv(path, [flatten(row), flatten(ROW)])
    assert [unflatten(columns) for columns in read_csv(path)] == [row, ROW]


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_rows_of_all_presets_have_the_same_columns(preset: object) -> None:
    rows = draw_rows(preset, 0, 3)
    columns = flatten(rows[0])
    optional = ("other_doors", "bias.")
    assert [name for name in columns if not name.startswith(optional)] == list(flatten(ROW))
    assert ("other_doors" in columns) == bool(rows[0].other_doors)
    assert columns["camera.max_depth_m"] == "5.0"
    assert columns["camera.cx_px"] == ""
    assert [unflatten(flatten(row)) for row in rows] == rows


def test_additional_columns_are_ignored() -> None:
    assert unflatten(flatten(ROW) | {"region": "green", "note.text": "?"}) == ROW


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("x_m", None),
        ("x_m", "wide"),
        ("other_doors", "[{"),
        ("other_doors", '[{"opening": {}}]'),
        ("x_m", "nan"),
        ("state", "ajar"),
        ("camera.width", "broad"),
        ("camera.colour", "red"),
        ("scene", None),
        ("scene", "{"),
        ("scene", '{"door": {"hinge": "top"}}'),
        ("scene", '{"door": {"colour": "red"}}'),
    ],
)
def test_a_damaged_line_is_refused_with_its_column(column: str, value: str | None) -> None:
    columns = flatten(ROW)
    if value is None:
        del columns[column]
    else:
        columns[column] = value
    with pytest.raises(DatasetError) as refused:
        unflatten(columns)
    assert ROW.sample_id in str(refused.value)
    assert f"column {column}" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_additional_field_of_a_row_is_refused() -> None:
    with pytest.raises(ValueError, match="colour"):
        Row.model_validate(ROW.model_dump() | {"colour": "red"})


def test_missing_numbers_are_nan() -> None:
    values = numbers([{"x_m": "1.5"}, {"x_m": ""}, {}], "x_m")
    np.testing.assert_array_equal(values, [1.5, np.nan, np.nan])
