# SPDX-License-Identifier: Apache-2.0
"""The multi-view CNN: its images by hand and by a plain loop, and the contract of all networks."""

from __future__ import annotations

import math

import pytest
import torch

from doorstate.networks import create_network, list_networks
from doorstate.networks.mvcnn import HALF_WIDTH, MVCNN, PIXELS, VIEWS_DEG


def clouds(points: int, batch: int = 2) -> torch.Tensor:
    return torch.rand(batch, points, 3, generator=torch.Generator().manual_seed(1)) * 2 - 1


def test_it_is_created_by_name_but_not_listed() -> None:
    network = create_network("mvcnn")
    assert isinstance(network, MVCNN)
    assert "mvcnn" not in list_networks()
    assert sum(p.numel() for p in network.parameters()) == 887_299


def test_one_point_ahead_is_one_pixel_of_the_front_view() -> None:
    network = MVCNN()
    cloud = torch.full((1, 128, 3), 9.0)  # outside every image
    cloud[0, 0] = torch.tensor([-0.5, 0.25, 0.5])  # near, to the left, above
    filled, near = network.render(cloud)[0, 0]
    column = math.floor((1 - 0.25 / HALF_WIDTH) / 2 * PIXELS)
    row = math.floor((1 - 0.5 / HALF_WIDTH) / 2 * PIXELS)
    assert filled.nonzero().tolist() == [[row, column]]
    assert near[row, column] == pytest.approx((HALF_WIDTH + 0.5) / (2 * HALF_WIDTH))


def test_images_equal_those_of_a_plain_loop() -> None:
    network, cloud = MVCNN(pixels=16), clouds(200, 1)
    images = network.render(cloud)[0]
    for view, (azimuth_deg, elevation_deg) in enumerate(VIEWS_DEG):
        a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
        expected = torch.zeros(2, 16, 16)
        for x, y, z in cloud[0].tolist():
            ahead = math.cos(a) * x + math.sin(a) * y
            side = math.cos(a) * y - math.sin(a) * x
            depth, up = math.cos(e) * ahead - math.sin(e) * z, math.sin(e) * ahead + math.cos(e) * z
            column = math.floor((HALF_WIDTH - side) / (2 * HALF_WIDTH) * 16)
            row = math.floor((HALF_WIDTH - up) / (2 * HALF_WIDTH) * 16)
            if 0 <= row < 16 and 0 <= column < 16:
                expected[0, row, column] = 1
                nearness = min(1.0, max(0.0, (HALF_WIDTH - depth) / (2 * HALF_WIDTH)))
                expected[1, row, column] = max(float(expected[1, row, column]), nearness)
        # A point on the border of two pixels may fall to either side.
        assert ((images[view] - expected).abs() < 1e-5).float().mean() > 0.99


def test_order_of_points_and_other_clouds_do_not_matter() -> None:
    network = MVCNN().eval()
    cloud = clouds(300)
    shuffled = cloud[:, torch.randperm(300, generator=torch.Generator().manual_seed(2))]
    with torch.no_grad():
        logits = network(cloud)
        torch.testing.assert_close(network(shuffled), logits)
        torch.testing.assert_close(network(cloud[1:]), logits[1:], atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("autocast", [False, True])
def test_every_parameter_gets_a_finite_gradient(autocast: bool) -> None:
    network = MVCNN().train()
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=autocast):
        loss, logits = network.training_loss(clouds(256, 4), torch.tensor([0, 1, 2, 1]), 0.1)
    loss.backward()
    assert logits.dtype == torch.float32
    assert all(p.grad is not None and p.grad.isfinite().all() for p in network.parameters())
