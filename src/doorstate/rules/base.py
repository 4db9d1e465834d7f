# SPDX-License-Identifier: Apache-2.0
"""What every rule takes and says: a cloud in, a state or a reason for none out, with what it found on the way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from doorstate._models import FrozenModel
from doorstate.clouds.measured import is_measured
from doorstate.types import DoorState, Points


@dataclass(frozen=True, eq=False)
class Detection:
    """Something found in the cloud, to be drawn over it: one point is a corner, two an edge, more an outline."""

    name: str  # wall, leaf, opening, jamb, corner, ...
    points_m: NDArray[np.float64]  # (K, 3) sensor frame


@dataclass(frozen=True, eq=False)
class RuleResult:
    """A state, or a reason why there is none; and whatever else the rule can tell."""

    state: DoorState | None
    reason: str = ""  # why there is no state; empty with one
    opening_angle_deg: float | None = None  # of the leaf against the wall: 0 is closed
    opening_width_m: float | None = None
    open_or_not: bool | None = None  # of rules that tell open doors from all others
    detections: tuple[Detection, ...] = field(default=())

    @classmethod
    def abstain(cls, reason: str, *found: Detection) -> RuleResult:
        """No state, and why."""
        return cls(None, reason, detections=found)


class Parameters(FrozenModel):
    """Base of every rule's parameters: frozen, named with units; a comment beside each says where it comes from."""


P = TypeVar("P", bound=Parameters)


class Rule(ABC, Generic[P]):
    """One method. Deterministic: the same cloud gives the same answer.

    Args:
        parameters: of the rule; its defaults if not given.
    """

    name: ClassVar[str]
    source: ClassVar[str]  # whose method it reconstructs
    defaults: ClassVar[type[Parameters]]

    def __init__(self, parameters: P | None = None) -> None:
        self.parameters: P = parameters or cast(P, self.defaults())

    @abstractmethod
    def __call__(self, cloud: Points) -> RuleResult:
        """State of the door in a cloud.

        Args:
            cloud: (N, 3), or organized (H, W, 3), metres, x forward, y left, z up, NaN where nothing was measured.
        """


def state_by_angle(angle_deg: float, closed_below_deg: float, open_above_deg: float) -> DoorState:
    """State of a leaf by its angle against the wall; at a limit it is semi-open."""
    if angle_deg < closed_below_deg:
        return DoorState.CLOSED
    return DoorState.OPEN if angle_deg > open_above_deg else DoorState.SEMI_OPEN


def measured(cloud: Points) -> NDArray[np.float64]:
    """(M, 3) points that were measured, of a flat or organized cloud."""
    flat = np.asarray(cloud, dtype=np.float64).reshape(-1, 3)
    kept: NDArray[np.float64] = flat[is_measured(flat)]
    return kept
