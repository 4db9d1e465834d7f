# SPDX-License-Identifier: Apache-2.0
"""Predict from a depth image and the intrinsics of the camera, as arrays of a camera driver.

    python examples/depth_image.py depth.png camera_info.yaml

Keep the cloud organized, (H, W, 3): the gate finds holes in it, and a network samples it faster. Needs no torch,
because it uses a rule.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from doorstate import Predictor
from doorstate.io.camera_files import read_intrinsics
from doorstate.io.depth import depth_to_points


def main(image: Path, camera: Path) -> None:
    """Print the measured share of the pixels, and the state."""
    depth_mm = np.asarray(Image.open(image))  # (H, W) uint16, 0 where nothing was measured
    intrinsics = read_intrinsics(camera)  # or Intrinsics(width, height, fx, fy, cx, cy)
    cloud = depth_to_points(depth_mm * 0.001, intrinsics, roll_deg=0)  # 90: camera lies on its right side
    print(f"measured: {np.isfinite(cloud[..., 0]).mean():.0%} of the pixels")

    prediction = Predictor.load(rule="wall_leaf_angle")(cloud)
    if prediction.state is None:
        print(f"unknown: {prediction.reason}")
    else:
        print(f"{prediction.state}, opened by {prediction.opening_angle_deg:.0f} degrees")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
