# SPDX-License-Identifier: Apache-2.0
"""Matching of seen doors: the joint search against all hypotheses with dense covariances, and the cases it is for."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.doors.camera_place import CameraPlace
from doorstate.doors.matching import GATE, MARGIN, Match, _options, _pairs, expected_door, match_doors
from doorstate.doors.named_door import NamedDoor
from doorstate.doors.plane_pose import PlanePose
from doorstate.inference.door import Door
from tests.doors.examples import AT_ORIGIN, all_maps, named, seen, seen_from


def plain_costs(
    doors: Sequence[Door], list_: Sequence[NamedDoor], camera: CameraPlace
) -> dict[tuple[int | None, ...], float]:
    """Costs of all hypotheses, by the inverse of the covariance of all deviations together."""
    pose = np.diag([camera.position_error_m**2] * 2 + [math.radians(camera.yaw_error_deg) ** 2])
    costs: dict[tuple[int | None, ...], float] = {}
    allowed = [{pair.number for pair in _options(door, list_, camera)} for door in doors]
    for numbers in all_maps(len(doors), tuple(range(len(list_)))):
        pairs = [(seen_, number) for seen_, number in enumerate(numbers) if number is not None]
        if any(number not in allowed[seen_] for seen_, number in pairs):
            continue
        deviations, slopes, noises, total = [], [], [], GATE * numbers.count(None)
        for seen_, number in pairs:
            door, other = doors[seen_], list_[number]
            x_m, y_m, yaw_deg = expected_door(other, camera)
            turn = math.radians(math.remainder(door.yaw_deg - yaw_deg, 360))
            deviations += [door.x_m - x_m, door.y_m - y_m, turn]
            slopes += [[-1, 0, y_m], [0, -1, -x_m], [0, 0, -1]]
            error_m, error_deg = (
                1.5 * max(0.06, door.position_error_m or 0),
                1.5 * max(4.0, door.yaw_error_deg or 0),
            )
            behind_m = 0.0 if other.is_front(*camera.pose[:2]) else 0.1
            noises += [error_m**2 + other.position_error_m**2 + behind_m**2] * 2 + [
                math.radians(error_deg) ** 2
            ]
            total += ((door.width_m - other.width_m) / 0.25) ** 2
        if pairs:
            h, e = np.array(slopes, float), np.array(deviations)
            total += float(e @ np.linalg.solve(np.diag(noises) + h @ pose @ h.T, e))
        costs[numbers] = total
    return costs


def plain_matches(costs: dict[tuple[int | None, ...], float], count: int) -> list[Match]:
    best = min(costs, key=costs.__getitem__)
    rivals = [numbers for numbers, cost in costs.items() if cost < costs[best] + MARGIN]
    matches = []
    for index in range(count):
        number = best[index]
        options = {rival[index] for rival in rivals} - {None}
        others = any(number in (*rival[:index], *rival[index + 1 :]) for rival in rivals)
        if number is None:
            matches.append(Match(None))
        elif len(options) > 1 or others:
            matches.append(Match(None, tuple(sorted(option for option in options if option is not None))))
        else:
            matches.append(Match(number))
    return matches


place = st.tuples(st.floats(1.0, 4.0), st.floats(-2.0, 2.0), st.floats(60, 120))


@given(
    st.lists(place, max_size=3),
    st.lists(place, max_size=4),
    st.floats(0.02, 0.8),
    st.floats(0.3, 12.0),
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-180, 180)),
)
def test_the_search_finds_what_all_hypotheses_give(
    seen_places: list[tuple[float, float, float]],
    list_places: list[tuple[float, float, float]],
    error_m: float,
    error_deg: float,
    pose: tuple[float, float, float],
) -> None:
    camera = CameraPlace(PlanePose(*pose), position_error_m=error_m, yaw_error_deg=error_deg)
    doors = [seen(*place) for place in seen_places]
    list_ = [
        named(f"d{number}", *camera.pose.after(PlanePose(*place))) for number, place in enumerate(list_places)
    ]
    costs = plain_costs(doors, list_, camera)
    ordered = sorted(costs.values())
    # Ties and margins within rounding may go either way.
    close = any(abs(cost - ordered[0] - MARGIN) < 1e-6 for cost in ordered)
    if close or (len(ordered) > 1 and ordered[1] - ordered[0] < 1e-6):
        return
    assert match_doors(doors, list_, camera) == plain_matches(costs, len(doors))


@given(
    place,
    st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-180, 180)), max_size=6),
    st.floats(0, 2),
)
def test_doors_that_are_left_out_for_their_distance_could_not_match(
    seen_place: tuple[float, float, float], list_places: list[tuple[float, float, float]], error_m: float
) -> None:
    camera = AT_ORIGIN._replace(position_error_m=error_m, yaw_error_deg=20.0)
    door = seen(*seen_place)
    list_ = [named(f"d{number}", *place) for number, place in enumerate(list_places)]
    kept = {pair.number for pair in _pairs(door, list_, camera)}
    for number in set(range(len(list_))) - kept:
        x_m, y_m, _ = expected_door(list_[number], camera)
        away = np.array([x_m, y_m]) / math.hypot(x_m, y_m)
        radial_m = float(np.array([door.x_m, door.y_m]) @ away) - math.hypot(x_m, y_m)
        spread = (1.5 * 0.06) ** 2 + 0.05**2 + (0.0 if list_[number].is_front(0, 0) else 0.1) ** 2
        assert radial_m**2 / (spread + max(error_m, 0.01) ** 2) >= GATE * (1 - 1e-9)


def test_neighbours_are_told_apart() -> None:
    list_ = [named("a", 3.0, 0.5), named("b", 3.0, -0.5)]
    for number, door in enumerate(list_):
        assert match_doors([seen_from(AT_ORIGIN, door)], list_, AT_ORIGIN) == [Match(number)]


def test_a_lost_camera_does_not_guess_between_neighbours() -> None:
    list_ = [named("a", 3.0, 0.5), named("b", 3.0, -0.5)]
    lost = AT_ORIGIN._replace(position_error_m=0.5, yaw_error_deg=8.0)
    assert match_doors([seen(3.0, 0.45)], list_, lost) == [Match(None, (0, 1))]


def test_two_doors_together_correct_the_camera() -> None:
    """Each alone may be two doors."""
    list_ = [named("a", 3.0, 0.0), named("b", 3.0, -1.0), named("c", 3.0, -3.0)]
    lost = AT_ORIGIN._replace(position_error_m=0.4, yaw_error_deg=2.0)
    moved_m = 0.9  # all are seen so far to the right
    doors = [seen(3.0, -1.0 - moved_m), seen(3.0, -3.0 - moved_m)]
    assert match_doors(doors, list_, lost) == [Match(1), Match(2)]
    assert match_doors(doors[:1], list_, lost) == [Match(None, (1, 2))]


def test_a_door_that_is_not_in_the_list_is_none_of_it() -> None:
    list_ = [named("a", 3.0, 0.0)]
    assert match_doors([seen(3.0, 1.2), seen(3.0, 0.05)], list_, AT_ORIGIN) == [Match(None), Match(0)]
    assert match_doors([seen(3.0, 0.0, yaw_deg=150.0)], list_, AT_ORIGIN) == [Match(None)]
    other = named("wide", 3.0, 0.0, width_m=2.4)
    assert match_doors([seen(3.0, 0.0)], [other], AT_ORIGIN) == [Match(None)]


def test_two_sights_that_are_as_good_for_one_door_are_neither() -> None:
    list_ = [named("a", 3.0, 0.0)]
    doors = [seen(3.0, 0.12), seen(3.0, -0.1)]
    assert match_doors(doors, list_, AT_ORIGIN._replace(position_error_m=0.3)) == [
        Match(None),
        Match(None, (0,)),
    ]


@pytest.mark.parametrize("yaw_deg", [90.0, -30.0, 180.0])
def test_a_door_is_known_from_behind(yaw_deg: float) -> None:
    door = named("a", 2.0, 1.0, yaw_deg, wall_m=0.3)
    behind = door.place.after(PlanePose(0.4, -2.3, 80.0))
    camera = AT_ORIGIN._replace(pose=behind)
    assert not door.is_front(behind.x_m, behind.y_m)
    x_m, y_m, yaw = expected_door(door, camera)
    assert math.hypot(x_m, y_m) == pytest.approx(math.hypot(0.4, 2.0))
    assert (
        -x_m * math.sin(math.radians(yaw)) + y_m * math.cos(math.radians(yaw)) < 0
    )  # its y axis is towards us
    assert match_doors([seen_from(camera, door)], [door], camera) == [Match(0)]


def test_doors_of_another_map_are_not_compared() -> None:
    door = named("upstairs", 3.0, 0.0, frame="floor-2")
    assert match_doors([seen(3.0, 0.0)], [door], AT_ORIGIN) == [Match(None)]


def test_nothing_seen_is_no_match() -> None:
    assert match_doors([], [named("a", 3.0, 0.0)], AT_ORIGIN) == []
