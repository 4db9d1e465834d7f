# SPDX-License-Identifier: Apache-2.0
"""Index of a maximum along axis 1, and scattering to such indices.

On a CPU, `torch.max` with indices over an axis that is not the last compares one value at a time. The index is
therefore found by vectorised passes: the smallest slot number among those whose value equals the maximum.
"""

from __future__ import annotations

import torch
from torch import Tensor

from doorstate.networks.kernels.pieces import on_cpu

_BITS = {2: torch.int16, 4: torch.int32, 8: torch.int64}


def first_winner(values: Tensor) -> tuple[Tensor, Tensor]:
    """Return the (G, C) maximum over axis 1 of (G, K, C) values, and the first index that has it, int64."""
    if not on_cpu(values):
        largest, winner = values.max(1)  # torch documents the index of the first maximum
        return largest, winner
    num_points = values.shape[1]
    largest = values.amax(1, keepdim=True)
    if values.element_size() > 2:
        slots = torch.arange(num_points, dtype=values.dtype, device=values.device).view(1, -1, 1)
        behind = (largest - values).sign_()  # 0 where a value is the largest, else 1
        winner = torch.add(slots, behind, alpha=num_points).amin(1)
    else:  # too few digits to count with
        kind = torch.int8 if num_points < 2**7 else torch.int16 if num_points < 2**15 else torch.int32
        from_end = torch.arange(num_points, 0, -1, dtype=kind, device=values.device).view(1, -1, 1)
        equals_largest = (values.view(torch.int16) == largest.view(torch.int16)).view(torch.int8)
        winner = num_points - (equals_largest * from_end).amax(1)
    return largest.squeeze(1), winner.long().clamp_(0, num_points - 1)  # NaN equals nothing


def put_along(values: Tensor, places: Tensor, new: Tensor) -> None:
    """Scatter along axis 1 in place; as integers, because torch scatters bfloat16 four times as slowly."""
    bits = _BITS[values.element_size()]
    values.view(bits).scatter_(1, places, new.view(bits))
