# SPDX-License-Identifier: Apache-2.0
"""A changed byte of weights, graph or card is noticed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper

from doorstate.errors import WeightsError
from doorstate.inference.backends.onnx_backend import INPUT, PROBABILITIES, OnnxBackend
from doorstate.inference.export.description import describe
from doorstate.networks import create_network
from doorstate.networks.card import DIGEST_KEY, WeightsCard
from doorstate.networks.digest import DIGESTS_FILE, add_digest, check_digest, packaged_digests
from doorstate.networks.packaged import PRETRAINED
from doorstate.networks.tensor_file import read_tensors
from doorstate.networks.weights import load_weights, save_weights

CARD = WeightsCard(network="pointnet", num_points=128)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("weights") / "w.safetensors"
    save_weights(path, create_network("pointnet"), CARD)
    assert load_weights(path)[1] == CARD
    return path.read_bytes()


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    points, probabilities = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", "points", 3])
        for name in (INPUT, PROBABILITIES)
    )
    node = helper.make_node("Softmax", [INPUT], [PROBABILITIES])
    model = helper.make_model(
        helper.make_graph([node], "g", [points], [probabilities]),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=8,
    )
    describe(model, CARD)
    content = add_digest(model.SerializeToString())
    path = tmp_path_factory.mktemp("graph") / "w.onnx"
    path.write_bytes(content)
    assert OnnxBackend(path).card == CARD
    return content


def flipped(content: bytes, place: int) -> bytes:
    changed = bytearray(content)
    changed[place] ^= 1
    return bytes(changed)


def places(content: bytes) -> list[int]:
    """Return places all over a file and, one by one, those of its digest."""
    around = content.index(DIGEST_KEY.encode()) - 4
    return [*range(around, around + 90), *np.linspace(8, len(content) - 1, 60, dtype=int).tolist()]


@pytest.mark.parametrize(("kind", "load"), [("safetensors", load_weights), ("onnx", OnnxBackend)])
def test_a_flipped_bit_is_noticed(
    kind: str, load: Callable[[Path], object], weights: bytes, graph: bytes, tmp_path: Path
) -> None:
    path, content = tmp_path / f"w.{kind}", {"safetensors": weights, "onnx": graph}[kind]
    for place in places(content):
        path.write_bytes(flipped(content, place))
        with pytest.raises(WeightsError) as caught:
            load(path)
        assert caught.value.path == path, place


def test_an_edited_card_is_noticed(weights: bytes, tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    path.write_bytes(weights.replace(b'temperature\\": 1.0', b'temperature\\": 9.0'))
    assert path.read_bytes() != weights
    for read in (load_weights, read_tensors):
        with pytest.raises(WeightsError):
            read(path)  # type: ignore[operator]


def test_packaged_files_are_those_of_their_digests() -> None:
    files = [path for path in PRETRAINED.iterdir() if path.suffix in (".safetensors", ".onnx")]
    assert {path.name for path in files} == packaged_digests().keys(), "run: python -m paper graphs"
    for path in files:
        content = path.read_bytes()
        check_digest(content, path)
        with pytest.raises(WeightsError):
            check_digest(flipped(content, len(content) // 2), path)
    with pytest.raises(WeightsError):
        check_digest(b"", PRETRAINED / "unknown.onnx")
    assert json.loads((PRETRAINED / DIGESTS_FILE).read_text()) == packaged_digests()
