# SPDX-License-Identifier: Apache-2.0
"""Own reading of safetensors: equal to the library's, and damaged files are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from safetensors.numpy import load, save

from doorstate.errors import WeightsError
from doorstate.networks.packaged import packaged_networks, packaged_weights
from doorstate.networks.tensor_file import read_header, read_tensors

ENTRY = {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]}


def write(path: Path, header: object, data: bytes) -> Path:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + data)
    return path


@given(
    tensors=st.dictionaries(
        st.text(st.characters(codec="utf-8"), max_size=8).filter(lambda name: name != "__metadata__"),
        arrays.arrays(
            st.sampled_from([np.float16, np.float32, np.float64, np.int64]),
            arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
            elements={"allow_nan": False, "allow_infinity": False},
        ),
        max_size=5,
    )
)
def test_tensors_are_those_of_the_library(
    tensors: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "w.safetensors"
    path.write_bytes(save(tensors, {"key": "value"}))
    read = read_tensors(path)
    assert read.keys() == tensors.keys()
    for name, tensor in tensors.items():
        assert read[name].dtype == tensor.dtype
        assert np.array_equal(read[name], tensor)
    assert read_header(path).metadata == {"key": "value"}


@pytest.mark.parametrize("name", packaged_networks())
def test_packaged_weights_are_read_as_the_library_does(name: str) -> None:
    expected, read = load(packaged_weights(name).read_bytes()), read_tensors(packaged_weights(name))
    assert read.keys() == expected.keys()
    assert all(np.array_equal(read[key], expected[key]) for key in expected)


@pytest.mark.parametrize(
    ("header", "data"),
    [
        (b"", b""),
        (b"{", b""),
        (b"[]", b""),
        (b"[" * 100_000, b""),
        (b"\xff\xfe", b""),
        (b'{"a": ' + b"1" * 5000 + b"}", b""),
        ({"a": ENTRY}, b"1234567"),
        ({"a": ENTRY}, b"123456789"),
        ({"a": ENTRY, "b": ENTRY}, b"12345678"),
        ({"a": ENTRY | {"shape": [3]}}, b"12345678"),
        ({"a": ENTRY | {"shape": [-2]}}, b"12345678"),
        ({"a": ENTRY | {"shape": [2**40, 2**40]}}, b"12345678"),
        ({"a": ENTRY | {"shape": [1] * 100}}, b"12345678"),
        ({"a": ENTRY | {"dtype": "F8_E4M3"}}, b"12345678"),
        ({"a": ENTRY | {"data_offsets": [8, 0]}}, b"12345678"),
        ({"a": {"dtype": "F32"}}, b"12345678"),
        ({"__metadata__": {"a": 1}}, b""),
        ({"__metadata__": []}, b""),
    ],
)
def test_damaged_headers_are_refused(header: object, data: bytes, tmp_path: Path) -> None:
    path = write(tmp_path / "w.safetensors", header, data)
    for read in (read_header, read_tensors):
        with pytest.raises(WeightsError) as caught:
            read(path)
        assert caught.value.path == path


def test_a_header_longer_than_any_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    with path.open("wb") as stream:
        stream.write((2**29).to_bytes(8, "little"))
        stream.truncate(2**29 + 8)
    with pytest.raises(WeightsError):
        read_header(path)
