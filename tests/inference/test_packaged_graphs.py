# SPDX-License-Identifier: Apache-2.0
"""ONNX graphs of packaged weights: as the exporter writes them now, and in agreement with torch at every size."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from doorstate.errors import ConfigError, WeightsError
from doorstate.inference.backends import load_backend
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.export import TOLERANCE, weights_graph
from doorstate.inference.export.parity import rounding_effect
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.reference_clouds import LabelledClouds, reference_clouds
from doorstate.networks.card_file import read_card
from doorstate.networks.packaged import packaged_graph, packaged_networks, packaged_weights

# Around the numbers of centres (384, 512), where the neighbours of DGCNN double (2048), and what training took.
SIZES = (128, 384, 512, 513, 1024, 2047, 2048)
CHOOSE_NEIGHBOURS = {"ogurob-dgcnn", "ogurob-pointcnn", "ogurob-point2sequence"}


@pytest.fixture(scope="module")
def clouds() -> LabelledClouds:
    return reference_clouds(3, max(SIZES))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pointnet2"])  # the others agree with torch below
def test_the_graph_is_what_the_exporter_writes(name: str) -> None:
    written = weights_graph(packaged_weights(name)).SerializeToString(deterministic=True)
    assert packaged_graph(name).read_bytes() == written, "run: python -m paper graphs"


@pytest.mark.parametrize("name", packaged_networks())
def test_it_agrees_with_torch_at_every_number_of_points(name: str, clouds: LabelledClouds) -> None:
    onnx, torch = load_backend(name), load_backend(name, backend="torch")
    assert onnx.card == torch.card == read_card(packaged_weights(name))
    assert (onnx.network, onnx.num_points, torch.num_points) == (None, None, None)
    for size in SIZES:
        for points in (clouds.points[:1, :size], clouds.points[:, :size]):
            points = np.ascontiguousarray(points)
            actual, expected = onnx(points), torch(points)
            tolerance = TOLERANCE
            difference = np.abs(actual.probabilities - expected.probabilities).max()
            if difference > TOLERANCE and name in CHOOSE_NEIGHBOURS:
                assert torch.network is not None
                tolerance = max(TOLERANCE, 2 * rounding_effect(torch.network, torch.card, points))
            assert difference <= tolerance
            assert actual.heads.keys() == expected.heads.keys()
            for column, values in expected.heads.items():
                np.testing.assert_allclose(
                    actual.heads[column], values, atol=0.01 if column.endswith("_deg") else 1e-4
                )


def test_packaged_weights_run_without_torch_by_default_and_with_it_on_request() -> None:
    by_default, by_torch = Predictor.load("pointnet2"), Predictor.load("pointnet2", backend="torch")
    assert isinstance(by_default, NetworkPredictor)
    assert isinstance(by_torch, NetworkPredictor)
    assert isinstance(by_default.backend, OnnxBackend)
    assert by_torch.backend.network is not None
    with pytest.raises(ConfigError) as caught:
        Predictor.load("pointnet2", backend="tensorflow")
    assert caught.value.field == "backend"
    with pytest.raises(ConfigError):
        Predictor.load(packaged_weights("pointnet2"), backend="onnxruntime")
    with pytest.raises(ConfigError):
        Predictor.load(packaged_graph("pointnet2"), backend="torch")


def test_installers_may_link_the_files_from_elsewhere(tmp_path: Path, clouds: LabelledClouds) -> None:
    for folder, path in (("a", packaged_graph("pointnet2")), ("b", packaged_weights("pointnet2"))):
        (tmp_path / folder).mkdir()
        shutil.copy(path, tmp_path / folder / "content")
        (tmp_path / path.name).symlink_to(tmp_path / folder / "content")
    linked = OnnxBackend(tmp_path / "pointnet2.onnx", weights=tmp_path / "pointnet2.safetensors")
    points = np.ascontiguousarray(clouds.points[:, :512])
    assert np.array_equal(linked(points).probabilities, load_backend("pointnet2")(points).probabilities)


def test_weights_of_another_network_do_not_fit_the_graph() -> None:
    with pytest.raises(WeightsError):
        OnnxBackend(packaged_graph("pointnet2"), weights=packaged_weights("ogurob-pointnet"))
