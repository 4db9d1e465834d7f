# SPDX-License-Identifier: Apache-2.0
"""Interface of a rule, its result and its detections."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from doorstate._models import FrozenModel
from doorstate.clouds.measured import is_measured
from doorstate.types import DoorState, Points


@dataclass(frozen=True, eq=False)
class Detection:
    """Feature of a cloud, to draw over it: one point is a corner, two an edge, more an outline."""

    name: str  # wall, leaf, opening, jamb, corner, ...
    points_m: NDArray[np.float64]  # (K, 3) sensor frame


@dataclass(frozen=True, eq=False)
class RuleResult:
    """State of a door, or the reason why there is none, and further estimates of the rule."""

    state: DoorState | None
    reason: str = ""  # why there is no state; empty with a state
    opening_angle_deg: float | None = None  # between leaf and wall: 0 is closed
    opening_width_m: float | None = None
    open_or_not: bool | None = None  # set by rules that separate open doors from all others
    detections: tuple[Detection, ...] = ()

    @classmethod
    def abstain(cls, reason: str, *detections: Detection) -> RuleResult:
        """Return a result without a state."""
        return cls(None, reason, detections=detections)


class Parameters(FrozenModel):
    """Base of the parameters of every rule: frozen, names with units; a comment gives the source of each value."""


P = TypeVar("P", bound=Parameters)


class Rule(ABC, Generic[P]):
    """Deterministic method: the same cloud gives the same result.

    Args:
        parameters: parameters of the rule; None takes its defaults.
    """

    name: ClassVar[str]
    source: ClassVar[str]  # publication or practice that the rule reconstructs
    defaults: ClassVar[type[Parameters]]

    def __init__(self, parameters: P | None = None) -> None:
        self.parameters: P = parameters or cast(P, self.defaults())

    @abstractmethod
    def __call__(self, cloud: Points) -> RuleResult:
        """Return the state of the door in a cloud.

        Args:
            cloud: (N, 3) or organized (H, W, 3) metres, x forward, y left, z up, NaN where nothing was measured.
        """


def state_by_angle(angle_deg: float, closed_below_deg: float, open_above_deg: float) -> DoorState:
    """Return the state of a leaf by its angle to the wall; semi-open at both limits."""
    if angle_deg < closed_below_deg:
        return DoorState.CLOSED
    return DoorState.OPEN if angle_deg > open_above_deg else DoorState.SEMI_OPEN


def measured_points(cloud: Points) -> NDArray[np.float64]:
    """Return the (M, 3) measured points of a flat or organized cloud."""
    flat = np.asarray(cloud, dtype=np.float64).reshape(-1, 3)
    measured: NDArray[np.float64] = flat[is_measured(flat)]
    return measured
