# SPDX-License-Identifier: Apache-2.0
"""Random openings of a door, and the state that an opening belongs to."""

from __future__ import annotations

from itertools import pairwise

from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.door import Door, Opening
from doorstate.types import UNKNOWN_STATE, DoorState, LabelledState

# Angles of the active leaf, and shares of a sliding leaf's way; between the ranges a state is ambiguous.
ANGLES_DEG = {DoorState.CLOSED: (0.0, 3.0), DoorState.SEMI_OPEN: (15.0, 65.0), DoorState.OPEN: (75.0, 115.0)}
SHARES = {DoorState.CLOSED: (0.0, 0.03), DoorState.SEMI_OPEN: (0.20, 0.65), DoorState.OPEN: (0.80, 1.0)}
_WIDE_DEG = 170.0
_WIDE_CHANCE, _PASSIVE_OPEN_CHANCE = 0.2, 0.3


def draw_openings(stream: Stream, door: Door, free_deg: float) -> list[Opening]:
    """Draw one opening for each state; one in five hinged doors that turn beyond 115 degrees is wide open."""
    openings = []
    for state in DoorState:
        low, high = SHARES[state] if door.opens_by_share else ANGLES_DEG[state]
        if state is DoorState.OPEN and not door.opens_by_share:
            wide = stream.chance(_WIDE_CHANCE) and free_deg > high
            low, high = (high, min(_WIDE_DEG, free_deg)) if wide else (low, min(high, free_deg))
        passive = 0.0
        if door.is_double and state is DoorState.OPEN and stream.chance(_PASSIVE_OPEN_CHANCE):
            passive = stream.uniform(ANGLES_DEG[state][0], min(ANGLES_DEG[state][1], free_deg))
        openings.append(_opening(door, stream.uniform(low, high), passive))
    return openings


def draw_any_openings(stream: Stream, door: Door, free_deg: float) -> list[Opening]:
    """Draw one opening from each third of the way from closed to 115 degrees, or to the angle the door is free to."""
    farthest = 1.0 if door.opens_by_share else min(ANGLES_DEG[DoorState.OPEN][1], free_deg)
    edges = [farthest * third / 3 for third in range(4)]
    return [_opening(door, stream.uniform(low, high), 0.0) for low, high in pairwise(edges)]


def state_of(door: Door, opening: Opening) -> tuple[LabelledState, bool]:
    """Return the state whose range is nearest to the active leaf, and True if the leaf lies outside of that range.

    The state of folding and revolving doors is unknown.
    """
    if not door.has_state:
        return UNKNOWN_STATE, False
    value, ranges = (opening.share, SHARES) if door.is_sliding else (opening.angle_deg, ANGLES_DEG)
    gap = {state: max(low - value, value - high, 0.0) for state, (low, high) in ranges.items()}
    # Beyond the range of open a door is wide open, which is not ambiguous.
    state = min(gap, key=gap.__getitem__)
    return state, gap[state] > 0 and not (state is DoorState.OPEN and value > ranges[state][1])


def _opening(door: Door, value: float, passive_deg: float) -> Opening:
    if door.opens_by_share:
        return Opening(share=value)
    return Opening(angle_deg=value, passive_angle_deg=passive_deg)
