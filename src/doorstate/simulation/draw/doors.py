# SPDX-License-Identifier: Apache-2.0
"""Random doors of all kinds; ranges and shares are those of the data card, all assumed."""

from __future__ import annotations

from typing import Literal

from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.door import Door, DoorKind
from doorstate.simulation.scene.handle import Handle, HandleKind
from doorstate.types import Hinge, Swing

KIND_SHARES: dict[DoorKind, float] = {
    "single": 0.5,
    "double_equal": 0.1,
    "double_unequal": 0.1,
    "sliding": 0.1,
    "glazed": 0.1,
    "full_glass": 0.1,
}
WALL_THICKNESS_M, WALL_HEIGHT_M = (0.08, 0.30), (2.4, 3.2)
_HINGES: dict[Hinge, float] = {"left": 0.5, "right": 0.5}
_SWINGS: dict[Swing, float] = {"towards": 0.5, "away": 0.5}
_HANDLES: dict[HandleKind, float] = {"lever": 0.6, "knob": 0.2, "bar": 0.2}
_POCKET_CHANCE, _POCKET_CHEEKS_M = 0.3, 0.04
_PIN_M = 0.005


def draw_door(stream: Stream, wall_m: tuple[float, float] | None = None) -> Door:
    """Draw a door in its wall; thickness and height of the wall are drawn too unless they are given."""
    kind = stream.choice(KIND_SHARES)
    double = kind in ("double_equal", "double_unequal")
    hinge, swing = stream.choice(_HINGES), stream.choice(_SWINGS)
    wall = wall_m[0] if wall_m else stream.uniform(*WALL_THICKNESS_M)
    leaf = stream.uniform(0.03, 0.04) if kind == "full_glass" else stream.uniform(0.035, 0.05)
    casing_thickness = stream.uniform(0.0, 0.025)
    slides = kind == "sliding"
    recess = (
        _draw_sliding_recess(stream, wall, leaf, casing_thickness)
        if slides
        else _draw_recess(stream, wall, leaf)
    )
    share = {"double_equal": 0.5, "double_unequal": stream.uniform(0.6, 0.72)}.get(kind, 1.0)
    # Arguments are drawn in the order they are written in: another order gives other doors for the same seed.
    return Door(
        kind=kind,
        hinge=hinge,
        swing=swing,
        opening_width_m=stream.uniform(1.25, 2.0) if double else stream.uniform(0.62, 1.05),
        opening_height_m=stream.choice({1.98: 1, 2.03: 1, 2.11: 1, stream.uniform(1.95, 2.25): 1}),
        wall_thickness_m=wall,
        wall_height_m=wall_m[1] if wall_m else stream.uniform(*WALL_HEIGHT_M),
        leaf_thickness_m=leaf,
        leaf_recess_m=recess,
        # A flush leaf needs an offset pin to turn past its casing.
        hinge_offset_m=_PIN_M if recess else round(_PIN_M + casing_thickness / 2, 5),
        casing_width_m=stream.uniform(0.0, 0.10),
        casing_thickness_m=casing_thickness,
        stop_width_m=0.0 if slides else 0.012,
        active_share=share,
        pane_bottom_m=None if kind != "glazed" else stream.choice({0.2: 1, stream.uniform(0.8, 1.1): 1}),
        threshold_m=0.0 if stream.chance(0.5) else stream.uniform(0.0, 0.02),
        handle=_draw_door_handle(stream, kind, in_pocket=slides and recess > 0),
    )


def draw_handle(stream: Stream, kinds: dict[HandleKind, float] = _HANDLES) -> Handle:
    """Draw a handle 0.85-1.10 m high that projects 0.05-0.07 m; levers are 0.12-0.14 m, bars 0.3-0.9 m long."""
    kind = stream.choice(kinds)
    return Handle(
        kind=kind,
        height_m=stream.uniform(0.85, 1.10),
        projection_m=stream.uniform(0.05, 0.07),
        length_m=stream.uniform(0.3, 0.9) if kind == "bar" else stream.uniform(0.12, 0.14),
    )


def _draw_recess(stream: Stream, wall: float, leaf: float) -> float:
    """Draw a flush leaf (50 %), one in the wall's middle (20 %) or 0.02-0.12 m deep (30 %), if leaf and stop fit."""
    position: Literal["flush", "centred", "recessed"] = stream.choice(
        {"flush": 0.5, "centred": 0.2, "recessed": 0.3}
    )
    recess = {"flush": 0.0, "centred": (wall - leaf) / 2, "recessed": stream.uniform(0.02, 0.12)}[position]
    return round(min(recess, max(0.0, wall - leaf - Door().stop_depth_m)), 4)


def _draw_sliding_recess(stream: Stream, wall: float, leaf: float, casing: float) -> float:
    """Draw a leaf in a wall pocket (30 %, if the wall is thick enough), or 0.01-0.06 m in front of wall and casing."""
    gap = max(stream.uniform(0.01, 0.06), casing + _PIN_M)
    in_pocket = stream.chance(_POCKET_CHANCE) and wall >= leaf + _POCKET_CHEEKS_M
    return round((wall - leaf) / 2 if in_pocket else -(gap + leaf), 4)


def _draw_door_handle(stream: Stream, kind: DoorKind, in_pocket: bool) -> Handle | None:
    if kind in ("sliding", "full_glass"):
        handle = draw_handle(stream, {"bar": 1.0})
        return None if in_pocket else handle
    return draw_handle(stream) if stream.chance(0.9) else None
