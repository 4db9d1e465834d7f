# SPDX-License-Identifier: Apache-2.0
"""Contact sheet of buildings: views of every layout with doors, and of rooms without a door."""

from __future__ import annotations

from io import BytesIO

from PIL import Image, ImageDraw, ImageFont

from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.row import Row

from .scenes import GAP, HEADING, HEIGHT, WIDTH, picture

COLUMNS, LINES = 4, 3
DOOR_SCENES = (34, 18, 14, 21, 3, 11, 47, 58)
NO_DOOR_SCENES = (40, 51, 0, 38)


def views() -> list[Row]:
    """Return the rows of the sheet, chosen to show every layout."""
    rows = [draw_rows(PRESETS["building"], 0, index) for index in DOOR_SCENES]
    return [
        *(samples[number % len(samples)] for number, samples in enumerate(rows)),
        *(draw_rows(PRESETS["building-no-door"], 0, index)[0] for index in NO_DOOR_SCENES),
    ]


def draw() -> bytes:
    """Return the sheet as PNG."""
    sheet = Image.new("RGB", (COLUMNS * (WIDTH + GAP) - GAP, LINES * (HEADING + HEIGHT + GAP)), "white")
    pen = ImageDraw.Draw(sheet)
    pen.font = ImageFont.load_default(size=14)
    for number, row in enumerate(views()):
        left = number % COLUMNS * (WIDTH + GAP)
        top = number // COLUMNS * (HEADING + HEIGHT + GAP)
        name = f"{row.scene.layout}: {(row.door_kind or row.scene_kind).replace('_', ' ')}"
        if row.door_kind:
            name += f", {row.state.replace('_', '-')}"
        pen.text((left, top + HEADING / 2), name, "black", anchor="lm")
        sheet.paste(picture(row, replay(row)), (left, top + HEADING))
    png = BytesIO()
    sheet.save(png, format="png")
    return png.getvalue()
