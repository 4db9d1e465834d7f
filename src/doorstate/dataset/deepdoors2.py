# SPDX-License-Identifier: Apache-2.0
"""Layout of DeepDoors2 and of its predecessor, the Door Detection & Classification data set.

From the READMEs of gasparramoa/DeepDoors2 and gasparramoa/DoorDetect-Class-Dataset (GitHub): a RealSense D435 turned by
90 degrees; images of 480 x 640; grey depth images from 0 to 255 in steps of 1/16 m; intrinsics of the unturned camera,
640 x 480 (DeepDoors2 only; assumed for its predecessor, which names the same camera); folders `Depth` and `RGB`, in
each `Train`, `Val`, `Test`, in each `Closed`, `Open`, `Semi-open`; in the predecessor twice, below `OriginalSize` and
`Cropped`.

From other repositories: images are 480 wide and 640 high, the folder may be called `Semi`, and 3000 pairs remain
without names that contain a bracket (dataset-ninja/deep-doors2); images of that camera are put upright by a clockwise
quarter turn (gasparramoa/JetsonNano-CompVision, by the same author).

Not verified, because the data were not available: that 0 means no measurement; how depth beyond 15.9 m is stored;
whether depth was registered to the colour camera, as a recording script of the author does. The intrinsics are those of
a D435's depth stream. If depth is registered, its focal lengths are about 1.6 times as long and doors come out that
much too wide: pass other intrinsics then.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from doorstate._input import read_input
from doorstate.dataset.class_folders import file_row, nearest_label, state_of_folder
from doorstate.errors import DatasetError, DoorstateError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points
from doorstate.io.find import find_clouds
from doorstate.io.options import ReadOptions
from doorstate.io.png import parse_coarse_png
from doorstate.io.size_limits import MAX_FILE_BYTES
from doorstate.types import Points

CAMERA = Intrinsics(640, 480, 384.681, 384.681, 319.226, 242.138)
STEP_M = 1 / 16
_SPLITS = ("train", "val", "test")
# Assumed: 0 as for every depth camera; 255 because clipped depth ends there.
_NOT_MEASURED = (0, 255)


def deepdoors2_rows(root: Path) -> list[dict[str, str]]:
    """Return one manifest row for every depth image, with its published split in column `split`.

    Colour images, copies such as `x(1).png`, and cropped images, whose position in the view is unknown, are skipped.

    Args:
        root: the unpacked folder, or any folder in it.

    Raises:
        CloudReadError: no image at all.
        DatasetError: no depth image in a folder that is named after a state.
    """
    if not root.is_dir():
        raise DatasetError("is not a folder", path=root)
    rows = []
    for path in find_clouds([root]):
        folders = [name.lower() for name in path.absolute().parent.parts]
        kind = next((name for name in reversed(folders) if name in ("depth", "rgb")), None)
        state = nearest_label(root, path, state_of_folder)
        if kind != "depth" or "cropped" in folders or "(" in path.name or state is None:
            continue
        split = next((name for name in reversed(folders) if name in _SPLITS), "")
        rows.append(file_row(root, path, state) | {"split": split})
    if not rows:
        raise DatasetError(
            "no depth images of DeepDoors2", path=root, expected="folders such as Depth/Test/Closed"
        )
    return rows


def read_deepdoors2(path: Path, options: ReadOptions) -> Points:
    """Read a depth image as an upright image of points.

    Args:
        path: 8-bit PNG of 480 x 640 pixels, or 640 x 480 as the turned camera recorded it.
        options: intrinsics of the unturned camera, if set, replace the published ones.

    Returns:
        (640, 480, 3) float32 metres in the body frame, NaN where nothing was measured.

    Raises:
        CloudReadError: it is not such an image.
        CameraError: the image has another size.
    """
    camera = options.intrinsics or CAMERA
    if isinstance(camera, Pinhole):
        camera = Intrinsics(CAMERA.width, CAMERA.height, *camera)
    try:
        stored = parse_coarse_png(read_input(path, MAX_FILE_BYTES))
        if stored.shape == (camera.height, camera.width):
            stored = np.rot90(stored, -1)
        depth_m = np.where(np.isin(stored, _NOT_MEASURED), np.nan, stored * STEP_M)
        return depth_to_points(depth_m, camera.turned_clockwise())
    except DoorstateError as error:
        raise error.located(path) from error
