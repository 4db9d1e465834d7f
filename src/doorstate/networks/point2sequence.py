# SPDX-License-Identifier: Apache-2.0
"""Point2Sequence: growing areas around a point, read as a sequence with attention.

Liu et al., 2019, arXiv:1811.02565, figure 2.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.errors import unknown_name
from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.gather import first_rows, gather_rows
from doorstate.networks.kernels.knn import knn
from doorstate.networks.layers.batch_norm import RowBatchNorm, set_batchnorm
from doorstate.networks.layers.dense import Dense, classification_head, glorot
from doorstate.networks.layers.point_mlp import PooledMLP

NUM_CENTRES = 384
WIDTH = 128
AREAS = {16: (32, 64, WIDTH), 32: (64, 64, WIDTH), 64: (64, 64, WIDTH), 128: (128, 128, WIDTH)}
"""Layer widths by the number of points of an area."""
REGION_FEATURES = ("attention", "released")

State = tuple[Tensor, Tensor]
"""Hidden and cell state, (..., hidden) each."""


class LSTMCell(nn.Module):
    """LSTM cell as in TensorFlow: one weight for [input; hidden], one bias, 1 added to the forget gate."""

    def __init__(self, in_channels: int, hidden: int) -> None:
        super().__init__()
        self.linear = glorot(nn.Linear(in_channels + hidden, 4 * hidden))

    def forward(self, inputs: Tensor, state: State | None = None) -> State:
        """Return the state after one step.

        Args:
            inputs: (..., C) first channels of the input; the remaining channels are zero.
            state: state before; zero if None.
        """
        rows = inputs if state is None else torch.cat([inputs, state[0]], dim=-1)
        # Zeros meet the last columns of the weight: both are left out.
        gates = functional.linear(rows, self.linear.weight[:, : rows.shape[-1]], self.linear.bias)
        input_gate, forget_gate, candidate, output_gate = gates.chunk(4, dim=-1)
        cell = torch.sigmoid(input_gate) * torch.tanh(candidate)
        if state is not None:
            cell = cell + torch.sigmoid(forget_gate + 1) * state[1]
        return torch.sigmoid(output_gate) * torch.tanh(cell), cell


class Attention(nn.Module):
    """Additive attention of one query over a memory (Bahdanau et al., 2015)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.memory = glorot(nn.Linear(width, width, bias=False))
        self.query = glorot(nn.Linear(width, width, bias=False))
        self.score = glorot(nn.Linear(width, 1, bias=False))
        self.combine = glorot(nn.Linear(2 * width, width, bias=False))

    def weights(self, memory: Tensor, query: Tensor) -> Tensor:
        """Return the (..., T) weights, which sum to one, of a (..., T, W) memory for a (..., W) query."""
        scores: Tensor = self.score(torch.tanh(self.memory(memory) + self.query(query).unsqueeze(-2)))
        return torch.softmax(scores.squeeze(-1), dim=-1)

    def forward(self, memory: Tensor, query: Tensor) -> Tensor:
        """Return the (..., W) attention vector, a linear map of the query and the weighted memory."""
        context = (self.weights(memory, query).unsqueeze(-1) * memory).sum(dim=-2)  # (..., W)
        vector: Tensor = self.combine(torch.cat([query, context], dim=-1))
        return vector


class Point2Sequence(PointNetwork):
    """Point2Sequence for classification.

    Args:
        num_classes: number of logits.
        region_feature: "attention" takes the attention vector; "released" the decoder's hidden state, as in the
            authors' code, where attention never reaches the output.
        dilation: every how many of the nearest points belong to an area.
        batchnorm_eps: epsilon of every batch normalisation; 1e-3 in the original.

    Raises:
        ConfigError: unknown region feature.
    """

    feature_size = 1024

    def __init__(
        self,
        num_classes: int = 3,
        *,
        region_feature: str = "attention",
        dilation: int = 1,
        batchnorm_eps: float = 1e-5,
    ) -> None:
        super().__init__()
        if region_feature not in REGION_FEATURES:
            raise unknown_name("point2sequence region_feature", region_feature, REGION_FEATURES)
        self.region_feature = region_feature
        self.dilation = dilation
        self.num_centres = NUM_CENTRES
        self.mlps = nn.ModuleList([PooledMLP(0, channels) for channels in AREAS.values()])
        self.encoder = LSTMCell(WIDTH, WIDTH)
        self.decoder = LSTMCell(2 * WIDTH, WIDTH)  # input: [encoder state; previous attention]
        self.attention = Attention(WIDTH)
        self.region = nn.Sequential(RowBatchNorm(WIDTH), nn.ReLU(), Dense(WIDTH, WIDTH))
        self.globals = PooledMLP(WIDTH, (256, 512, 1024))
        self.head = classification_head(self.feature_size, num_classes, dropout=0.6)
        set_batchnorm(self, eps=batchnorm_eps)

    def use_centres(self, share: float) -> None:
        self.num_centres = max(1, round(share * NUM_CENTRES))

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """Return one (B, M, 128): sorted neighbours of the centres; the areas are the first 16, 32, 64 and all 128."""
        largest = max(AREAS)
        # Deviation: with fewer than 128 * dilation points the dilation shrinks.
        count = points.shape[1]
        dilation = self.dilation if count >= largest * self.dilation else count // largest
        return (knn(first_rows(points, self.num_centres), points, largest * dilation)[..., ::dilation],)

    def sequence(self, points: Tensor, neighbours: Tensor) -> Tensor:
        """Return the (B, M, 4, 128) features of the areas, smallest first; neighbours are (B, M, 128)."""
        offsets = gather_rows(points, neighbours)  # (B, M, 128, 3)
        offsets = offsets - first_rows(points, self.num_centres).unsqueeze(2)
        areas = [mlp(offsets[:, :, :size]) for size, mlp in zip(AREAS, self.mlps, strict=True)]  # (B, M, 128)
        return torch.stack(areas, dim=2)

    def encode_decode(self, sequence: Tensor) -> tuple[Tensor, Tensor]:
        """Return the encoder states (B, M, 4, 128) and the decoder's hidden state (B, M, 128) of a sequence."""
        state: State | None = None
        memory = []
        for step in sequence.unbind(dim=2):
            state = self.encoder(step, state)
            memory.append(state[0])
        hidden, _ = self.decoder(memory[-1])  # one step; the previous attention is zero
        return torch.stack(memory, dim=2), hidden

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Encode (B, N, 3) points; the last level sees absolute coordinates of the centres."""
        (neighbours,) = neighbourhoods or self.neighbourhoods(points)  # (B, M, 128)
        areas = self.sequence(points, neighbours)  # (B, M, 4, 128)
        memory, hidden = self.encode_decode(areas)  # (B, M, 4, 128), (B, M, 128)
        region = self.attention(memory, hidden) if self.region_feature == "attention" else hidden
        region = self.region(region)  # (B, M, 128)
        centres = first_rows(points, self.num_centres)  # (B, M, 3)
        return Encoding(self.globals(centres, region))  # (B, 1024), the maximum over the centres
