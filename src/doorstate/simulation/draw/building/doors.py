# SPDX-License-Identifier: Apache-2.0
"""Random doors as in public buildings and homes; ranges and weights are those of the data card, all assumed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from doorstate.simulation.draw.building.fittings import draw_fittings, draw_leaf_material
from doorstate.simulation.draw.doors import WALL_HEIGHT_M, WALL_THICKNESS_M, draw_handle
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.door import Door, DoorKind
from doorstate.types import Hinge, Swing

KIND_WEIGHTS: Mapping[DoorKind, float] = {
    "single": 0.44,
    "double_equal": 0.10,
    "double_unequal": 0.06,
    "glazed": 0.08,
    "full_glass": 0.06,
    "sliding": 0.08,
    "sliding_double": 0.08,
    "folding": 0.06,
    "revolving": 0.04,
}
_HINGES: dict[Hinge, float] = {"left": 0.5, "right": 0.5}
_SWINGS: dict[Swing, float] = {"towards": 0.5, "away": 0.5}
_FRAMELESS_CHANCE, _THRESHOLD_CHANCE, _HANDLE_CHANCE = 0.2, 0.4, 0.9
_LIFT_CHANCE, _POCKET_CHANCE, _GLASS_CHANCE = 0.4, 0.35, 0.4
_PIN_M = 0.005  # of a hinge in front of its leaf
_CHEEK_M = 0.02  # of a pocket, on both sides of its leaf
_LEAST_STOP_M = 0.01  # of a stop's depth inside of the wall


def draw_building_door(
    stream: Stream,
    wall_m: tuple[float, float] | None = None,
    kinds: Mapping[DoorKind, float] = KIND_WEIGHTS,
) -> Door:
    """Draw a door in its wall.

    Args:
        stream: random numbers.
        wall_m: thickness and height of the wall; drawn if not given.
        kinds: weights of the kinds.
    """
    wall, height = wall_m or (stream.uniform(*WALL_THICKNESS_M), stream.uniform(*WALL_HEIGHT_M))
    kind = stream.choice(kinds)
    common: dict[str, Any] = {
        "kind": kind,
        "hinge": stream.choice(_HINGES),
        "swing": stream.choice(_SWINGS),
        "wall_thickness_m": wall,
        "wall_height_m": height,
        "opening_height_m": _draw_opening_height(stream, height),
        "leaf_material": draw_leaf_material(stream),
        "threshold_m": stream.uniform(0.002, 0.03) if stream.chance(_THRESHOLD_CHANCE) else 0.0,
    }
    if kind in ("sliding", "sliding_double"):
        own = _draw_sliding(stream, kind, wall)
    elif kind == "folding":
        own = _draw_folding(stream, wall)
    elif kind == "revolving":
        own = _draw_revolving(stream)
    else:
        own = _draw_hinged(stream, kind, wall)
    return Door(**common | own)


def draw_door_like(stream: Stream, style: Door) -> Door:
    """Draw a door of a style: it may be hinged on the other side, and swing the other way."""
    return style.model_copy(update={"hinge": stream.choice(_HINGES), "swing": stream.choice(_SWINGS)})


def draw_lift_door(stream: Stream, wall_m: tuple[float, float] | None = None) -> Door:
    """Draw the landing door of a lift: two leaves of metal that part in the wall, just behind its face."""
    wall, height = wall_m or (stream.uniform(*WALL_THICKNESS_M), stream.uniform(*WALL_HEIGHT_M))
    return Door(
        kind="sliding_double",
        wall_thickness_m=wall,
        wall_height_m=height,
        opening_height_m=_draw_opening_height(stream, height),
        **_draw_lift(stream, wall),
    )


def _draw_opening_height(stream: Stream, wall_height_m: float) -> float:
    height = stream.choice({1.98: 1, 2.03: 1, 2.11: 1, stream.uniform(1.95, 2.40): 1})
    return round(min(height, wall_height_m - 0.15), 4)


def _draw_hinged(stream: Stream, kind: DoorKind, wall: float) -> dict[str, Any]:
    leaf = stream.uniform(0.03, 0.04) if kind == "full_glass" else stream.uniform(0.035, 0.06)
    leaf = min(leaf, wall)
    recess = _draw_recess(stream, wall, leaf)
    frame = _draw_frame(stream)
    has_stop = frame["casing_width_m"] > 0 and recess + leaf + Door().stop_depth_m <= wall + _LEAST_STOP_M
    pane_bottom = None
    if kind == "glazed":
        pane_bottom = stream.choice({0.2: 1, stream.uniform(0.8, 1.1): 1})
    shares = {"double_equal": 0.5, "double_unequal": stream.uniform(0.6, 0.72)}
    width = stream.uniform(1.25, 2.2) if kind in shares else stream.uniform(0.60, 1.20)
    handle = draw_handle(stream, {"bar": 1.0}) if kind == "full_glass" else draw_handle(stream)
    return frame | {
        "opening_width_m": width,
        "leaf_thickness_m": leaf,
        "leaf_recess_m": recess,
        # A flush leaf needs an offset pin to turn past its casing.
        "hinge_offset_m": _PIN_M if recess else round(_PIN_M + frame["casing_thickness_m"] / 2, 5),
        "stop_width_m": Door().stop_width_m if has_stop else 0.0,
        "active_share": shares.get(kind, 1.0),
        "pane_bottom_m": pane_bottom,
        "fittings": None if kind == "full_glass" else draw_fittings(stream, pane_bottom),
        "handle": handle if stream.chance(_HANDLE_CHANCE) else None,
    }


def _draw_recess(stream: Stream, wall: float, leaf: float) -> float:
    """Draw the place of a leaf in its wall: flush (45 %), shallow (25 %), in the middle (15 %), or at the far face."""
    deepest = max(0.0, wall - leaf)
    shallow = min(stream.uniform(0.02, 0.12), deepest)
    places = {"flush": 0.0, "shallow": shallow, "middle": deepest / 2, "far": deepest}
    return round(places[stream.choice({"flush": 0.45, "shallow": 0.25, "middle": 0.15, "far": 0.15})], 4)


def _draw_frame(stream: Stream) -> dict[str, float]:
    """Draw jambs and casings; one door in five has no casing, and jambs of up to 2 cm."""
    if stream.chance(_FRAMELESS_CHANCE):
        jamb = stream.choice({0.0: 1, stream.uniform(0.005, 0.02): 1})
        return {"jamb_thickness_m": jamb, "casing_width_m": 0.0, "casing_thickness_m": 0.0}
    return {
        "jamb_thickness_m": stream.uniform(0.015, 0.04),
        "casing_width_m": stream.uniform(0.02, 0.12),
        "casing_thickness_m": stream.uniform(0.002, 0.025),
    }


def _draw_sliding(stream: Stream, kind: DoorKind, wall: float) -> dict[str, Any]:
    if kind == "sliding_double" and stream.chance(_LIFT_CHANCE):
        return _draw_lift(stream, wall)
    frame, leaf = _draw_frame(stream), stream.uniform(0.025, 0.045)
    in_pocket = stream.chance(_POCKET_CHANCE) and wall >= leaf + 2 * _CHEEK_M
    gap = max(stream.uniform(0.01, 0.06), frame["casing_thickness_m"] + _PIN_M)
    double, is_glass = kind == "sliding_double", stream.chance(_GLASS_CHANCE)
    handle = draw_handle(stream, {"bar": 1.0})
    return frame | {
        "opening_width_m": stream.uniform(1.2, 2.4) if double else stream.uniform(0.62, 1.25),
        "leaf_thickness_m": leaf,
        "leaf_recess_m": round((wall - leaf) / 2 if in_pocket else -(gap + leaf), 4),
        "stop_width_m": 0.0,
        "glass_panels": (2 if double else 1) if is_glass else None,
        "handle": None if in_pocket else handle,
    }


def _draw_lift(stream: Stream, wall: float) -> dict[str, Any]:
    leaf = stream.uniform(0.025, 0.035)
    frame = _draw_frame(stream)
    return frame | {
        "opening_width_m": stream.choice({0.8: 1, 0.9: 2, 1.1: 1, stream.uniform(0.8, 1.4): 1}),
        "leaf_thickness_m": leaf,
        "leaf_recess_m": round(min(stream.uniform(0.0, 0.10), max(0.0, wall - leaf)), 4),
        "stop_width_m": 0.0,
        "leaf_material": "gloss",
    }


def _draw_folding(stream: Stream, wall: float) -> dict[str, Any]:
    panels = stream.choice({2: 0.6, 4: 0.4})
    leaf = stream.uniform(0.02, 0.04)
    handle = draw_handle(stream, {"knob": 1.0})
    return _draw_frame(stream) | {
        "panels": panels,
        "opening_width_m": stream.uniform(0.62, 1.10) if panels == 2 else stream.uniform(1.3, 2.4),
        "leaf_thickness_m": leaf,
        "leaf_recess_m": round(stream.uniform(0.0, 1.0) * max(0.0, wall - leaf), 4),
        "stop_width_m": 0.0,
        "glass_panels": panels if stream.chance(_GLASS_CHANCE) else None,
        "handle": handle if stream.chance(_HANDLE_CHANCE) else None,
    }


def _draw_revolving(stream: Stream) -> dict[str, Any]:
    return {
        "opening_width_m": stream.uniform(1.6, 3.0),
        "leaf_thickness_m": stream.uniform(0.03, 0.05),
        "jamb_thickness_m": stream.uniform(0.03, 0.08),
        "casing_width_m": 0.0,
        "casing_thickness_m": 0.0,
        "stop_width_m": 0.0,
        "threshold_m": 0.0,
        "glass_panels": stream.choice({None: 0.4, 2: 0.3, 4: 0.3}),
    }
