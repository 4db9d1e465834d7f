# SPDX-License-Identifier: Apache-2.0
"""A contact sheet of a preset, shaded, with glass tinted: a heading and scenes for each kind; doors in three states.

python tools/scene_sheet.py varied docs/images/varied.png
python tools/scene_sheet.py cluttered docs/images/cluttered.png
python tools/scene_sheet.py no-door docs/images/no-door.png
"""

from __future__ import annotations

import sys
from collections import defaultdict

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from doorstate.simulation.frames import Frame
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.render import is_made_of, render
from doorstate.simulation.row import Row
from doorstate.simulation.shading import shade
from doorstate.types import STATES

KINDS = {"varied": "door_kind", "cluttered": "occluded_bin", "no-door": "scene_kind"}
SCENES = 100  # enough for every kind
COLUMNS = 6
WIDTH, HEIGHT, GAP, HEADING = 213, 160, 5, 26
GLASS = np.array([150, 205, 225])


def picture(row: Row, frame: Frame) -> Image.Image:
    """A sample as the eye sees it."""
    intrinsics, boxes = row.camera.intrinsics(), row.boxes()
    shaded = shade(frame.full, intrinsics).astype(np.float64)
    seen = render(boxes, row.camera_pose(), intrinsics)
    glass = is_made_of("glass", seen, boxes)
    shaded[glass] = 0.6 * shaded[glass] + 0.4 * GLASS
    return Image.fromarray(shaded.astype(np.uint8)).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def lines(preset: str) -> dict[str, list[Image.Image]]:
    """The first samples of each kind, as many as a line holds; what is occluded is that of the closed door."""
    found = defaultdict(list)
    for index in range(SCENES):
        rows, frames = simulate_rows(PRESETS[preset], 0, index)  # type: ignore[index]
        line = found[getattr(rows[0], KINDS[preset])]
        if len(line) < COLUMNS:
            line += [picture(*each) for each in zip(rows, frames, strict=True)]
    return dict(sorted(found.items()))


def main(preset: str, target: str) -> None:
    """Draw the preset's scenes."""
    drawn, step = lines(preset), HEADING + HEIGHT + GAP
    samples = 1 if preset == "no-door" else len(STATES)  # of a scene; wider gaps between scenes
    left = [column * (WIDTH + GAP) + column // samples * GAP for column in range(COLUMNS)]
    first = HEADING if samples > 1 else 0  # the names of the states
    sheet = Image.new("RGB", (left[-1] + WIDTH, first + len(drawn) * step), "white")
    pen = ImageDraw.Draw(sheet)
    pen.font = ImageFont.load_default(size=16)
    if first:
        for column in range(COLUMNS):
            state = STATES[column % samples].replace("_", "-")
            pen.text((left[column] + WIDTH / 2, HEADING / 2), state, "black", anchor="mm")
    for number, (kind, line) in enumerate(drawn.items()):
        top = first + number * step
        words = f"{kind} % of the door hidden" if preset == "cluttered" else kind.replace("_", " ")
        pen.text((0, top + HEADING / 2), words, "black", anchor="lm")
        for tile, x in zip(line, left, strict=False):
            sheet.paste(tile, (x, top + HEADING))
    sheet.quantize(128).save(target, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
