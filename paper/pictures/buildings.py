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
DOOR_SCENES = (
    (129, 0),
    (104, 2),
    (141, 0),
    (150, 0),
    (106, 1),
    (148, 1),
    (111, 0),
    (151, 1),
)  # with the sample
NO_DOOR_SCENES = (108, 109, 121, 126)


def views() -> list[Row]:
    """Return the rows of the sheet, chosen to show every layout."""
    return [
        *(draw_rows(PRESETS["building"], 0, index)[sample] for index, sample in DOOR_SCENES),
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
        pen.text((left, top + HEADING / 2), name, "black", anchor="lm")
        sheet.paste(picture(row, replay(row)), (left, top + HEADING))
    png = BytesIO()
    sheet.save(png, format="png")
    return png.getvalue()
