# SPDX-License-Identifier: Apache-2.0
"""Prepared folders open as written, and damaged ones are refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.description import DESCRIPTION_FILE
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, open_dataset
from doorstate.errors import DatasetError
from doorstate.simulation.manifest import MANIFEST_FILE
from doorstate.types import STATES


def test_rows_clouds_and_labels_have_the_same_order(prepared: Path) -> None:
    dataset = open_dataset(prepared)
    assert (len(dataset), dataset.num_points) == (11, 40)
    assert [STATES[label] for label in dataset.labels] == [row["state"] for row in dataset.rows]
    stored = np.load(prepared / CLOUDS_FILE)
    for index, row in enumerate(dataset.rows):
        assert dataset.index_of(row["sample_id"]) == index
        np.testing.assert_array_equal(dataset.cloud(index), stored[index])
    assert dataset.parts(0) is None
    assert dataset.image(0) is None


def test_a_pipe_in_place_of_the_clouds_is_refused(prepared: Path) -> None:
    path = prepared / CLOUDS_FILE
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(DatasetError) as caught:
        open_dataset(prepared)
    assert caught.value.path == path


def test_a_cloud_is_a_copy(prepared: Path) -> None:
    dataset = open_dataset(prepared)
    dataset.cloud(0)[:] = 0
    assert dataset.cloud(0).min() >= 1


def test_an_unknown_sample_is_refused(prepared: Path) -> None:
    with pytest.raises(DatasetError, match="s11"):
        open_dataset(prepared).index_of("s11")


def test_parts_are_read_if_they_are_stored(prepared: Path) -> None:
    parts = np.arange(440, dtype=np.uint16).reshape(11, 40).astype(np.uint8)
    np.save(prepared / PARTS_FILE, parts)
    np.testing.assert_array_equal(open_dataset(prepared).parts(3), parts[3])


def truncate(path: Path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:size])


def drop_last_line(path: Path) -> None:
    path.write_text("".join(path.read_text(encoding="utf-8").splitlines(True)[:-1]), encoding="utf-8")


def replace(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize(
    ("damage", "name", "field"),
    [
        (lambda folder: (folder / DESCRIPTION_FILE).unlink(), "", None),
        (lambda folder: truncate(folder / DESCRIPTION_FILE, 30), DESCRIPTION_FILE, None),
        (lambda folder: replace(folder / DESCRIPTION_FILE, "imported", "guessed"), DESCRIPTION_FILE, None),
        (lambda folder: (folder / DESCRIPTION_FILE).write_bytes(b"\xff\xff"), DESCRIPTION_FILE, None),
        (lambda folder: (folder / CLOUDS_FILE).unlink(), "", None),
        (lambda folder: truncate(folder / CLOUDS_FILE, 0), "", None),
        (lambda folder: truncate(folder / CLOUDS_FILE, 60), "", None),
        (lambda folder: truncate(folder / CLOUDS_FILE, 1000), "", None),
        (lambda folder: (folder / CLOUDS_FILE).write_bytes(b"no array at all"), "", None),
        (lambda folder: np.save(folder / CLOUDS_FILE, np.zeros((11, 39, 3), np.float32)), CLOUDS_FILE, None),
        (lambda folder: np.save(folder / CLOUDS_FILE, np.zeros((11, 40, 3))), CLOUDS_FILE, None),
        (lambda folder: np.save(folder / PARTS_FILE, np.zeros((11, 39), np.uint8)), PARTS_FILE, None),
        (lambda folder: truncate(folder / PARTS_FILE, 0), "", None),
        (lambda folder: (folder / MANIFEST_FILE).unlink(), "", None),
        (lambda folder: drop_last_line(folder / MANIFEST_FILE), MANIFEST_FILE, None),
        (lambda folder: replace(folder / MANIFEST_FILE, "sample_id", "sample"), MANIFEST_FILE, "sample_id"),
        (lambda folder: replace(folder / MANIFEST_FILE, "state", "status"), MANIFEST_FILE, "state"),
        (lambda folder: replace(folder / MANIFEST_FILE, "semi_open", "ajar"), MANIFEST_FILE, "state"),
    ],
)
def test_a_damaged_folder_is_refused_with_its_file(
    prepared: Path, damage: Callable[[Path], None], name: str, field: str | None
) -> None:
    np.save(prepared / PARTS_FILE, np.zeros((11, 40), np.uint8))
    open_dataset(prepared)
    damage(prepared)
    with pytest.raises(DatasetError) as refused:
        open_dataset(prepared)
    assert refused.value.path == (prepared / name if name else prepared)
    assert refused.value.field == field
    assert "\n" not in str(refused.value)
