# SPDX-License-Identifier: Apache-2.0
"""Random windows, passages and niches in the walls of a plan."""

from __future__ import annotations

from doorstate.simulation.draw.building.plan import Plan, WallAperture
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.aperture import Aperture
from doorstate.simulation.scene.room import Space

_HEAD_M = 0.15  # least height of wall above a passage
_PLACE_TRIES = 8


def draw_windows(stream: Stream, plan: Plan, wall: int) -> list[WallAperture]:
    """Draw one to three equal windows in a wall, one of which may be open."""
    length, top_of_wall = plan.layout.wall_length_m(wall), plan.height_m
    count = stream.integer(1, 3)
    room = length / count - 0.4
    width = min(stream.uniform(0.7, 2.4), room)
    if width < 0.5:
        return []
    low = stream.choice({stream.uniform(0.75, 1.1): 0.75, stream.uniform(0.05, 0.4): 0.25})
    top = min(stream.uniform(1.95, 2.5), top_of_wall - 0.1)
    sashes = max(1, round(width / stream.uniform(0.6, 1.0)))
    windows = []
    for number in range(count):
        is_open = stream.chance(0.25)
        aperture = Aperture(
            kind="window",
            wall="main",
            along_m=0.0,
            width_m=round(width, 4),
            bottom_m=low,
            top_m=round(top, 4),
            wall_thickness_m=plan.thicknesses_m[wall],
            sashes=sashes,
            sash_deg=stream.uniform(10, 95, 2) if is_open else 0.0,
        )
        windows.append(WallAperture(wall, round((number + 0.5) * length / count, 4), aperture))
    return windows


def draw_passage(stream: Stream, plan: Plan, wall: int, full_height: bool) -> WallAperture | None:
    """Draw a passage to a corridor that begins there, or through the wall to another room; None if none fits."""
    length, height = plan.layout.wall_length_m(wall), plan.height_m
    if full_height:
        width = stream.uniform(1.2, 2.6)
        left = right = round(width / 2, 4)
        beyond = Space(left_m=left, right_m=right, depth_m=stream.uniform(2.0, 8.0))
        top = height
    else:
        width = stream.uniform(0.8, 2.0)
        left, right = (round(width / 2 + stream.uniform(0.0, 2.0), 4) for _ in range(2))
        beyond = Space(left_m=left, right_m=right, depth_m=stream.uniform(1.5, 6.0))
        top = min(stream.uniform(2.0, 2.5), height - _HEAD_M)
    passage = Aperture(
        kind="passage",
        wall="main",
        along_m=0.0,
        width_m=round(width, 4),
        top_m=round(top, 4),
        wall_thickness_m=plan.thicknesses_m[wall],
        beyond=beyond,
    )
    placed = place(stream, plan, wall, passage) if length > width + 0.3 else None
    if placed is None or full_height:
        return placed
    # The room behind ends with the wall.
    ends = {
        "left_m": round(min(left, length - placed.along_m), 4),
        "right_m": round(min(right, placed.along_m), 4),
    }
    return placed._replace(aperture=passage.model_copy(update={"beyond": beyond.model_copy(update=ends)}))


def draw_niche(stream: Stream, plan: Plan, wall: int) -> WallAperture | None:
    """Draw a niche; None if none fits."""
    niche = Aperture(
        kind="niche",
        wall="main",
        along_m=0.0,
        width_m=stream.uniform(0.6, 1.5),
        bottom_m=0.0 if stream.chance(0.6) else stream.uniform(0.3, 1.0),
        top_m=stream.uniform(1.8, 2.3),
        wall_thickness_m=plan.thicknesses_m[wall],
        depth_m=stream.uniform(0.12, 0.60),
    )
    return place(stream, plan, wall, niche)


def place(
    stream: Stream, plan: Plan, wall: int, aperture: Aperture, along_m: float | None = None
) -> WallAperture | None:
    """Return an aperture in a wall at a drawn or given place; None if it does not fit."""
    for _ in range(_PLACE_TRIES if along_m is None else 1):
        at = stream.uniform(0.0, plan.layout.wall_length_m(wall)) if along_m is None else along_m
        candidate = WallAperture(wall, at, aperture)
        if plan.fits(candidate):
            return candidate
    return None
