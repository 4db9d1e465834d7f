# SPDX-License-Identifier: Apache-2.0
"""Contact sheet of doors: kinds, fittings and places in the wall, each at three openings from two viewpoints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from io import BytesIO
from typing import Any

from PIL import Image, ImageDraw, ImageFont

from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.render import render_behind_glass
from doorstate.simulation.scene import Door, Opening, Scene, scene_boxes
from doorstate.simulation.scene.fittings import Fitting
from doorstate.simulation.scene.handle import Handle
from doorstate.simulation.scene.room import Space

from .scenes import GAP, HEADING, shaded

WIDTH, HEIGHT = 160, 140
CAMERA = DepthCamera(width=2 * WIDTH, height=2 * HEIGHT)
VIEWS = ((0.35, 1.0, 1.1), (-0.75, 0.75, 1.1))  # x and y by the width that is in view, and height in metres
STEPS = (0.0, 0.45, 1.0)
OPEN_DEG = 90.0
_LEVER = Handle(kind="lever", height_m=1.0, projection_m=0.06, length_m=0.13)
_BAR = Handle(kind="bar", height_m=1.0, projection_m=0.06, length_m=0.6)
_NO_FRAME: Mapping[str, Any] = {"casing_width_m": 0.0, "stop_width_m": 0.0}
_PANEL = Fitting(kind="vision_panel", middle_m=1.4, width_m=0.15, height_m=0.9, free_edge_m=0.16)
DOORS: Mapping[str, Door] = {
    "flush, without casing": Door(**_NO_FRAME, jamb_thickness_m=0.0, hinge_offset_m=0.005, handle=_LEVER),
    "at the far face, threshold": Door(
        wall_thickness_m=0.3, leaf_recess_m=0.26, stop_width_m=0.0, threshold_m=0.02, handle=_LEVER
    ),
    "vision panel, kick plate": Door(
        hinge_offset_m=0.0125,
        handle=_LEVER,
        fittings=(_PANEL, Fitting(kind="kick_plate", middle_m=0.17, width_m=3.0, height_m=0.3)),
    ),
    "square panel, push bar, away": Door(
        swing="away",
        hinge_offset_m=0.0125,
        fittings=(
            Fitting(kind="vision_panel", middle_m=1.5, width_m=0.3, height_m=0.3),
            Fitting(kind="push_bar", middle_m=1.0, width_m=0.75, height_m=0.06),
        ),
    ),
    "letter slot, viewer, push plate, away": Door(
        swing="away",
        hinge_offset_m=0.0125,
        handle=_LEVER,
        fittings=(
            Fitting(kind="letter_slot", middle_m=0.7, width_m=0.3, height_m=0.06),
            Fitting(kind="viewer", middle_m=1.5, width_m=0.03, height_m=0.03),
            Fitting(kind="push_plate", middle_m=1.25, width_m=0.1, height_m=0.3, free_edge_m=0.03),
        ),
    ),
    "two leaves, one bolted": Door(
        kind="double_equal",
        opening_width_m=1.7,
        active_share=0.5,
        hinge_offset_m=0.0125,
        handle=_LEVER,
        fittings=(_PANEL,),
    ),
    "lift": Door(
        kind="sliding_double",
        wall_thickness_m=0.25,
        leaf_recess_m=0.08,
        leaf_thickness_m=0.03,
        stop_width_m=0.0,
        leaf_material="gloss",
    ),
    "sliding, two leaves": Door(
        kind="sliding_double", opening_width_m=1.6, leaf_recess_m=-0.08, stop_width_m=0.0, handle=_BAR
    ),
    "sliding, two leaves of glass": Door(
        kind="sliding_double", opening_width_m=1.8, leaf_recess_m=-0.08, stop_width_m=0.0, glass_panels=2
    ),
    "folding, two panels": Door(kind="folding", leaf_thickness_m=0.03, stop_width_m=0.0, handle=_LEVER),
    "folding, two pairs, half of glass": Door(
        kind="folding",
        panels=4,
        opening_width_m=2.0,
        leaf_recess_m=0.05,
        leaf_thickness_m=0.035,
        stop_width_m=0.0,
        glass_panels=2,
    ),
    "revolving, two wings of glass": Door(
        kind="revolving", opening_width_m=2.0, wall_height_m=2.8, jamb_thickness_m=0.05, glass_panels=2
    ),
}


def _tile(door: Door, step: float, view: tuple[float, float, float]) -> Image.Image:
    is_turned = not door.opens_by_share
    opening = Opening(angle_deg=step * OPEN_DEG) if is_turned else Opening(share=step)
    scene = Scene(door=door, far=Space(depth_m=3.0), has_ceiling=False)
    reach_m = 2.4 if door.opening_width_m < 1.2 else 3.0
    if door.kind == "revolving":
        reach_m = 4.0
    x, y = view[0] * reach_m, view[1] * reach_m
    pose = CameraPose(x, y, view[2], math.atan2(-y, -x), 0.03, 0.0)
    boxes, intrinsics = scene_boxes(scene, opening), CAMERA.intrinsics()
    image = shaded(render_behind_glass(boxes, pose, intrinsics), boxes, pose, intrinsics)
    return image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def draw() -> bytes:
    """Return the sheet as PNG: two doors a line."""
    across, step = len(VIEWS) * len(STEPS), HEADING + HEIGHT + GAP
    lines = -(-len(DOORS) // 2)
    block = across * (WIDTH + GAP) + 2 * GAP
    sheet = Image.new("RGB", (2 * block - 3 * GAP, lines * step - GAP), "white")
    pen = ImageDraw.Draw(sheet)
    pen.font = ImageFont.load_default(size=16)
    for number, (name, door) in enumerate(DOORS.items()):
        left, top = number // lines * block, number % lines * step
        pen.text((left, top + HEADING / 2), name, "black", anchor="lm")
        tiles = [_tile(door, opened, view) for view in VIEWS for opened in STEPS]
        for column, tile in enumerate(tiles):
            sheet.paste(tile, (left + column * (WIDTH + GAP), top + HEADING))
    png = BytesIO()
    sheet.save(png, format="png")
    return png.getvalue()
