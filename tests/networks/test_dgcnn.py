# SPDX-License-Identifier: Apache-2.0
"""DGCNN: the factored edge convolution against every edge written out, and the graph it works on."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import Tensor, nn

from doorstate.networks.dgcnn import DGCNN, EdgeConv
from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.knn import knn
from tests.networks import plain


def clouds(batch: int = 2, num_points: int = 128) -> Tensor:
    return torch.rand(batch, num_points, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1


def edge_features(network: DGCNN, points: Tensor) -> list[Tensor]:
    order, neighbours = network.neighbourhoods(points)
    return network.edge_features(gather_rows(points, order), neighbours)


@pytest.fixture
def conv() -> EdgeConv:
    """Scales of both signs, so that some channels need the minimum over neighbours."""
    conv = EdgeConv(6, 8)
    with torch.no_grad():
        conv.norm.weight.copy_(torch.linspace(-1, 1.3, 8))
        conv.norm.bias.copy_(torch.linspace(0.5, -0.5, 8))
        conv.norm.running_var.copy_(torch.linspace(0.5, 2, 8))
    return conv


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("training", [True, False])
def test_edge_conv_equals_its_plain_twin(conv: EdgeConv, dtype: torch.dtype, training: bool) -> None:
    features = torch.randn(2, 30, 6, generator=torch.Generator().manual_seed(0)) + 2
    indices = knn(features, features, 5)
    plain.assert_twins(
        conv.train(training),
        lambda module, leaves: module(leaves[0], indices),
        lambda module, leaves: plain.edge_conv(leaves[0], indices, module),
        [features],
        dtype,
    )


def test_running_statistics_are_those_of_all_edges(conv: EdgeConv) -> None:
    conv.double()
    features = torch.randn(2, 30, 6, generator=torch.Generator().manual_seed(0)).double()
    indices = knn(features, features, 5)
    neighbours = plain.gather(features, indices)
    centres = features.unsqueeze(2).expand_as(neighbours)
    edges = nn.functional.linear(torch.cat([neighbours - centres, centres], -1), conv.linear.weight)
    norm = copy.deepcopy(conv.norm)
    norm(edges)
    conv(features, indices)
    for name, expected in norm.state_dict().items():
        torch.testing.assert_close(conv.norm.state_dict()[name], expected, rtol=1e-12, atol=1e-12)


def test_a_point_that_is_its_only_neighbour_has_no_difference(conv: EdgeConv) -> None:
    features = torch.randn(2, 30, 6, generator=torch.Generator().manual_seed(0))
    itself = torch.arange(30).view(1, 30, 1).expand(2, -1, 4)
    before = conv.eval()(features, itself)
    with torch.no_grad():
        conv.linear.weight[:, :6] *= -3
    torch.testing.assert_close(conv(features, itself), before)


def test_channels_of_all_layers() -> None:
    network = DGCNN().eval()
    outputs = edge_features(network, clouds())
    assert [o.shape[-1] for o in outputs] == [64, 64, 128, 256]
    assert network.aggregate(torch.cat(outputs, dim=-1)).shape == (2, 128, 1024)
    assert network.features(clouds()).shape == (2, 2048)
    assert [m.negative_slope for m in network.modules() if isinstance(m, nn.LeakyReLU)] == [0.2] * 3
    assert [m.p for m in network.modules() if isinstance(m, nn.Dropout)] == [0.5, 0.5]


def test_second_half_of_the_features_is_the_mean() -> None:
    network = DGCNN().eval()
    rows = network.aggregate(torch.cat(edge_features(network, clouds()), dim=-1))
    expected = torch.cat([rows.amax(1), rows.mean(1)], dim=-1)
    torch.testing.assert_close(network.features(clouds()), expected)


def test_graph_is_rebuilt_in_feature_space() -> None:
    network = DGCNN().eval()
    graphs: list[Tensor] = []
    for conv in network.convs:
        conv.register_forward_pre_hook(lambda module, args: graphs.append(args[1]))
    network(clouds())
    assert [graph.shape for graph in graphs] == [(2, 128, 20)] * 4
    for graph in graphs:
        assert (graph[..., 0] == torch.arange(128)).all()
    order, _ = network.neighbourhoods(clouds())
    assert torch.equal(graphs[0], plain_graph(gather_rows(clouds(), order), 20))
    assert not torch.equal(graphs[0].sort(-1).values, graphs[1].sort(-1).values)


def plain_graph(points: Tensor, k: int) -> Tensor:
    return (points.unsqueeze(2) - points.unsqueeze(1)).square().sum(-1).argsort(dim=-1, stable=True)[..., :k]


def test_order_of_points_does_not_matter() -> None:
    network = DGCNN().double().eval()
    points = clouds().double()
    order = torch.randperm(128, generator=torch.Generator().manual_seed(1))
    torch.testing.assert_close(network(points[:, order]), network(points), rtol=0, atol=1e-9)


def test_edge_convolutions_keep_full_precision_under_autocast() -> None:
    network = DGCNN().eval()
    exact = edge_features(network, clouds())[-1]
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(edge_features(network, clouds())[-1], exact)


def test_number_of_neighbours_is_the_authors() -> None:
    assert [DGCNN().num_neighbours(count) for count in (128, 1024, 2048, 4096)] == [20, 20, 40, 40]
    assert DGCNN(k=7).num_neighbours(4096) == 7
    _, neighbours = DGCNN().neighbourhoods(clouds(num_points=2048))
    assert neighbours.shape == (2, 2048, 40)
