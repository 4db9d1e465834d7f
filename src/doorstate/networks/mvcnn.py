# SPDX-License-Identifier: Apache-2.0
"""Multi-view CNN: depth images of the cloud from fixed virtual cameras, one small CNN for all, the maximum over views.

After Su et al. 2015 (arXiv:1505.00880) and its use for doors by Koo et al. 2021, reconstructed from what is known.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.ops import full_precision
from doorstate.networks.layers import classification_head

# Azimuth and elevation of the cameras in degrees. Chosen: a depth camera sees the front of things only, so the
# views lie on its side, spread until the leaf is seen edge-on from one of them, and one looks down.
VIEWS_DEG = ((0, 0), (-60, 15), (-30, 15), (30, 15), (60, 15), (0, 45), (0, 89.9))
PIXELS = 64
HALF_WIDTH = 1.25  # of the picture in units of the cloud: 3.75 m to each side of its centre
WIDTHS = (16, 32, 64, 128)


class MVCNN(PointNetwork):
    """Shared CNN over depth images from fixed views.

    Args:
        num_classes: number of logits.
        pixels: height and width of the images.
    """

    feature_size = 256

    def __init__(self, num_classes: int = 3, *, pixels: int = PIXELS) -> None:
        super().__init__()
        self.pixels = pixels
        self.register_buffer("turn", _turns(), persistent=False)  # (V, 3, 3)
        layers: list[nn.Module] = []
        channels = 2
        for width in WIDTHS:
            layers += [
                nn.Conv2d(channels, width, 3, padding=1, bias=False),
                nn.BatchNorm2d(width),
                nn.ReLU(inplace=True),
                nn.MaxPool2d(2),
            ]
            channels = width
        # The place in the picture matters here: averaging it away would lose the leaf's angle.
        side = pixels // 2 ** len(WIDTHS)
        self.cnn = nn.Sequential(*layers, nn.Flatten(), nn.Linear(channels * side**2, self.feature_size))
        self.head = classification_head(self.feature_size, num_classes, dropout=0.5)

    @torch.no_grad()
    def render(self, points: Tensor) -> Tensor:
        """(B, V, 2, H, W) images of (B, N, 3) points: whether a point is there, and how near the nearest is, 0 to 1."""
        with full_precision(points):
            turn = self.get_buffer("turn").to(points.dtype)
            seen = torch.einsum("vij,bnj->bvni", turn, points)  # depth, left, up
        place = ((1 - seen[..., 1:] / HALF_WIDTH) / 2 * self.pixels).floor().long()  # column, row
        inside = ((place >= 0) & (place < self.pixels)).all(dim=-1)
        column, row = place.clamp(0, self.pixels - 1).unbind(dim=-1)
        pixel = row * self.pixels + column
        nearness = ((HALF_WIDTH - seen[..., 0]) / (2 * HALF_WIDTH)).clamp(0, 1) * inside
        empty = points.new_zeros(*pixel.shape[:2], self.pixels**2)
        filled = empty.scatter_reduce(2, pixel, inside.to(points.dtype), "amax")
        near = empty.scatter_reduce(2, pixel, nearness, "amax")
        return torch.stack([filled, near], dim=2).reshape(*pixel.shape[:2], 2, self.pixels, self.pixels)

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Features (B, 256) are the maximum over the views."""
        images = self.render(points)
        features: Tensor = self.cnn(images.flatten(0, 1).contiguous(memory_format=torch.channels_last))
        return Encoding(features.reshape(*images.shape[:2], self.feature_size).amax(dim=1))


def _turns() -> Tensor:
    """(V, 3, 3) rotations from the cloud's axes to each camera's: depth along its view, left, up."""
    turns = []
    for azimuth_deg, elevation_deg in VIEWS_DEG:
        a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
        ahead = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), -math.sin(e))
        left = (-math.sin(a), math.cos(a), 0.0)
        up = (math.sin(e) * math.cos(a), math.sin(e) * math.sin(a), math.cos(e))
        turns.append((ahead, left, up))
    return torch.tensor(turns)
