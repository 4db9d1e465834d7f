# SPDX-License-Identifier: Apache-2.0
"""Points within a ball, against loops and cases worked by hand."""

from __future__ import annotations

from unittest.mock import patch

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.networks.kernels.ball_query import ball_query
from doorstate.networks.kernels.gather import gather_rows
from tests.networks import plain
from tests.networks.twins import random_rows

# On a line, so that every distance is exact; farthest-point order does not matter here.
LINE = torch.tensor([[[x, 0.0, 0.0] for x in (0.0, 0.125, 0.375, 0.0625, 0.25)]])


@pytest.mark.parametrize(
    ("radius", "num_samples", "expected"),
    [
        (0.25, 4, [0, 1, 3, 0]),  # the point at exactly the radius is outside
        (0.25, 2, [0, 1]),  # first in index order, not the nearest, 0 and 3
        (1e-6, 3, [0, 0, 0]),
        (9.0, 7, [0, 1, 2, 3, 4, 0, 0]),  # more slots than points
    ],
)
def test_ball_query_by_hand(radius: float, num_samples: int, expected: list[int]) -> None:
    assert ball_query(LINE[:, :1], LINE, radius, num_samples).tolist() == [[expected]]


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from([0.1, 0.5, 1.0, 3.0]), st.integers(1, 12))
def test_ball_query_equals_its_plain_twin(seed: int, radius: float, num_samples: int) -> None:
    points = (
        random_rows(2, 10, 3, seed=seed) * 4
    ).round().double() / 4  # a grid: duplicates and distances at the edge
    centres = points[:, :4]
    expected = plain.ball_query(centres, points, radius, num_samples)
    assert torch.equal(ball_query(centres, points, radius, num_samples), expected)
    with patch("torch.compiler.is_exporting", return_value=True):
        assert torch.equal(ball_query(centres, points, radius, num_samples), expected)


def test_a_centre_is_at_zero_offset_in_its_own_ball() -> None:
    points = random_rows(2, 50, 3)
    indices = ball_query(points[:, :8], points, 0.8, 50)
    offsets = gather_rows(points, indices) - points[:, :8].unsqueeze(2)
    own = indices == torch.arange(8).view(1, 8, 1)
    assert own.any(-1).all()
    assert (offsets[own] == 0).all()
