# SPDX-License-Identifier: Apache-2.0
"""A folder of depth images to label: one camera, a shut door that later opens."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from doorstate.io.camera import Intrinsics
from doorstate.io.options import ReadOptions
from doorstate.simulation.frames import Frame

CAMERA = Intrinsics.from_hfov(320, 240, np.radians(60))
OPTIONS = ReadOptions(intrinsics=CAMERA, pitch_deg=0.0)
FILES = ["1_closed.png", "2_closed.png", "3_open.png", "4_open.png"]


def write_depth_images(folder: Path, frames: list[Frame]) -> Path:
    """Write a shut and an open door twice, the second time with noise, and a colour image beside the first."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    for name, frame, noise_m in zip(
        FILES, (frames[0], frames[0], frames[2], frames[2]), (0, 0.005) * 2, strict=True
    ):
        depth_m = np.nan_to_num(frame.points[::2, ::2, 0])
        depth_m = np.where(depth_m > 0, depth_m + rng.normal(0, noise_m, depth_m.shape), 0)
        Image.fromarray((depth_m * 1000).astype(np.uint16)).save(folder / name)
    Image.new("RGB", (320, 240), (200, 150, 90)).save(folder / "1_closed_rgb.jpg")
    return folder
