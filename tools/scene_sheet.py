# SPDX-License-Identifier: Apache-2.0
"""A contact sheet of the first scenes of a preset, shaded, with glass tinted; one row of three states a scene.

python tools/scene_sheet.py varied docs/images/varied.png
python tools/scene_sheet.py no-door docs/images/no-door.png 24
"""

from __future__ import annotations

import sys

import numpy as np
from PIL import Image

from doorstate.simulation.frames import replay
from doorstate.simulation.scene_rows import SCENE_PRESETS, SceneRow, draw_scene
from doorstate.simulation.sensor import is_made_of, render
from doorstate.simulation.shading import shade

COLUMNS = 6
TILE = (213, 160)
GLASS = np.array([150, 205, 225])


def picture(row: SceneRow) -> Image.Image:
    """A sample as the eye sees it."""
    intrinsics, boxes = row.camera.intrinsics(), row.boxes()
    shaded = shade(replay(row).full, intrinsics).astype(np.float64)
    seen = render(boxes, row.camera_pose(), intrinsics)
    glass = is_made_of("glass", seen, boxes)
    shaded[glass] = 0.6 * shaded[glass] + 0.4 * GLASS
    return Image.fromarray(shaded.astype(np.uint8)).resize(TILE, Image.Resampling.LANCZOS)


def main(preset: str, target: str, count: str = "10", first: str = "0") -> None:
    """Draw the preset's scenes."""
    rows = [
        row
        for index in range(int(first), int(first) + int(count))
        for row in draw_scene(SCENE_PRESETS[preset], 0, index)  # type: ignore[index]
    ]
    width, height = TILE
    sheet = Image.new("RGB", (COLUMNS * (width + 4), -(-len(rows) // COLUMNS) * (height + 4)), "white")
    for number, row in enumerate(rows):
        sheet.paste(picture(row), (number % COLUMNS * (width + 4), number // COLUMNS * (height + 4)))
    sheet.quantize(128).save(target, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
