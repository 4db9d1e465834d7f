# SPDX-License-Identifier: Apache-2.0
"""Lines in plan view: robust fit, distances, feet and intersections."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.doorways.plan_lines import Line, fit_line, strongest_line
from tests.doorways import plain_walls

DIAGONAL = Line(np.array([2.0, 0.0]), np.array([0.6, 0.8]))


def test_the_longest_or_heaviest_line_wins() -> None:
    along = np.linspace(-1, 1, 60)[:, None]
    long = np.array([3.0, 0.0]) + along * np.array([0.0, 1.0])
    short = np.array([2.0, 0.0]) + along[:40] * np.array([0.6, 0.8])
    points = np.concatenate([long, short])
    found = strongest_line(points, 0.01)
    assert found is not None
    assert found[0].angle_deg(Line(np.zeros(2), np.array([0.0, 1.0]))) < 0.5
    assert found[1][:60].all()
    heavy = strongest_line(points, 0.01, np.repeat([1.0, 5.0], [60, 40]))
    assert heavy is not None
    assert heavy[0].angle_deg(DIAGONAL) < 0.5


@pytest.mark.parametrize("points", [np.empty((0, 2)), np.ones((1, 2)), np.ones((9, 2))])
def test_fewer_than_two_distinct_points_have_no_line(points: np.ndarray) -> None:
    assert strongest_line(points, 0.01) is None


def test_a_fitted_line_goes_through_its_points() -> None:
    points = np.array([[1.0, 1.0], [2.0, 3.0], [3.0, 5.0]])
    np.testing.assert_allclose(fit_line(points).behind_m(points), 0.0, atol=1e-12)


def test_behind_is_away_from_the_camera() -> None:
    assert DIAGONAL.behind_m(np.array([[5.0, 0.0]]))[0] == pytest.approx(2.4)
    assert DIAGONAL.behind_m(np.zeros((1, 2)))[0] == pytest.approx(-1.6)


def test_foot_and_crossing_are_on_the_line() -> None:
    np.testing.assert_allclose(DIAGONAL.foot(np.array([2.8, -0.6])), [2.0, 0.0], atol=1e-12)
    across = Line(np.array([0.0, 1.6]), np.array([1.0, 0.0]))
    np.testing.assert_allclose(DIAGONAL.crossing(across), [3.2, 1.6])


@pytest.mark.parametrize("has_weights", [False, True])
def test_a_line_of_least_squares_equals_that_of_the_covariance(has_weights: bool) -> None:
    rng = np.random.default_rng(0)
    for count in (2, 3, 40, 700):
        points = rng.normal(size=(count, 2)) @ rng.normal(size=(2, 2))
        weights = rng.random(count) if has_weights else None
        line, plain = fit_line(points, weights), plain_walls.fit_line(points, weights)
        assert line.centre.tolist() == plain.centre.tolist()
        assert line.direction.tolist() == plain.direction.tolist()
