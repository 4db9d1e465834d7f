# SPDX-License-Identifier: Apache-2.0
"""Targets of the mixture: their bounds, and the published values of PointNet++."""

from __future__ import annotations

import math

import pytest
from paper.pages.targets import TARGETS, Estimate


def test_a_bound_is_a_least_or_a_greatest_value() -> None:
    at_least, at_most = TARGETS[0], TARGETS[4]
    assert (at_least.bound, at_most.bound) == (0.97, 3)
    assert [at_least.is_reached(Estimate(value)) for value in (0.96, 0.97, math.nan)] == [False, True, False]
    assert [at_most.is_reached(Estimate(value)) for value in (3.0, 3.1, math.nan)] == [True, False, False]
    assert at_most.is_undecided(Estimate(2.0, 1.5))
    assert not at_most.is_undecided(Estimate(2.0, 0.5))


@pytest.mark.parametrize(
    ("index", "value"),
    [
        (0, 0.9080),
        (2, 0.9269),
        (3, 0.9721),
        (4, 2.7),
        (5, 9.9),
        (6, 78.8),
        (7, 90.0),
        (8, 13.2),
        (9, 2.0),
        (11, -2.7),
    ],
)
def test_published_values_of_pointnet2(index: int, value: float) -> None:
    target = TARGETS[index]
    estimate = target.measure(target.results(), "pointnet2", target.chosen)
    assert round(estimate.value, target.digits) == value


def test_the_accuracy_lost_has_an_interval() -> None:
    target = TARGETS[10]
    estimate = target.measure(target.results(), "pointnet2", target.chosen)
    assert (round(estimate.value, 1), round(estimate.margin, 1)) == (0.1, 7.7)
