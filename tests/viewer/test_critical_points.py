# SPDX-License-Identifier: Apache-2.0
"""Critical points are exactly the points that the features depend on."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from doorstate.clouds.normalization import normalize
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.networks import create_network, list_networks
from doorstate.networks.base import PointNetwork
from doorstate.types import Points
from doorstate.viewer.critical_points import critical_points

COUNT = 700


@pytest.fixture(scope="module")
def cloud() -> Points:
    """A corner of a room, in farthest-point order."""
    sheet = np.random.default_rng(0).uniform(-1, 1, (3, 400, 3))
    for axis in range(3):
        sheet[axis, :, axis] = 1
    sheet[..., 0] += 2
    return prepare_cloud(sheet.reshape(-1, 3).astype(np.float32), CloudSpec(num_points=COUNT)).points


def network_of(name: str, **options: object) -> PointNetwork:
    torch.manual_seed(3)
    return create_network(name, **options).eval()


def counts_of(network: PointNetwork, cloud: Points) -> NDArray[np.float32]:
    counts = critical_points(network, cloud)
    assert counts is not None
    assert counts.shape == (COUNT,)
    return counts


def features(network: PointNetwork, points: torch.Tensor) -> torch.Tensor:
    with torch.inference_mode():
        return network.features(points[None])[0]


def test_critical_points_of_pointnet_are_the_rows_with_the_maximum(cloud: Points) -> None:
    network = network_of("pointnet")
    points = torch.from_numpy(normalize(cloud))
    alone = torch.stack(
        [features(network, points[k : k + 1]) for k in range(COUNT)]
    )  # T-Nets are the identity
    winners = alone.argmax(dim=0)[alone.amax(dim=0) > 0]
    assert len(winners) > 100
    assert counts_of(network, cloud).tolist() == torch.bincount(winners, minlength=COUNT).tolist()


def test_features_of_pointnet_depend_on_critical_points_only(cloud: Points) -> None:
    network = network_of("pointnet")
    critical = counts_of(network, cloud) > 0
    assert 20 < critical.sum() < COUNT / 2
    points = torch.from_numpy(normalize(cloud))
    whole = features(network, points)
    torch.testing.assert_close(features(network, points[torch.from_numpy(critical)]), whole)
    inward = points.clone()
    inward[~critical] *= 0.99
    torch.testing.assert_close(features(network, inward), whole)
    one = int(counts_of(network, cloud).argmax())
    rest = torch.cat([points[:one], points[one + 1 :]])
    assert not torch.allclose(features(network, rest), whole)


@pytest.mark.parametrize(
    ("name", "options", "share", "centres"),
    [
        ("pointnet2", {"variant": "ssg"}, 1, 512),
        ("pointnet2", {"variant": "msg"}, 0.1, 51),
        ("point2sequence", {}, 0.01, 4),
    ],
)
def test_only_critical_points_and_centres_move_the_features(
    name: str, options: dict[str, object], share: float, centres: int, cloud: Points
) -> None:
    network = network_of(name, **options)
    network.use_centres(share)
    points = torch.from_numpy(normalize(cloud))[None].requires_grad_()
    outputs = network.features(points)
    weights = torch.from_numpy(np.random.default_rng(1).uniform(1, 2, outputs.shape).astype(np.float32))
    (gradient,) = torch.autograd.grad((outputs * weights).sum(), points)
    moves = (gradient[0] != 0).any(dim=1).numpy()
    counts = counts_of(network, cloud)
    assert 0 < (counts[centres:] == 0).sum() < COUNT - centres, "the test would be trivial"
    assert moves[centres:].tolist() == (counts[centres:] > 0).tolist()
    # Every channel above zero is counted once.
    assert counts.sum() == pytest.approx(float((outputs > 0).sum()), rel=1e-5)


def test_critical_points_of_dgcnn_are_the_rows_with_the_maximum(cloud: Points) -> None:
    network = network_of("dgcnn")
    counts = counts_of(network, cloud)
    assert counts.sum() == 1024
    assert counts.tolist() == counts.round().tolist()
    # The counts follow a permutation of the points.
    order = np.random.default_rng(2).permutation(COUNT)
    assert counts_of(network, cloud[order]).tolist() == counts[order].tolist()


@pytest.mark.parametrize("name", ["pointcnn", "mvcnn"])
def test_networks_without_a_maximum_over_points_have_none(name: str, cloud: Points) -> None:
    assert critical_points(network_of(name), cloud) is None


def test_all_other_networks_have_critical_points(cloud: Points) -> None:
    for name in set(list_networks()) - {"pointcnn", "mvcnn"}:
        assert counts_of(network_of(name), cloud).sum() > 100


def test_hooks_are_removed_from_the_network(cloud: Points) -> None:
    network = network_of("pointnet2")
    first = counts_of(network, cloud)
    assert not any(module._forward_pre_hooks for module in network.modules())
    assert counts_of(network, cloud).tolist() == first.tolist()
