# SPDX-License-Identifier: Apache-2.0
"""Doors of many kinds drawn from the ranges of the data card, and how far they are open."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

from doorstate.simulation.doors import DoorKind, Opening, VariedDoor
from doorstate.simulation.draws import Draws
from doorstate.simulation.handles import Handle, draw_handle
from doorstate.simulation.scene import Hinge, Swing
from doorstate.types import DoorState

KIND_SHARES: dict[DoorKind, float] = {
    "single": 0.5,
    "double_equal": 0.1,
    "double_unequal": 0.1,
    "sliding": 0.1,
    "glazed": 0.1,
    "full_glass": 0.1,
}
_HINGES: dict[Hinge, float] = {"left": 0.5, "right": 0.5}
_SWINGS: dict[Swing, float] = {"towards": 0.5, "away": 0.5}
# Degrees of the active leaf, and shares of a sliding leaf's way; between the ranges a state is ambiguous.
ANGLES_DEG = {DoorState.CLOSED: (0.0, 3.0), DoorState.SEMI_OPEN: (15.0, 65.0), DoorState.OPEN: (75.0, 115.0)}
SLID_SHARES = {DoorState.CLOSED: (0.0, 0.03), DoorState.SEMI_OPEN: (0.20, 0.65), DoorState.OPEN: (0.80, 1.0)}
WIDE_DEG = 170.0
_WIDE_CHANCE, _PASSIVE_OPEN_CHANCE = 0.2, 0.3
_POCKET_CHANCE, _POCKET_CHEEKS_M = 0.3, 0.04
_PIN_M = 0.005


def draw_door(draws: Draws) -> VariedDoor:
    """A door in its wall; sizes and shares are those of the data card, all assumed."""
    kind = draws.one_of(KIND_SHARES)
    double = kind in ("double_equal", "double_unequal")
    hinge, swing = draws.one_of(_HINGES), draws.one_of(_SWINGS)
    wall = draws.between(0.08, 0.30)
    leaf = draws.between(0.03, 0.04) if kind == "full_glass" else draws.between(0.035, 0.05)
    casing_thickness = draws.between(0.0, 0.025)
    slides = kind == "sliding"
    recess = (
        _sliding_recess(draws, wall, leaf, casing_thickness) if slides else _leaf_recess(draws, wall, leaf)
    )
    share = {"double_equal": 0.5, "double_unequal": draws.between(0.6, 0.72)}.get(kind, 1.0)
    return VariedDoor(
        kind=kind,
        hinge=hinge,
        swing=swing,
        opening_width_m=draws.between(1.25, 2.0) if double else draws.between(0.62, 1.05),
        opening_height_m=draws.one_of({1.98: 1, 2.03: 1, 2.11: 1, draws.between(1.95, 2.25): 1}),
        wall_thickness_m=wall,
        wall_height_m=draws.between(2.4, 3.2),
        leaf_thickness_m=leaf,
        leaf_recess_m=recess,
        # A leaf that lies flush turns past its casing.
        hinge_offset_m=_PIN_M if recess else round(_PIN_M + casing_thickness / 2, 5),
        casing_width_m=draws.between(0.0, 0.10),
        casing_thickness_m=casing_thickness,
        stop_width_m=0.0 if slides else 0.012,
        active_share=share,
        pane_bottom_m=None if kind != "glazed" else draws.one_of({0.2: 1, draws.between(0.8, 1.1): 1}),
        threshold_m=0.0 if draws.chance(0.5) else draws.between(0.0, 0.02),
        handle=_handle(draws, kind, in_pocket=slides and recess > 0),
    )


def draw_openings(draws: Draws, door: VariedDoor, free_deg: float) -> list[Opening]:
    """One opening for each state; doors that turn beyond 115 degrees are wide open in a fifth of the cases."""
    openings = []
    for state in DoorState:
        low, high = SLID_SHARES[state] if door.is_sliding else ANGLES_DEG[state]
        if state is DoorState.OPEN and not door.is_sliding:
            wide = draws.chance(_WIDE_CHANCE) and free_deg > high
            low, high = (high, min(WIDE_DEG, free_deg)) if wide else (low, min(high, free_deg))
        passive = 0.0
        if door.is_double and state is DoorState.OPEN and draws.chance(_PASSIVE_OPEN_CHANCE):
            passive = draws.between(ANGLES_DEG[state][0], min(ANGLES_DEG[state][1], free_deg))
        openings.append(_opening(door, draws.between(low, high), passive))
    return openings


def draw_any_openings(draws: Draws, door: VariedDoor, free_deg: float) -> list[Opening]:
    """One opening from each third of the way from closed to 115 degrees, or as far as the door turns."""
    farthest = 1.0 if door.is_sliding else min(ANGLES_DEG[DoorState.OPEN][1], free_deg)
    edges = [farthest * third / 3 for third in range(4)]
    return [_opening(door, draws.between(low, high), 0.0) for low, high in pairwise(edges)]


def state_of(door: VariedDoor, opening: Opening) -> tuple[DoorState, bool]:
    """The state whose range is nearest to the active leaf, and whether the leaf is outside of that range."""
    value, ranges = (opening.share, SLID_SHARES) if door.is_sliding else (opening.angle_deg, ANGLES_DEG)
    away = {state: max(low - value, value - high, 0.0) for state, (low, high) in ranges.items()}
    # Beyond the range of open is wide open, and nothing else.
    state = min(away, key=lambda one: (away[one], one))
    return state, away[state] > 0 and not (state is DoorState.OPEN and value > ranges[state][1])


def _opening(door: VariedDoor, value: float, passive_deg: float) -> Opening:
    if door.is_sliding:
        return Opening(share=value)
    return Opening(angle_deg=value, passive_angle_deg=passive_deg)


def _leaf_recess(draws: Draws, wall: float, leaf: float) -> float:
    """Flush (50 %), in the wall's middle (20 %) or 0.02-0.12 m deep (30 %), as far as leaf and stop fit."""
    position: Literal["flush", "centred", "recessed"] = draws.one_of(
        {"flush": 0.5, "centred": 0.2, "recessed": 0.3}
    )
    wished = {"flush": 0.0, "centred": (wall - leaf) / 2, "recessed": draws.between(0.02, 0.12)}[position]
    return round(min(wished, max(0.0, wall - leaf - VariedDoor().stop_depth_m)), 4)


def _sliding_recess(draws: Draws, wall: float, leaf: float, casing: float) -> float:
    """In a pocket of the wall (30 %, where the wall is thick enough), or 0.01-0.06 m in front of it and its casing."""
    gap = max(draws.between(0.01, 0.06), casing + _PIN_M)
    in_pocket = draws.chance(_POCKET_CHANCE) and wall >= leaf + _POCKET_CHEEKS_M
    return round((wall - leaf) / 2 if in_pocket else -(gap + leaf), 4)


def _handle(draws: Draws, kind: DoorKind, in_pocket: bool) -> Handle | None:
    if kind in ("sliding", "full_glass"):
        handle = draw_handle(draws, {"bar": 1.0})
        return None if in_pocket else handle
    return draw_handle(draws) if draws.chance(0.9) else None
