# SPDX-License-Identifier: Apache-2.0
"""Every network as ONNX: onnxruntime agrees with torch, or no file is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnxruntime import InferenceSession

from doorstate.clouds.normalization import NORMALIZATIONS, Input
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.errors import ExportError
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.export import OPSET, TOLERANCE, export_onnx
from doorstate.inference.export.parity import rounding_effect
from doorstate.inference.export.refusals import REASONS
from doorstate.inference.reference_clouds import LabelledClouds, reference_clouds
from doorstate.networks import create_network, list_networks
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import add_heads, head_outputs
from doorstate.networks.heads import HEADS
from doorstate.networks.layers.batch_norm import set_batchnorm
from doorstate.networks.parameters import NUM_PARAMETERS
from doorstate.networks.weights import load_weights, save_weights
from doorstate.types import Points

OUTPUTS = ["state", "reason", "probabilities", "raw_probabilities"]
SLOW = {"pointcnn"}


def card_of(name: str, cloud: Input = "whole") -> WeightsCard:
    scale_m = NORMALIZATIONS[cloud].scale_m
    return WeightsCard(
        network=name, input=cloud, scale_m=scale_m, num_points=4096, temperature=0.1, trained_on="nothing"
    )


@pytest.fixture(scope="module")
def clouds() -> LabelledClouds:
    """Clouds without walls, whose equally distant neighbours every runtime orders differently."""
    rng = np.random.default_rng(0)
    sizes_m = rng.uniform(0.3, 3, (7, 1, 3))
    points = (rng.normal(2, 1, (7, 160, 3)) * sizes_m).astype(np.float32)
    return LabelledClouds(
        np.stack([prepare_cloud(cloud, CloudSpec(num_points=160)).points for cloud in points]),
        np.arange(7) % 3,
    )


def network_trained_on(name: str, clouds: LabelledClouds, cloud: Input = "whole") -> PointNetwork:
    """Return an untrained network with the batch statistics of these clouds, so that its outputs differ."""
    torch.manual_seed(0)
    network = create_network(name).train()
    set_batchnorm(network, momentum=1.0)
    with torch.no_grad():
        network(torch.from_numpy(NORMALIZATIONS[cloud](clouds.points)))
    return network.eval()


@pytest.mark.parametrize("name", ["pointnet", "pointnet2"])  # all networks share what is different with crops
def test_a_file_of_crops_agrees_with_torch(name: str, tmp_path: Path) -> None:
    crops, card = reference_clouds(4, 160, cloud_input="doorway"), card_of(name, "doorway")
    network = network_trained_on(name, crops, "doorway")
    add_heads(network, ("door", "frame"))
    card = card.model_copy(update={"heads": ("door", "frame")})
    parity = export_onnx(tmp_path / "crops.onnx", network.eval(), card, crops)
    assert parity.max_difference <= parity.tolerance
    exported = OnnxBackend(tmp_path / "crops.onnx")
    assert (exported.card.input, exported.card.scale_m) == ("doorway", 1.5)
    outside = set(onnxruntime_reasons(tmp_path / "crops.onnx", crops.points + np.float32([1.6, 0, 0])))
    assert outside == {REASONS.index("unusable_cloud")}
    assert not outside & set(onnxruntime_reasons(tmp_path / "crops.onnx", crops.points))


@pytest.mark.parametrize("name", list_networks())
def test_crops_go_through_the_same_network_normalised_otherwise(name: str, tmp_path: Path) -> None:
    crops, heads = reference_clouds(4, 160, cloud_input="doorway"), ("door", "frame", "widths")
    assert np.abs(crops.points[..., :2]).max() <= 1.5
    network = network_trained_on(name, crops, "doorway")
    assert sum(parameter.numel() for parameter in network.parameters()) == NUM_PARAMETERS[name]
    add_heads(network, heads)
    card = card_of(name, "doorway").model_copy(update={"heads": heads})
    save_weights(tmp_path / "crops.safetensors", network.eval(), card)
    loaded, of_file = load_weights(tmp_path / "crops.safetensors")
    assert of_file.normalization == NORMALIZATIONS["doorway"]
    outputs, expected = (TorchBackend(net, card)(crops.points) for net in (loaded, network))
    np.testing.assert_array_equal(outputs.probabilities, expected.probabilities)
    np.testing.assert_array_equal(outputs.heads["door_x_m"], expected.heads["door_x_m"])
    as_whole = TorchBackend(network, card_of(name).model_copy(update={"heads": heads}))(crops.points)
    assert np.abs(as_whole.probabilities - expected.probabilities).max() > 1e-3


def onnxruntime_reasons(path: Path, points: Points) -> list[int]:
    (reasons,) = InferenceSession(path).run(["reason"], {"points": points})
    return list(reasons)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in list_networks()]
)
def test_the_file_agrees_with_torch(name: str, clouds: LabelledClouds, tmp_path: Path) -> None:
    path, network = tmp_path / "network.onnx", network_trained_on(name, clouds)
    parity = export_onnx(path, network, card_of(name), clouds)
    assert parity.max_difference <= TOLERANCE == parity.tolerance
    assert parity.num_correct == parity.num_correct_torch
    exported = OnnxBackend(path)
    expected = TorchBackend(network, card_of(name))(clouds.points).probabilities
    assert np.ptp(expected, axis=0).max() > 0.1, "equal outputs would compare nothing"
    for batch in (clouds.points[:1], clouds.points[1:6]):
        outputs = exported(batch)[0]
        np.testing.assert_allclose(outputs.sum(1), 1, atol=1e-5)
    np.testing.assert_allclose(exported(clouds.points)[0], expected, atol=TOLERANCE)

    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    assert model.opset_import[0].version == OPSET
    (points,), outputs = model.graph.input, [output.name for output in model.graph.output]
    assert (points.name, outputs) == ("points", OUTPUTS)
    batch, *fixed = points.type.tensor_type.shape.dim
    assert batch.dim_param
    assert [size.dim_value for size in fixed] == [160, 3]
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    assert metadata["labels"] == "closed,semi_open,open"
    assert metadata["units"] == "metres"
    assert {"frame", "preparation"} < set(metadata)
    assert exported.card == card_of(name).model_copy(update={"num_points": 160})


def test_heads_are_outputs_of_the_file(clouds: LabelledClouds, tmp_path: Path) -> None:
    network, heads = network_trained_on("pointnet2", clouds), (*HEADS, "parts")
    add_heads(network, heads)
    torch.nn.init.constant_(network.heads["door"].linear.bias, 9.0)  # type: ignore[union-attr, arg-type]
    card = card_of("pointnet2").model_copy(update={"heads": heads})
    parity = export_onnx(tmp_path / "network.onnx", network.eval(), card, clouds, gate=None)
    assert parity.max_difference <= TOLERANCE
    exported = OnnxBackend(tmp_path / "network.onnx")
    expected = TorchBackend(network, card)(clouds.points).heads
    probabilities, columns, withheld = exported(clouds.points)
    assert withheld is not None
    assert not withheld.any()
    assert list(columns) == list(expected)
    for name, values in expected.items():
        assert np.ptp(values) > 0 or name.endswith("width_m")  # widths are cut at 0
        np.testing.assert_allclose(columns[name], values, atol=0.01 if name.endswith("_deg") else 1e-4)
    assert np.array_equal(probabilities, exported(clouds.points)[0])
    outputs = [output.name for output in onnx.load(tmp_path / "network.onnx").graph.output]
    assert outputs == [*OUTPUTS, *HEADS]


def test_int8_is_a_quarter_of_the_size_and_differs(clouds: LabelledClouds, tmp_path: Path) -> None:
    network = network_trained_on("pointnet", clouds)
    parity = export_onnx(tmp_path / "small.onnx", network, card_of("pointnet"), clouds, int8=True)
    assert parity.max_difference > 0, "it is reported"
    parameters = sum(parameter.numel() for parameter in network.parameters())
    assert (tmp_path / "small.onnx").stat().st_size < 1.1 * parameters
    assert OnnxBackend(tmp_path / "small.onnx").card.num_points == 160
    assert any(node.op_type == "MatMulInteger" for node in onnx.load(tmp_path / "small.onnx").graph.node)


def test_a_file_that_differs_from_torch_is_not_written(
    clouds: LabelledClouds, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def of_larger_clouds(
        network: PointNetwork, points: torch.Tensor, **options: bool
    ) -> dict[str, torch.Tensor]:
        return head_outputs(network, 1.5 * points, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("doorstate.inference.export.graph.head_outputs", of_larger_clouds)
    with pytest.raises(ExportError) as caught:
        export_onnx(
            tmp_path / "net.onnx", network_trained_on("pointnet", clouds), card_of("pointnet"), clouds
        )
    assert caught.value.path == tmp_path / "net.onnx"
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_opset_is_an_export_error(clouds: LabelledClouds, tmp_path: Path) -> None:
    with pytest.raises(ExportError) as caught:
        export_onnx(
            tmp_path / "net.onnx",
            network_trained_on("pointnet", clouds),
            card_of("pointnet"),
            clouds,
            opset=99,
        )
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_rounding_changes_tied_neighbours(clouds: LabelledClouds) -> None:
    card = card_of("pointnet")
    moved = rounding_effect(network_trained_on("pointnet", clouds), card, clouds.points)
    assert 0 < moved < TOLERANCE
    # Evenly on a ring, every point has two neighbours at each distance.
    ring = np.arange(160) * (2 * np.pi / 160)
    tied = np.stack([np.cos(ring), np.sin(ring), 0 * ring], axis=1).astype(np.float32)[None]
    network = network_trained_on("pointcnn", clouds)
    assert rounding_effect(network, card_of("pointcnn"), tied) > 10 * moved
