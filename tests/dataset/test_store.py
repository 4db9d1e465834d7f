# SPDX-License-Identifier: Apache-2.0
"""Prepared folders open as written, and damaged ones are refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.store import CLOUDS, DESCRIPTION, MANIFEST, PARTS, open_dataset
from doorstate.errors import DatasetError
from doorstate.types import STATES


def test_rows_clouds_and_labels_have_the_same_order(prepared: Path) -> None:
    dataset = open_dataset(prepared)
    assert (len(dataset), dataset.num_points) == (11, 40)
    assert [STATES[label] for label in dataset.labels] == [row["state"] for row in dataset.rows]
    stored = np.load(prepared / CLOUDS)
    for index, row in enumerate(dataset.rows):
        assert dataset.index_of(row["sample_id"]) == index
        np.testing.assert_array_equal(dataset.cloud(index), stored[index])
    assert dataset.parts(0) is None
    assert dataset.image(0) is None


def test_a_cloud_is_a_copy(prepared: Path) -> None:
    dataset = open_dataset(prepared)
    dataset.cloud(0)[:] = 0
    assert dataset.cloud(0).min() >= 1


def test_an_unknown_sample_is_refused(prepared: Path) -> None:
    with pytest.raises(DatasetError, match="s11"):
        open_dataset(prepared).index_of("s11")


def test_parts_are_read_if_they_are_stored(prepared: Path) -> None:
    parts = np.arange(440, dtype=np.uint16).reshape(11, 40).astype(np.uint8)
    np.save(prepared / PARTS, parts)
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
        (lambda folder: (folder / DESCRIPTION).unlink(), "", None),
        (lambda folder: truncate(folder / DESCRIPTION, 30), DESCRIPTION, None),
        (lambda folder: replace(folder / DESCRIPTION, "imported", "guessed"), DESCRIPTION, None),
        (lambda folder: (folder / DESCRIPTION).write_bytes(b"\xff\xff"), "", None),
        (lambda folder: (folder / CLOUDS).unlink(), "", None),
        (lambda folder: truncate(folder / CLOUDS, 0), "", None),
        (lambda folder: truncate(folder / CLOUDS, 60), "", None),
        (lambda folder: truncate(folder / CLOUDS, 1000), "", None),
        (lambda folder: (folder / CLOUDS).write_bytes(b"no array at all"), "", None),
        (lambda folder: np.save(folder / CLOUDS, np.zeros((11, 39, 3), np.float32)), CLOUDS, None),
        (lambda folder: np.save(folder / CLOUDS, np.zeros((11, 40, 3))), CLOUDS, None),
        (lambda folder: np.save(folder / PARTS, np.zeros((11, 39), np.uint8)), PARTS, None),
        (lambda folder: truncate(folder / PARTS, 0), "", None),
        (lambda folder: (folder / MANIFEST).unlink(), "", None),
        (lambda folder: drop_last_line(folder / MANIFEST), MANIFEST, None),
        (lambda folder: replace(folder / MANIFEST, "sample_id", "sample"), MANIFEST, "sample_id"),
        (lambda folder: replace(folder / MANIFEST, "state", "status"), MANIFEST, "state"),
        (lambda folder: replace(folder / MANIFEST, "semi_open", "ajar"), MANIFEST, "state"),
    ],
)
def test_a_damaged_folder_is_refused_with_its_file(
    prepared: Path, damage: Callable[[Path], None], name: str, field: str | None
) -> None:
    np.save(prepared / PARTS, np.zeros((11, 40), np.uint8))
    open_dataset(prepared)
    damage(prepared)
    with pytest.raises(DatasetError) as refused:
        open_dataset(prepared)
    assert refused.value.path == (prepared / name if name else prepared)
    assert refused.value.field == field
    assert "\n" not in str(refused.value)
