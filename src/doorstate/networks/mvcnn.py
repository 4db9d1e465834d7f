# SPDX-License-Identifier: Apache-2.0
"""Multi-view CNN: depth images of the cloud from fixed virtual cameras, one small CNN for all, the maximum over views.

After Su et al., 2015 (arXiv:1505.00880), and its use for doors by Koo et al., 2021; widths and views are our choice.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.precision import full_precision
from doorstate.networks.layers.dense import classification_head
from doorstate.networks.layers.rank_norm import normalize_over_ranks

# Azimuth and elevation of the cameras in degrees. A depth camera sees the front of objects only, so the views lie on
# its side, spread until the leaf is seen edge-on from one of them, and one looks down.
VIEWS_DEG = ((0, 0), (-60, 15), (-30, 15), (30, 15), (60, 15), (0, 45), (0, 89.9))
PIXELS = 64
HALF_WIDTH = 1.25  # of the image in units of the cloud: 3.75 m to each side of its centre
WIDTHS = (16, 32, 64, 128)


class ImageBatchNorm(nn.BatchNorm2d):
    """Batch normalisation of (B, C, H, W) images."""

    num_ranks = 1
    """Number of processes that share the batch."""

    def forward(self, images: Tensor) -> Tensor:
        if not (self.training and self.num_ranks > 1):
            return super().forward(images)
        rows = images.movedim(1, -1)  # (B, H, W, C)
        normalized = normalize_over_ranks(self, rows.flatten(0, 2), self.num_ranks)
        return normalized.view(rows.shape).movedim(-1, 1)


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
        self.register_buffer("rotations", _view_rotations(), persistent=False)  # (V, 3, 3)
        layers: list[nn.Module] = []
        channels = 2
        for width in WIDTHS:
            layers += [
                nn.Conv2d(channels, width, 3, padding=1, bias=False),
                ImageBatchNorm(width),
                nn.ReLU(inplace=True),
                nn.MaxPool2d(2),
            ]
            channels = width
        # The position in the image is kept: averaging it away would lose the leaf's angle.
        side = pixels // 2 ** len(WIDTHS)
        self.cnn = nn.Sequential(*layers, nn.Flatten(), nn.Linear(channels * side**2, self.feature_size))
        self.head = classification_head(self.feature_size, num_classes, dropout=0.5)

    @torch.no_grad()
    def render(self, points: Tensor) -> Tensor:
        """Render (B, N, 3) points to (B, V, 2, H, W) images.

        The first channel is 1 where there is a point, the second is the nearness of the nearest one, 0 to 1.
        """
        with full_precision(points):
            rotations = self.get_buffer("rotations").to(points.dtype)
            rotated = torch.einsum("vij,bnj->bvni", rotations, points)  # (B, V, N, 3): depth, left, up
        position = ((1 - rotated[..., 1:] / HALF_WIDTH) / 2 * self.pixels).floor().long()  # column, row
        inside = ((position >= 0) & (position < self.pixels)).all(dim=-1)  # (B, V, N)
        column, row = position.clamp(0, self.pixels - 1).unbind(dim=-1)
        pixel = row * self.pixels + column
        nearness = ((HALF_WIDTH - rotated[..., 0]) / (2 * HALF_WIDTH)).clamp(0, 1) * inside
        empty = points.new_zeros(*pixel.shape[:2], self.pixels**2)  # (B, V, H * W)
        filled = empty.scatter_reduce(2, pixel, inside.to(points.dtype), "amax")
        nearest = empty.scatter_reduce(2, pixel, nearness, "amax")
        return torch.stack([filled, nearest], dim=2).reshape(*pixel.shape[:2], 2, self.pixels, self.pixels)

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Encode (B, N, 3) points."""
        images = self.render(points)  # (B, V, 2, H, W)
        features: Tensor = self.cnn(images.flatten(0, 1).contiguous(memory_format=torch.channels_last))
        features = features.reshape(*images.shape[:2], self.feature_size)  # (B, V, 256)
        return Encoding(features.amax(dim=1))  # the maximum over the views


def _view_rotations() -> Tensor:
    """Return the (V, 3, 3) rotations from the cloud's axes to each camera's: depth along its view, left, up."""
    rotations = []
    for azimuth_deg, elevation_deg in VIEWS_DEG:
        a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
        forward = (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), -math.sin(e))
        left = (-math.sin(a), math.cos(a), 0.0)
        up = (math.sin(e) * math.cos(a), math.sin(e) * math.sin(a), math.cos(e))
        rotations.append((forward, left, up))
    return torch.tensor(rotations)
