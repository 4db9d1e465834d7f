# SPDX-License-Identifier: Apache-2.0
"""Doors from the outputs of a network for the crops of one cloud: placed, one for each place, and decided.

A door's probability is that of network and finder together, where the weights are calibrated for it. The network
corrects place, direction and width of each candidate in the doorway's frame. Candidates whose corrected openings
overlap on nearly the same wall are one door: the one that finder and network together hold likeliest. They are rival
proposals, half a metre apart as a rule, so that a mean of them would be beside the door.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from doorstate.doorways.candidate_errors import candidate_errors
from doorstate.doorways.doorway import Doorway
from doorstate.inference.abstention import Abstention
from doorstate.inference.backends.base import CloudOutputs
from doorstate.inference.decode import abstention_of, leaf_fields
from doorstate.inference.door import Door, DoorFrame
from doorstate.inference.pose_errors import Corrected, Correction, weigh_correction
from doorstate.networks.card import HeadErrors, WeightsCard
from doorstate.types import DECISION_THRESHOLD, DOOR, STATES, DoorState

# Chosen: as wide as the finder's usual errors of two candidates of one door; walls of a recess are farther apart.
_SAME_WALL_M, _SAME_WALL_DEG = 0.3, 20.0
_MIN_WIDTH_M = 0.4  # of a door; a network that is unsure of all may give zero
_MIN_OVERLAP = 0.25  # of the narrower opening; neighbouring doors share no more than a jamb


@dataclass(frozen=True)
class Answer:
    """Outputs of a network for the crop of a candidate."""

    doorway: Doorway
    outputs: CloudOutputs  # in the doorway's frame
    is_asked: bool = False  # at the place of a door that is known to be there
    network_errors: HeadErrors | None = None  # None: not measured

    @property
    def door_probability(self) -> float:
        """Probability of a door; 1 without the head for it."""
        return self.outputs.heads.get("p_door", 1.0)

    @property
    def rank(self) -> tuple[bool, float, float]:
        """Order among candidates, the likeliest last: those that are rather a door, then by finder and network."""
        probability = self.door_probability
        return probability >= DECISION_THRESHOLD, probability * self.doorway.score, probability

    @cached_property
    def corrected(self) -> Corrected:
        """Correction of the candidate as it counts, with the errors that are left; none without heads for it."""
        heads, width_m = self.outputs.heads, self.outputs.heads.get("opening_width_m", 0.0)
        wider_m = width_m - self.doorway.width_m if width_m >= _MIN_WIDTH_M else 0.0
        along_m, across_m, yaw_deg = (
            heads.get(name, 0.0) for name in ("door_x_m", "door_y_m", "door_yaw_deg")
        )
        network = self.network_errors if "door_x_m" in heads else None
        return weigh_correction(Correction(along_m, across_m, yaw_deg, wider_m), self.doorway.score, network)

    @cached_property
    def frame(self) -> DoorFrame:
        """Corrected pose in the level sensor frame."""
        along_m, across_m, yaw_deg, _ = self.corrected.correction
        x_m, y_m, _ = self.doorway.to_sensor(np.array([along_m, across_m, 0.0], np.float32)).tolist()
        return DoorFrame(x_m, y_m, _turned(self.doorway.yaw_deg + yaw_deg))

    @property
    def width_m(self) -> float:
        """Corrected width of the opening."""
        return self.doorway.width_m + self.corrected.correction.width_m

    @property
    def leaf(self) -> dict[str, Any]:
        """Angle, hinge and passage, which is no wider than the opening."""
        fields = leaf_fields(self.outputs.heads)
        passable_m = fields["passable_width_m"]
        return fields | {"passable_width_m": None if passable_m is None else min(passable_m, self.width_m)}


class DecidedDoors(NamedTuple):
    """Doors in a cloud, and the candidates that are none."""

    doors: tuple[Door, ...]  # the likeliest first
    refused: tuple[Door, ...]
    known: Door | None  # of the doors, the one that is known to be there


def decide_doors(answers: Sequence[Answer], card: WeightsCard) -> DecidedDoors:
    """Return a door for each group of overlapping candidates.

    The likeliest group at the place of a known door is a door, however improbable. Without the head `door` every
    candidate would be one, so that only the finder's best is answered for.

    Args:
        answers: outputs by candidate.
        card: card of the weights.
    """
    if DOOR not in card.heads:
        answers = sorted(answers, key=lambda answer: (not answer.is_asked, -answer.doorway.score))[:1]
    groups = _group([_calibrate(answer, card) for answer in answers])
    known = next((group for group in groups if any(answer.is_asked for answer in group)), None)
    decided = [(_decide(group, card, group is known), group is known) for group in groups]
    return DecidedDoors(
        tuple(door for door, _ in decided if not _is_no_door(door)),
        tuple(door for door, _ in decided if _is_no_door(door)),
        next((door for door, is_known in decided if is_known), None),
    )


def _calibrate(answer: Answer, card: WeightsCard) -> Answer:
    """Return an answer with the errors of the network, and with the probability of a door by network and finder."""
    heads, calibration = answer.outputs.heads, card.door_calibration
    if calibration is not None and "p_door" in heads:
        pair = (np.array([heads["p_door"]]), np.array([answer.doorway.score]))
        heads = {**heads, "p_door": float(calibration.probabilities(*pair)[0])}
    return replace(answer, outputs=answer.outputs._replace(heads=heads), network_errors=card.errors)


def _is_no_door(door: Door) -> bool:
    return door.abstention is not None and door.abstention.code == "no_door"


def refused_candidate(doorway: Doorway, abstention: Abstention) -> Door:
    """Return a candidate that no network was asked about."""
    errors = candidate_errors(doorway.score)
    return Door(
        doorway.x_m,
        doorway.y_m,
        doorway.yaw_deg,
        doorway.width_m,
        None,
        abstention,
        position_error_m=math.hypot(errors.along_m, errors.across_m),
        yaw_error_deg=errors.yaw_deg,
        floor_z_m=doorway.floor_z_m,
        score=doorway.score,
    )


def _group(answers: Sequence[Answer]) -> list[list[Answer]]:
    """Return the answers by door; the likeliest of each is the first."""
    groups: list[list[Answer]] = []
    for answer in sorted(answers, key=lambda answer: answer.rank, reverse=True):
        for group in groups:
            if _overlap(group[0], answer):
                group.append(answer)
                break
        else:
            groups.append([answer])
    return groups


def _overlap(first: Answer, second: Answer) -> bool:
    """Return True if two openings overlap in plan view and lie on nearly the same wall."""
    (x_m, y_m, yaw_deg), other = first.frame, second.frame
    if abs(_turned(other.yaw_deg - yaw_deg)) > _SAME_WALL_DEG:
        return False
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    along_m = (other.x_m - x_m) * cos + (other.y_m - y_m) * sin
    across_m = (other.y_m - y_m) * cos - (other.x_m - x_m) * sin
    half_m, other_half_m = first.width_m / 2, second.width_m / 2
    shared_m = min(half_m, along_m + other_half_m) - max(-half_m, along_m - other_half_m)
    return abs(across_m) <= _SAME_WALL_M and shared_m >= 2 * _MIN_OVERLAP * min(half_m, other_half_m)


def _decide(group: Sequence[Answer], card: WeightsCard, door_known: bool) -> Door:
    """Return the door of overlapping candidates, with a state or the reason why there is none."""
    answer = group[0]
    x_m, y_m, yaw_deg = answer.frame
    outputs, errors = answer.outputs, answer.corrected.errors
    least = DECISION_THRESHOLD if card.door_calibration is None else card.door_calibration.min_probability
    abstention = abstention_of(outputs, card.abstain_below, door_known=door_known, min_door_probability=least)
    state = DoorState.from_index(int(outputs.probabilities.argmax()))
    door = Door(
        x_m,
        y_m,
        yaw_deg,
        answer.width_m,
        state,
        raw_probabilities=dict(zip(STATES, outputs.probabilities.tolist(), strict=True)),
        door_probability=outputs.heads.get("p_door"),
        **answer.leaf,
        angle_error_deg=None if card.errors is None else card.errors.angle_deg.get(state),
        position_error_m=math.hypot(errors.along_m, errors.across_m),
        yaw_error_deg=errors.yaw_deg,
        floor_z_m=answer.doorway.floor_z_m,
        score=answer.doorway.score,
    )
    return door if abstention is None else door.refuse(abstention)


def _turned(angle_deg: float) -> float:
    """Return an angle from -180 to 180 degrees."""
    return (angle_deg + 180) % 360 - 180
