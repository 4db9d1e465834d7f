# SPDX-License-Identifier: Apache-2.0
"""DeepDoors2 and its predecessor, the Door Detection & Classification data set, as they are laid out.

From the READMEs of gasparramoa/DeepDoors2 and gasparramoa/DoorDetect-Class-Dataset (GitHub): a RealSense D435 that was
turned by 90 degrees; images of 480 x 640; grey depth images from 0 to 255 in steps of 1/16 m; intrinsics of the camera
as it was built, 640 x 480 (DeepDoors2 only; taken for its predecessor too, which names the same camera); folders
`Depth` and `RGB`, in each `Train`, `Val`, `Test`, in each `Closed`, `Open`, `Semi-open`; in the predecessor all of that
twice, below `OriginalSize` and below `Cropped`.

From other repositories: images are 480 wide and 640 high, the folder may be called `Semi`, and 3000 pairs are left when
names with a bracket are passed over (dataset-ninja/deep-doors2); images of that camera are put upright by a clockwise
quarter turn (gasparramoa/JetsonNano-CompVision, by the same author).

Not checked, for want of the data: that 0 means nothing measured; what became of depth beyond 15.9 m; whether depth was
registered to the colour camera, as a recording script of the author's does. The intrinsics are those of a D435's depth
stream. If depth is registered, its focal lengths are about 1.6 times as long, and doors come out that much too wide:
give `--fx` and so on.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from doorstate.dataset.class_folders import nearest, row_of, state_of_folder
from doorstate.errors import CloudReadError, DatasetError, DoorstateError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points
from doorstate.io.find import find_clouds
from doorstate.io.options import ReadOptions
from doorstate.io.png import parse_coarse_png
from doorstate.types import Points

CAMERA = Intrinsics(640, 480, 384.681, 384.681, 319.226, 242.138)
STEP_M = 1 / 16
_SPLITS = ("train", "val", "test")
# Chosen: 0 as of every depth camera; 255 because depth that was cut off ends there.
_NOT_MEASURED = (0, 255)


def deepdoors2_rows(root: Path) -> list[dict[str, str]]:
    """One manifest row for every depth image, with the published part it is in as `split`.

    Colour images are passed over, and so are cropped ones, of which nobody knows where in the view they were, and
    copies such as `x(1).png`.

    Args:
        root: the unpacked folder, or any folder in it.

    Raises:
        CloudReadError: no image at all.
        DatasetError: no depth image in a folder that is named after a state.
    """
    if not root.is_dir():
        raise DatasetError(f"{root}: is not a folder")
    rows = []
    for path in find_clouds([root]):
        folders = [name.lower() for name in path.absolute().parent.parts]
        kind = next((name for name in reversed(folders) if name in ("depth", "rgb")), None)
        state = nearest(root, path, state_of_folder)
        if kind != "depth" or "cropped" in folders or "(" in path.name or state is None:
            continue
        split = next((name for name in reversed(folders) if name in _SPLITS), "")
        rows.append(row_of(root, path, state.label) | {"split": split})
    if not rows:
        raise DatasetError(
            f"{root}: no depth images in folders such as Depth/Test/Closed, as DeepDoors2 has them"
        )
    return rows


def read_deepdoors2(path: Path, options: ReadOptions) -> Points:
    """Read a depth image as an upright image of points.

    Args:
        path: 8-bit PNG of 480 x 640 pixels, or of 640 x 480 as the turned camera saw it.
        options: intrinsics in it, of the camera before it was turned, replace the published ones.

    Returns:
        (640, 480, 3) float32 metres in the body frame, NaN where nothing was measured.

    Raises:
        CloudReadError: it is no such image.
        CameraError: the image has another size.
    """
    camera = options.intrinsics or CAMERA
    if isinstance(camera, Pinhole):
        camera = Intrinsics(CAMERA.width, CAMERA.height, *camera)
    try:
        stored = parse_coarse_png(path.read_bytes())
        if stored.shape == (camera.height, camera.width):
            stored = np.rot90(stored, -1)
        depth_m = np.where(np.isin(stored, _NOT_MEASURED), np.nan, stored * STEP_M)
        return depth_to_points(depth_m, camera.turned_clockwise())
    except OSError as error:
        raise CloudReadError(f"cannot be read ({error.strerror or error})", path=path) from error
    except DoorstateError as error:
        raise error.located(path) from error
