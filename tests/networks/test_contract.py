# SPDX-License-Identifier: Apache-2.0
"""The contract of all networks, tested for all five."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest
import torch
from torch import Tensor

from doorstate.errors import CloudContentError, ConfigError
from doorstate.networks import create_network, list_networks
from doorstate.networks.base import PointNetwork
from doorstate.networks.layers.batch_norm import RowBatchNorm
from doorstate.networks.point2sequence import Point2Sequence
from doorstate.networks.pointcnn import PointCNN
from doorstate.networks.pointnet2 import PointNet2

NAMES = ("pointnet", "pointnet2", "dgcnn", "pointcnn", "point2sequence")
LABELS = torch.tensor([0, 2])
# Parameters at 3 and at 40 classes.
COUNTS = {
    "pointnet": (3_470_540, 3_480_049),
    "pointnet2": (1_466_179, 1_475_688),
    "dgcnn": (1_800_067, 1_809_576),
    "pointcnn": (592_199, 599_340),
    "point2sequence": (1_835_907, 1_845_416),
}


def clouds(num_points: int, batch: int = 2, seed: int = 0) -> Tensor:
    return torch.rand(batch, num_points, 3, generator=torch.Generator().manual_seed(seed)) * 2 - 1


@pytest.fixture(params=NAMES)
def network(request: pytest.FixtureRequest) -> PointNetwork:
    """A network whose running statistics and scales are not those of an untrained one."""
    network = create_network(request.param)
    for module in network.modules():
        if isinstance(module, RowBatchNorm):
            torch.nn.init.uniform_(module.weight, -1, 1)
            torch.nn.init.uniform_(module.running_mean, -0.1, 0.1)
            torch.nn.init.uniform_(module.running_var, 0.5, 1.5)
    return network


def test_names() -> None:
    assert tuple(list_networks()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_number_of_parameters(name: str) -> None:
    counts = tuple(
        sum(p.numel() for p in create_network(name, num_classes=classes).parameters()) for classes in (3, 40)
    )
    assert counts == COUNTS[name]


def test_parameters_of_multi_scale_grouping() -> None:
    counts = [
        sum(p.numel() for p in create_network("pointnet2", num_classes=c, variant="msg").parameters())
        for c in (3, 40)
    ]
    assert counts == [1_737_859, 1_747_368]


def test_pretrained_network_has_packaged_weights_and_heads() -> None:
    network = create_network("pointnet2", pretrained=True)
    assert not network.training
    assert "door" in network.heads
    paper = create_network("pointnet2", pretrained="ogurob-pointnet2")
    assert not torch.equal(network.level1.mlps[0].pool.linear.weight, paper.level1.mlps[0].pool.linear.weight)
    with pytest.raises(ConfigError, match="are for pointnet, not dgcnn"):
        create_network("dgcnn", pretrained="ogurob-pointnet")
    with pytest.raises(ConfigError):
        create_network("dgcnn", pretrained=True, k=3)


def test_cards_and_heads_import_no_torch() -> None:
    code = (
        "import sys, doorstate.networks.card, doorstate.networks.heads, doorstate.networks.packaged; "
        "sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("name", "options", "suggested"),
    [
        ("pointnet3", {}, ["'pointnet"]),
        ("zzz", {}, ["pointnet2", "dgcnn", "pointcnn", "point2sequence", "mvcnn"]),
        ("dgcnn", {"kk": 3}, ["'k'"]),
    ],
)
def test_unknown_names_suggest_the_closest_or_all(
    name: str, options: dict[str, Any], suggested: list[str]
) -> None:
    with pytest.raises(ConfigError, match=next(iter(options), name)) as refused:
        create_network(name, **options)
    assert all(word in str(refused.value.hint) for word in suggested)


@pytest.mark.parametrize("num_points", [128, 256, 512, 1024])
def test_logits_at_every_resolution(network: PointNetwork, num_points: int) -> None:
    with torch.inference_mode():
        logits = network.eval()(clouds(num_points, batch=1))
    assert logits.shape == (1, 3)
    assert logits.dtype == torch.float32
    assert logits.isfinite().all()


@pytest.mark.parametrize("name", NAMES)
def test_number_of_classes(name: str) -> None:
    network = create_network(name, num_classes=5)
    loss, logits = network.training_loss(clouds(128), LABELS)
    assert loss.shape == ()
    assert logits.shape == (2, 5)
    assert network(clouds(128)).shape == (2, 5)  # while training


def test_features_then_head_is_forward(network: PointNetwork) -> None:
    network.eval()
    points = clouds(128)
    features = network.features(points)
    assert features.shape == (2, network.feature_size)
    torch.testing.assert_close(network.head(features), network(points))


def test_evaluation_is_deterministic_and_clouds_are_independent(network: PointNetwork) -> None:
    network.eval()
    points = clouds(160, batch=3)
    with torch.inference_mode():
        together = network(points)
        assert torch.equal(network(points), together)
        alone = torch.cat([network(cloud.unsqueeze(0)) for cloud in points])
    torch.testing.assert_close(alone, together, rtol=1e-4, atol=1e-4)


def test_state_dict_round_trip(network: PointNetwork) -> None:
    twin = type(network)()
    points = clouds(128)
    assert not torch.equal(twin.eval()(points), network.eval()(points))
    twin.load_state_dict(network.state_dict())
    assert torch.equal(twin(points), network(points))


@pytest.mark.parametrize("autocast", [False, True])
def test_every_parameter_gets_a_finite_gradient(network: PointNetwork, autocast: bool) -> None:
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=autocast):
        loss, logits = network.training_loss(clouds(128), LABELS, label_smoothing=0.1)
    assert loss.dtype == logits.dtype == torch.float32
    loss.backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.isfinite().all(), name


def test_autocast_changes_little_in_evaluation(network: PointNetwork) -> None:
    network.eval()
    points = clouds(256)
    with torch.inference_mode():
        exact = network.features(points)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            rounded = network.features(points).float()
            assert network(points).dtype == torch.float32
    assert (rounded - exact).norm() / exact.norm() < 0.05


def test_fewer_centres_are_the_first_ones_and_can_be_restored(network: PointNetwork) -> None:
    network.eval()
    points = clouds(600)
    with torch.no_grad():
        whole = network.features(points)
        network.use_centres(0.5)
        half = network.features(points)
        network.use_centres(1.0)
        torch.testing.assert_close(network.features(points), whole)
    has_centres = isinstance(network, PointNet2 | PointCNN | Point2Sequence)
    assert torch.equal(half, whole) != has_centres
    if isinstance(network, Point2Sequence):
        assert (half <= whole).all(), "a maximum over fewer areas"


def test_label_smoothing_is_spread_over_all_classes() -> None:
    network = create_network("dgcnn").eval()
    points = clouds(128)
    loss, logits = network.training_loss(points, LABELS, label_smoothing=0.2)
    target = torch.full((2, 3), 0.2 / 3)
    target[[0, 1], LABELS] = 1 - 0.2 + 0.2 / 3  # 0.8667, 0.0667, 0.0667
    expected = -(target * logits.log_softmax(-1)).sum(-1).mean()
    torch.testing.assert_close(loss, expected)
    # The formula of DGCNN's authors, 0.8, 0.1, 0.1, is the same with eps * C/(C - 1) = 0.3.
    loss, _ = network.training_loss(points, LABELS, label_smoothing=0.3)
    target = torch.full((2, 3), 0.1)
    target[[0, 1], LABELS] = 0.8
    torch.testing.assert_close(loss, -(target * logits.log_softmax(-1)).sum(-1).mean())


@pytest.mark.parametrize("shape", [(2, 127, 3), (2, 128, 4), (128, 3)])
def test_unusable_points_are_refused(network: PointNetwork, shape: tuple[int, ...]) -> None:
    with pytest.raises(CloudContentError):
        network(torch.zeros(shape))
    with pytest.raises(CloudContentError):
        network.training_loss(torch.zeros(shape), LABELS)


@pytest.mark.parametrize("name", NAMES)
def test_batchnorm_epsilon_is_an_option(name: str) -> None:
    for eps, network in ((1e-5, create_network(name)), (1e-3, create_network(name, batchnorm_eps=1e-3))):
        norms = [m for m in network.modules() if isinstance(m, torch.nn.BatchNorm1d)]
        assert {(m.eps, m.momentum) for m in norms} == {(eps, 0.1)}


@pytest.mark.parametrize("name", NAMES)
def test_network_is_one_graph_for_any_batch(name: str) -> None:
    network = create_network(name).eval()
    batch = torch.export.Dim("batch")
    program = torch.export.export(network, (clouds(128),), dynamic_shapes=({0: batch},))
    points = clouds(128, batch=3, seed=1)
    torch.testing.assert_close(program.module()(points), network(points))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("training", [True, False])
def test_every_tensor_is_created_on_the_device_of_the_points(name: str, training: bool) -> None:
    """On torch's meta device, which stands for any but the CPU: it refuses whatever waits for values."""
    network = create_network(name).train(training).to("meta")
    loss, logits = network.training_loss(clouds(128).to("meta"), LABELS.to("meta"))
    assert loss.device.type == logits.device.type == "meta"
    loss.backward()
    assert all(p.grad is not None and p.grad.device.type == "meta" for p in network.parameters())


def test_frozen_networks_learn(network: PointNetwork) -> None:
    """Training in evaluation mode has the gradient of the loss along a random direction, and keeps the statistics."""
    network = network.double().eval()
    points = clouds(network.min_points, batch=2).double()
    statistics = {name: tensor.clone() for name, tensor in network.named_buffers()}
    network.training_loss(points, LABELS)[0].backward()
    generator, step = torch.Generator().manual_seed(1), 1e-6
    pairs = [
        (parameter, torch.randn(parameter.shape, generator=generator, dtype=torch.float64))
        for parameter in network.parameters()
    ]
    slope = sum(float((parameter.grad * way).sum()) for parameter, way in pairs)
    losses = []
    for sign in (1, -2):
        with torch.no_grad():
            for parameter, way in pairs:
                parameter += sign * step * way
            losses.append(float(network.training_loss(points, LABELS)[0]))
    assert (losses[0] - losses[1]) / (2 * step) == pytest.approx(slope, rel=1e-2)
    assert all(torch.equal(tensor, statistics[name]) for name, tensor in network.named_buffers())
