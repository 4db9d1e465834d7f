# SPDX-License-Identifier: Apache-2.0
"""A prepared folder opens as it was written, and a damaged one says what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from doorstate._files import write_csv
from doorstate.dataset.store import CLOUDS, DESCRIPTION, MANIFEST, PARTS, open_dataset
from doorstate.errors import DatasetError
from doorstate.types import STATES


def test_rows_clouds_and_labels_are_in_one_order(prepared: Path) -> None:
    dataset = open_dataset(prepared)
    assert (len(dataset), dataset.num_points) == (11, 40)
    assert [STATES[label] for label in dataset.labels] == [row["state"] for row in dataset.rows]
    stored = np.load(prepared / CLOUDS)
    for index, row in enumerate(dataset.rows):
        assert dataset.index_of(row["sample_id"]) == index
        np.testing.assert_array_equal(dataset.cloud(index), stored[index])
    assert dataset.parts(0) is None
    assert dataset.image(0) is None


def test_a_cloud_is_a_copy_that_may_be_changed(prepared: Path) -> None:
    dataset = open_dataset(prepared)
    dataset.cloud(0)[:] = 0
    assert dataset.cloud(0).min() >= 1


def test_an_unknown_sample_is_named(prepared: Path) -> None:
    with pytest.raises(DatasetError, match="holds no sample 's11'"):
        open_dataset(prepared).index_of("s11")


def test_parts_are_read_where_they_are_known(prepared: Path) -> None:
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
    ("damage", "message"),
    [
        (lambda folder: (folder / DESCRIPTION).unlink(), "no prepared data set here; make one with"),
        (lambda folder: truncate(folder / DESCRIPTION, 30), r"dataset\.json: "),
        (lambda folder: replace(folder / DESCRIPTION, "imported", "guessed"), r"dataset\.json: "),
        (lambda folder: (folder / DESCRIPTION).write_bytes(b"\xff\xff"), "damaged"),
        (lambda folder: (folder / CLOUDS).unlink(), "damaged .*; delete it and prepare it again"),
        (lambda folder: truncate(folder / CLOUDS, 0), "damaged"),
        (lambda folder: truncate(folder / CLOUDS, 60), "damaged"),
        (lambda folder: truncate(folder / CLOUDS, 1000), "damaged"),
        (lambda folder: (folder / CLOUDS).write_bytes(b"no array at all"), "damaged"),
        (
            lambda folder: np.save(folder / CLOUDS, np.zeros((11, 39, 3), np.float32)),
            r"expected \(11, 40, 3\)",
        ),
        (lambda folder: np.save(folder / CLOUDS, np.zeros((11, 40, 3))), "expected"),
        (lambda folder: np.save(folder / PARTS, np.zeros((11, 39), np.uint8)), r"parts\.npy is \(11, 39\)"),
        (lambda folder: truncate(folder / PARTS, 0), "damaged"),
        (lambda folder: (folder / MANIFEST).unlink(), r"no manifest\.csv"),
        (lambda folder: drop_last_line(folder / MANIFEST), "10 manifest rows"),
        (lambda folder: replace(folder / MANIFEST, "sample_id", "sample"), "has no column 'sample_id'"),
        (lambda folder: replace(folder / MANIFEST, "state", "status"), "has no column 'state'"),
        (lambda folder: replace(folder / MANIFEST, "semi_open", "ajar"), "unknown state 'ajar'"),
    ],
)
def test_a_damaged_folder_is_refused_in_one_line(
    prepared: Path, damage: Callable[[Path], None], message: str
) -> None:
    np.save(prepared / PARTS, np.zeros((11, 40), np.uint8))
    open_dataset(prepared)
    damage(prepared)
    with pytest.raises(DatasetError, match=message) as caught:
        open_dataset(prepared)
    assert "\n" not in str(caught.value)


def test_the_manifest_may_be_compressed(prepared: Path) -> None:
    rows = open_dataset(prepared).rows
    (prepared / MANIFEST).unlink()
    write_csv(prepared / f"{MANIFEST}.gz", rows)
    assert open_dataset(prepared).rows == rows
