# SPDX-License-Identifier: Apache-2.0
"""Contact sheet of a preset: shaded scenes of each kind with tinted glass, doors in three states."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.frames import Frame
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.render import Render, is_made_of, render
from doorstate.simulation.row import Row
from doorstate.simulation.scene.box import Box, Material
from doorstate.simulation.shading import shade
from doorstate.simulation.truth import true_doors
from doorstate.types import STATES

WALLS = {"main": "in one wall", "opposite": "in walls that face each other"}
KINDS: Mapping[str, Callable[[Row], str]] = {
    "varied": lambda row: row.door_kind.replace("_", " "),
    "cluttered": lambda row: f"{row.occluded_bin} % of the door hidden",
    "no-door": lambda row: row.scene_kind.replace("_", " "),
    "corridor": lambda row: f"{len(true_doors(row))} doors",
    "two-doors": lambda row: WALLS.get((row.scene.other_doors or ())[0].wall, "in walls that meet"),
}
"""Headings of the lines, by preset, from a row."""
SCENES = 100  # enough for every kind
COLUMNS = 6
WIDTH, HEIGHT, GAP, HEADING = 213, 160, 5, 26
TINTS: Mapping[Material, tuple[tuple[int, int, int], float]] = {
    "glass": ((150, 205, 225), 0.4),
    "gloss": ((170, 178, 186), 0.8),
}
"""Colour of a material, and its share in a picture."""


def picture(row: Row, frame: Frame) -> Image.Image:
    """Return a shaded sample with tinted glass and metal."""
    image = shaded(frame.full, row.boxes(), row.camera_pose(), row.camera.intrinsics())
    return image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def shaded(full: Render, boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics) -> Image.Image:
    """Return a shaded rendering of what is behind glass, with tinted glass and metal."""
    pixels = shade(full, intrinsics).astype(np.float64)
    rendered = render(boxes, pose, intrinsics)
    for material, (tint, share) in TINTS.items():
        made_of = is_made_of(material, rendered, boxes)
        pixels[made_of] = (1 - share) * pixels[made_of] + share * np.array(tint)
    return Image.fromarray(pixels.astype(np.uint8))


def lines(preset: str) -> dict[str, list[Image.Image]]:
    """Return the first samples of each kind, as many as a line holds; the closed door decides the occluded share."""
    lines_by_kind: defaultdict[str, list[Image.Image]] = defaultdict(list)
    for index in range(SCENES):
        rows, frames = simulate_rows(PRESETS[preset], 0, index)
        line = lines_by_kind[KINDS[preset](rows[0])]
        if len(line) < COLUMNS:
            line += [picture(row, frame) for row, frame in zip(rows, frames, strict=True)]
    return dict(sorted(lines_by_kind.items()))


def draw(preset: str) -> bytes:
    """Return the sheet of a preset as PNG."""
    rows, step = lines(preset), HEADING + HEIGHT + GAP
    samples = 1 if preset == "no-door" else len(STATES)  # of a scene; wider gaps between scenes
    left = [column * (WIDTH + GAP) + column // samples * GAP for column in range(COLUMNS)]
    first = HEADING if samples > 1 else 0  # the names of the states
    sheet = Image.new("RGB", (left[-1] + WIDTH, first + len(rows) * step), "white")
    pen = ImageDraw.Draw(sheet)
    pen.font = ImageFont.load_default(size=16)
    if first:
        for column in range(COLUMNS):
            state = STATES[column % samples].replace("_", "-")
            pen.text((left[column] + WIDTH / 2, HEADING / 2), state, "black", anchor="mm")
    for number, (kind, line) in enumerate(rows.items()):
        top = first + number * step
        pen.text((0, top + HEADING / 2), kind, "black", anchor="lm")
        for tile, x in zip(line, left, strict=False):
            sheet.paste(tile, (x, top + HEADING))
    png = BytesIO()
    sheet.save(png, format="png")
    return png.getvalue()
