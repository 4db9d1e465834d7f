# SPDX-License-Identifier: Apache-2.0
"""Arrays of pieces are joined without a memory map, byte for byte as NumPy writes them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.pieces import SavedPieces, write_concatenated
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.errors import DatasetError, OutputError
from tests.full_disk import full_disk


@pytest.mark.parametrize(
    ("shape", "dtype"), [((7, 4, 3), np.float32), ((7, 4), np.uint8), ((0, 4, 3), np.float32)]
)
def test_the_file_is_that_of_numpy(shape: tuple[int, ...], dtype: type[np.generic], tmp_path: Path) -> None:
    array = np.random.default_rng(0).integers(0, 200, shape).astype(dtype)
    write_concatenated(tmp_path / "a.npy", [array[:3], array[3:3], array[3:]], shape, dtype)
    np.save(tmp_path / "b.npy", array)
    assert (tmp_path / "a.npy").read_bytes() == (tmp_path / "b.npy").read_bytes()


@pytest.mark.parametrize("kind", ["pipe", "text", "other arrays", "no JSON"])
def test_damaged_pieces_are_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "00000.npz"
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "text":
            path.write_bytes(b"PK\x03\x04 no archive")
        case "other arrays":
            np.savez(path, clouds=np.zeros(3))
        case "no JSON":
            np.savez(path, samples=np.array("[["))
    with pytest.raises(DatasetError) as caught:
        SavedPieces.read([path])
    assert caught.value.path == path


def test_a_full_disk_is_an_error_in_one_line(simulated_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputError) as refused, full_disk(tmp_path):
        write_concatenated(tmp_path / "a.npy", [np.zeros((3, 2), np.uint8)], (3, 2), np.uint8)
    assert refused.value.path == tmp_path / "a.npy"
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OutputError), full_disk(tmp_path):
        prepare_dataset(Preparation(simulated_folder, CloudSpec(num_points=128)), tmp_path / "out", workers=1)
