# SPDX-License-Identifier: Apache-2.0
"""From a depth image and the camera's intrinsics to a state, as arrays: what the driver of a camera hands over.

    python examples/depth_image.py depth.png camera_info.yaml

Keep the image an image: of (H, W, 3) points a network looks at some rows and columns only, which is quicker, and the
gate finds holes in it. No torch is needed, as a rule answers.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from doorstate import Predictor
from doorstate.io.camera import read_intrinsics
from doorstate.io.depth import depth_to_points


def main(picture: Path, camera: Path) -> None:
    """Print how much was measured, and the state."""
    stored = np.asarray(Image.open(picture))  # (H, W) uint16 millimetres, 0 where nothing returned
    intrinsics = read_intrinsics(camera)  # or Intrinsics(width, height, fx, fy, cx, cy)
    cloud = depth_to_points(stored * 0.001, intrinsics, roll_deg=0)  # 90 if the camera lies on its right side
    print(f"measured: {np.isfinite(cloud[..., 0]).mean():.0%} of the pixels")

    prediction = Predictor.load(rule="wall_leaf_angle")(cloud)
    if prediction.state is None:
        print(f"unknown: {prediction.reason}")
    else:
        print(f"{prediction.state.label}, opened by {prediction.opening_angle_deg:.0f} degrees")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
