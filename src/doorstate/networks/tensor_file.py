# SPDX-License-Identifier: Apache-2.0
"""Tensors of a safetensors file, read with NumPy alone: an answer of packaged weights needs no other library.

Eight bytes hold the length of a header in JSON, which gives type, shape and place of every tensor
(https://github.com/huggingface/safetensors#format). Nothing is trusted before it is checked.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Annotated, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StringConstraints, TypeAdapter, ValidationError

from doorstate._documents import parse_json
from doorstate._input import open_input, read_input
from doorstate._models import FrozenModel
from doorstate.errors import WeightsError, first_validation_error
from doorstate.networks.digest import check_digest

MAX_BYTES = 1 << 30  # of a file; the largest packaged one has 7 MB
_MAX_HEADER_BYTES = 1 << 20
_LENGTH_BYTES = 8
_METADATA = "__metadata__"
_DTYPES = {"F16": "<f2", "F32": "<f4", "F64": "<f8", "I64": "<i8"}

Size = Annotated[int, Field(ge=0, le=MAX_BYTES)]


class _Entry(FrozenModel):
    """Tensor as the header describes it."""

    dtype: Annotated[str, StringConstraints(max_length=8)]
    shape: Annotated[tuple[Size, ...], Field(max_length=8)]
    data_offsets: tuple[Size, Size]  # after the header


class TensorPlace(NamedTuple):
    """Type, shape and bytes of a tensor in a file."""

    dtype: np.dtype
    shape: tuple[int, ...]
    offset: int  # from the start of the file
    size: int  # bytes


class TensorHeader(NamedTuple):
    """Header of a file."""

    metadata: dict[str, str]
    tensors: dict[str, TensorPlace]


_ENTRIES = TypeAdapter(dict[str, _Entry])
_TEXTS = TypeAdapter(dict[str, str])


def read_header(path: Path) -> TensorHeader:
    """Read the header of a safetensors file.

    Raises:
        WeightsError: the file is missing, too large, or no safetensors.
    """
    with open_input(path, MAX_BYTES, WeightsError) as stream:
        return _read_header(stream, path)


def read_tensors(path: Path) -> dict[str, NDArray[np.generic]]:
    """Read all tensors of a safetensors file.

    Raises:
        WeightsError: as `read_header`, the file differs from its digest, or a number is not finite.
    """
    content = read_weights_file(path)
    header = _read_header(io.BytesIO(content), path)
    tensors = {
        name: np.frombuffer(content, place.dtype, math.prod(place.shape), place.offset).reshape(place.shape)
        for name, place in header.tensors.items()
    }
    for name, tensor in tensors.items():
        if not np.isfinite(tensor).all():
            raise WeightsError("holds numbers that are not finite: damaged", path=path, field=name)
    return tensors


def read_weights_file(path: Path) -> bytes:
    """Return the bytes of a weights file or exported network, compared with its digest.

    Raises:
        WeightsError: the file is missing or too large, or differs from its digest.
    """
    content = read_input(path, MAX_BYTES, WeightsError)
    check_digest(content, path)
    return content


def _read_header(stream: BinaryIO, path: Path) -> TensorHeader:
    length = int.from_bytes(stream.read(_LENGTH_BYTES), "little")
    if not 2 <= length <= _MAX_HEADER_BYTES:
        raise WeightsError("cannot be read as safetensors (length of its header)", path=path)
    start = _LENGTH_BYTES + length
    size = stream.seek(0, 2)
    stream.seek(_LENGTH_BYTES)
    try:
        content = parse_json(stream.read(length).decode(), WeightsError)
        metadata = _TEXTS.validate_python(content.pop(_METADATA, {}))
        entries = _ENTRIES.validate_python(content)
        places = {name: _place(entry, start) for name, entry in entries.items()}
        _check_places(list(places.values()), start, size)
    except ValidationError as error:
        raise WeightsError(
            f"cannot be read as safetensors ({first_validation_error(error)})", path=path
        ) from error
    except WeightsError as error:  # no JSON
        raise error.located(path) from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise WeightsError("cannot be read as safetensors (its header)", path=path) from error
    return TensorHeader(metadata, places)


def _place(entry: _Entry, start: int) -> TensorPlace:
    """Return the place of a tensor; ValueError or KeyError if type, shape and bytes do not fit."""
    dtype, (first, end) = np.dtype(_DTYPES[entry.dtype]), entry.data_offsets
    size = math.prod(entry.shape) * dtype.itemsize
    if end - first != size:
        raise ValueError("bytes of a tensor")
    return TensorPlace(dtype, entry.shape, start + first, size)


def _check_places(places: list[TensorPlace], start: int, size: int) -> None:
    """Raise ValueError unless the tensors fill the file from the header to its end, one after the other."""
    ordered = sorted(places, key=lambda place: (place.offset, place.size))
    ends = [start, *(place.offset + place.size for place in ordered)]
    if [place.offset for place in ordered] != ends[:-1] or ends[-1] != size:
        raise ValueError("tensors with gaps")
