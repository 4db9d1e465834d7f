# SPDX-License-Identifier: Apache-2.0
"""Manifest as a frame: numbers by the unit in the name, empty fields missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate._files import write_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import DatasetError
from doorstate.evaluation.manifest import manifest_frame, number_values, read_manifest, text_values

ROWS = [
    {"sample_id": "1", "state": "open", "distance_m": "2.5", "region": "red", "scene_id": "007"},
    {"sample_id": "2", "state": "closed", "distance_m": "", "region": "", "scene_id": "008"},
]


def test_columns_with_a_unit_are_numbers() -> None:
    frame = manifest_frame(ROWS)
    assert frame.index.tolist() == ["1", "2"]
    assert frame["distance_m"].dtype == "float64"
    assert frame["distance_m"].isna().tolist() == [False, True]
    assert frame["scene_id"].tolist() == ["007", "008"]
    assert text_values(frame, "region").tolist() == ["red", ""]


def test_absent_columns_are_missing_throughout() -> None:
    frame = manifest_frame(ROWS)
    assert number_values(frame, "camera_height_m").isna().all()
    assert text_values(frame, "sensor").tolist() == ["", ""]


def test_numbers_are_read_exactly(simulated: PreparedDataset) -> None:
    frame = read_manifest(simulated.folder)
    assert frame["opening_angle_deg"].tolist() == [float(row["opening_angle_deg"]) for row in simulated.rows]
    assert frame["same_image_as"].notna().sum() == 2


@pytest.mark.parametrize("name", ["manifest.csv", "manifest.csv.gz"])
def test_damage_is_an_error_with_its_path(tmp_path: Path, name: str) -> None:
    write_csv(tmp_path / name, [ROWS[0] | {"distance_m": "far"}])
    with pytest.raises(DatasetError) as raised:
        read_manifest(tmp_path)
    assert raised.value.path == tmp_path / name


def test_a_required_column_is_named() -> None:
    with pytest.raises(DatasetError) as raised:
        manifest_frame([{"sample_id": "1"}])
    assert raised.value.field == "state"
