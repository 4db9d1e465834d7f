# SPDX-License-Identifier: Apache-2.0
"""Camera files of ROS, OpenCV, Kalibr, RealSense and Open3D."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from doorstate._input import open_input
from doorstate.errors import CameraError, DoorstateError, summarize_exception
from doorstate.io.calibration import ENTRIES, Calibration, calibration_from_mapping
from doorstate.io.camera import Intrinsics
from doorstate.io.plain_yaml import plain_documents

_MAX_BYTES = 1 << 15  # of a camera file: YAML takes seconds per megabyte
# FileStorage of OpenCV before version 5 writes the version of YAML with a colon.
_OPENCV_DIRECTIVE = re.compile(r"\A%YAML:1\.0[ \t]*\r?\n(?:---[ \t]*\r?\n)?")


def read_intrinsics(path: Path, rectified: bool | None = None) -> Intrinsics:
    """Read the camera of depth images.

    Accepted are a ROS 1 or ROS 2 camera_info as a file or as `rostopic echo` and `ros2 topic echo` print it, `fx fy
    cx cy` in JSON or YAML (RealSense's `ppx ppy` too), and the files of OpenCV (FileStorage), Kalibr and Open3D. Of a
    recorded topic the first good message counts. `calibration` tells which numbers are taken.

    Args:
        path: JSON or YAML file.
        rectified: True if the images are rectified, False if not, None for what the file can tell.

    Raises:
        CameraError: the file cannot be read, a number is missing or impossible, or the distortion cannot be undone.
    """
    try:
        text = _beginning(path).decode("utf-8-sig")
        # A recorded topic is a stream of documents, and the first may be empty.
        is_json = path.suffix.lower() == ".json"
        documents = [json.loads(text)] if is_json else plain_documents(_OPENCV_DIRECTIVE.sub("", text))
        return _first_good(documents, rectified)
    except CameraError as error:
        raise error.located(path) from error
    except Exception as error:  # on damaged bytes parsers raise exceptions of any type
        raise CameraError(
            f"not a JSON or YAML file with intrinsics ({summarize_exception(error)})", path=path
        ) from error


def _first_good(documents: Any, rectified: bool | None) -> Intrinsics:
    problem: DoorstateError | None = None
    try:
        for document in documents:
            if document is None:
                continue
            try:
                return _calibration(document).camera(rectified)
            except CameraError as error:
                problem = problem or error
    except Exception as error:  # a later message may be cut off
        raise problem or error from error
    raise problem or CameraError("holds no intrinsics", expected=ENTRIES)


def _beginning(path: Path) -> bytes:
    """Return the content of a file, or its YAML documents that end within `_MAX_BYTES`."""
    with open_input(path, error=CameraError) as stream:
        content = stream.read(_MAX_BYTES + 1)
    if len(content) <= _MAX_BYTES:
        return content
    documents, separator, _ = content.rpartition(b"\n---")
    if not separator:
        raise CameraError(f"is larger than {_MAX_BYTES >> 10} KiB, so no camera")
    return documents


def _calibration(entries: Any) -> Calibration:
    if not isinstance(entries, dict):
        raise CameraError("holds no intrinsics", expected=ENTRIES)
    cameras = [name for name, value in entries.items() if isinstance(value, dict) and "camera_model" in value]
    if len(cameras) > 1:
        names = ", ".join(map(str, cameras))
        raise CameraError(f"holds the cameras {names}", expected="a file with the camera of the depth images")
    return _kalibr(entries[cameras[0]]) if cameras else calibration_from_mapping(entries)


def _kalibr(camera: dict[str, Any]) -> Calibration:
    """Return the calibration of a camera of Kalibr's camchain file."""
    if camera["camera_model"] != "pinhole":
        raise CameraError(f"{camera['camera_model']!r} cameras cannot be read", expected="pinhole")
    numbers, size = camera.get("intrinsics"), camera.get("resolution")
    if not (isinstance(numbers, list) and len(numbers) == 4 and isinstance(size, list) and len(size) == 2):
        raise CameraError("lacks four intrinsics or a resolution", expected="a camchain file of Kalibr")
    return calibration_from_mapping(
        dict(zip(("fx", "fy", "cx", "cy"), numbers, strict=True))
        | {
            "width": size[0],
            "height": size[1],
            "distortion_model": camera.get("distortion_model", "none"),
            "d": camera.get("distortion_coeffs"),
        }
    )
