# SPDX-License-Identifier: Apache-2.0
"""Doors that a camera sees, matched to the doors of a list.

All doors of a view are matched together, because one error of the camera's pose moves all of them: a hypothesis pairs
each seen door with a door of the list or with none, and its cost is the least sum, over all errors of the camera's
pose, of the squared deviations of place, direction and width in standard errors and of the pose's own. Sources: the
joint compatibility test of Neira & Tardos 2001, "Data association in stochastic mapping using the joint compatibility
test"; gates and costs of unmatched doors are quantiles of chi-squared distributions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.doors.camera_place import CameraPlace
from doorstate.doors.named_door import NamedDoor
from doorstate.inference.door import Door

Floats = NDArray[np.float64]

GATE = 16.25  # 99.7 % of chi-squared with four degrees of freedom: of one pair, and the cost of an unmatched door
MARGIN = 6.0  # between two hypotheses: the worse one is e^3 = 20 times less likely
# Chosen: standard errors of doors that give none, and least ones. Tails of the finder's errors are longer than normal.
_USUAL_M, _USUAL_DEG = 0.15, 6.0
_LEAST_M, _LEAST_DEG = 0.06, 4.0
_INFLATION = 1.5
_WIDTH_M = 0.25
_BEHIND_M = 0.1  # of the place of a door seen from behind, through a wall whose thickness is a guess
_LEAST_POSE_M, _LEAST_POSE_DEG = 0.01, 0.2
_MAX_OPTIONS = 6  # doors of the list that one seen door is compared with


class Match(NamedTuple):
    """Door of the list that a seen door is.

    Attributes:
        door: number in the list; None for a door that is not in it, or that cannot be told.
        candidates: numbers of several doors that it may be, with none of them matched.
    """

    door: int | None
    candidates: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Pair:
    """A door of the list that a seen door may be; coordinates of the camera, radians."""

    number: int
    deviation: Floats  # (3,) of x, y and yaw, seen less expected
    slopes: Floats  # (3, 3) of the expected x, y, yaw by the camera's error x, y, yaw
    weights: Floats  # (3,) inverse variances without that error
    width_cost: float

    @cached_property
    def information(self) -> Floats:
        """(3, 3) information about the error of the camera's pose."""
        found: Floats = self.slopes.T @ (self.weights[:, None] * self.slopes)
        return found

    @cached_property
    def pull(self) -> Floats:
        """(3,) information times the error that this pair alone suggests."""
        found: Floats = self.slopes.T @ (self.weights * self.deviation)
        return found

    @cached_property
    def cost(self) -> float:
        """Cost without an error of the camera's pose."""
        return float(self.deviation @ (self.weights * self.deviation)) + self.width_cost


class _Hypothesis(NamedTuple):
    numbers: tuple[int | None, ...]  # door of the list for each seen door
    cost: float


def match_doors(seen: Sequence[Door], named: Sequence[NamedDoor], camera: CameraPlace) -> list[Match]:
    """Return for each seen door which of the list it is.

    A door that two doors of the list explain nearly as well is neither of them, and so are two that are both nearly as
    good for one door of the list.

    Args:
        seen: doors in the level sensor frame.
        named: doors of the list, those of other frames than the camera's among them.
        camera: pose of the camera, with its errors.
    """
    options = [_options(door, named, camera) for door in seen]
    hypotheses = _hypotheses(options, _pose_information(camera))
    best = min(hypotheses, key=lambda hypothesis: hypothesis.cost)
    rivals = [hypothesis for hypothesis in hypotheses if hypothesis.cost < best.cost + MARGIN]
    return [_match(index, best, rivals) for index in range(len(seen))]


def expected_door(door: NamedDoor, camera: CameraPlace) -> tuple[float, float, float]:
    """Return x, y and yaw of a door of the list as the camera should see it, in the level sensor frame."""
    face = door.face_towards(camera.pose.x_m, camera.pose.y_m)
    return tuple(camera.pose.inverse().after(face))  # type: ignore[return-value]


def _match(index: int, best: _Hypothesis, rivals: Sequence[_Hypothesis]) -> Match:
    number = best.numbers[index]
    if number is None:
        return Match(None)
    possible = {rival.numbers[index] for rival in rivals} - {None}
    is_rivalled = any(number in rival.numbers[:index] + rival.numbers[index + 1 :] for rival in rivals)
    if len(possible) > 1 or is_rivalled:
        return Match(None, tuple(sorted(other for other in possible if other is not None)))
    return Match(number)


def _hypotheses(options: Sequence[Sequence[_Pair]], prior: Floats) -> list[_Hypothesis]:
    """Return all hypotheses that are at most the margin worse than the best, and some others."""
    found: list[_Hypothesis] = []
    bound = math.inf

    def extend(numbers: tuple[int | None, ...], information: Floats, pull: Floats, cost: float) -> None:
        nonlocal bound
        total = cost - float(pull @ np.linalg.solve(information, pull))
        if total >= bound:  # costs only grow
            return
        if len(numbers) == len(options):
            found.append(_Hypothesis(numbers, total))
            bound = min(bound, total + MARGIN)
            return
        for pair in options[len(numbers)]:
            if pair.number not in numbers:
                extend(
                    (*numbers, pair.number),
                    information + pair.information,
                    pull + pair.pull,
                    cost + pair.cost,
                )
        extend((*numbers, None), information, pull, cost + GATE)

    extend((), prior, np.zeros(3), 0.0)
    return found


def _pose_information(camera: CameraPlace) -> Floats:
    position_m = max(camera.position_error_m, _LEAST_POSE_M)
    yaw = math.radians(max(camera.yaw_error_deg, _LEAST_POSE_DEG))
    return np.diag([position_m**-2, position_m**-2, yaw**-2])


def _options(seen: Door, named: Sequence[NamedDoor], camera: CameraPlace) -> list[_Pair]:
    """Return the doors of the list that a seen door may be, the likeliest first."""
    prior = _pose_information(camera)
    costs = []
    for pair in _pairs(seen, named, camera):
        alone = pair.cost - float(pair.pull @ np.linalg.solve(prior + pair.information, pair.pull))
        if alone <= GATE:
            costs.append((alone, pair.number, pair))
    return [pair for _, _, pair in sorted(costs, key=lambda cost: cost[:2])[:_MAX_OPTIONS]]


def _pairs(seen: Door, named: Sequence[NamedDoor], camera: CameraPlace) -> Iterator[_Pair]:
    error_m = _INFLATION * max(_LEAST_M, _USUAL_M if seen.position_error_m is None else seen.position_error_m)
    error_deg = _INFLATION * max(_LEAST_DEG, _USUAL_DEG if seen.yaw_error_deg is None else seen.yaw_error_deg)
    pose_m = max(camera.position_error_m, _LEAST_POSE_M)
    for number, door in enumerate(named):
        if door.frame != camera.frame:
            continue
        behind_m = 0.0 if door.is_front(camera.pose.x_m, camera.pose.y_m) else _BEHIND_M
        variance = error_m**2 + door.position_error_m**2 + behind_m**2
        x_m, y_m, yaw_deg = expected_door(door, camera)
        # Of most doors of a long list: an error of the heading moves no door nearer.
        if math.hypot(x_m, y_m) > seen.distance_m + math.sqrt(GATE * (variance + pose_m**2)):
            continue
        turn = math.radians(math.remainder(seen.yaw_deg - yaw_deg, 360.0))
        yield _Pair(
            number,
            np.array([seen.x_m - x_m, seen.y_m - y_m, turn]),
            np.array([[-1.0, 0.0, y_m], [0.0, -1.0, -x_m], [0.0, 0.0, -1.0]]),
            np.array([1 / variance, 1 / variance, math.radians(error_deg) ** -2]),
            ((seen.width_m - door.width_m) / _WIDTH_M) ** 2,
        )
