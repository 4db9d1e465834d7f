# SPDX-License-Identifier: Apache-2.0
"""Record a ROS 2 bag of a door that opens, without a robot and without ROS.

    python examples/make_bag.py door-bag

The simulated camera stands before a closed door, which begins to open after three seconds. The bag has the messages of
a depth camera driver: depth images in millimetres, and camera_info. Needs the extra `bags`.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.render import cut_range, render
from doorstate.simulation.scene import Door, Opening, Scene, scene_boxes

DOOR = Door(leaf_recess_m=0.08)  # a leaf flush with a plain wall can hardly be told from it
CAMERA = DepthCamera(width=320, height=240)
CAMERA_POSE = CameraPose(x_m=-0.3, y_m=2.4, z_m=1.0, yaw_rad=math.radians(-83))  # the wall is at y = 0
SECONDS, FRAMES_PER_S = 8, 5
START_NS = 1_700_000_000_000_000_000
STORE = get_typestore(Stores.LATEST)


def opening_angle_deg(time_s: float) -> float:
    """Return 0 for three seconds, then 45 degrees a second, up to 90."""
    return min(90.0, max(0.0, 45.0 * (time_s - 3)))


def depth_millimetres(angle_deg: float) -> np.ndarray:
    """Return a (H, W) uint16 depth image of the door, 0 where nothing was measured."""
    scene = scene_boxes(Scene(door=DOOR, has_ceiling=False), Opening(angle_deg=angle_deg))
    depth_m = cut_range(render(scene, CAMERA_POSE, CAMERA.intrinsics()), CAMERA).depth_m
    return np.nan_to_num(depth_m * 1000).round().astype("<u2")


def message(name: str, stamp_ns: int, **fields: Any) -> Any:
    """Return a message of sensor_msgs."""
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    header = STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera_depth_optical_frame")
    size = {"height": CAMERA.height, "width": CAMERA.width}
    return STORE.types[f"sensor_msgs/msg/{name}"](header=header, **size, **fields)


def depth_image(stamp_ns: int, millimetres: np.ndarray) -> Any:
    """Return an Image message of 16-bit depth."""
    data = millimetres.view(np.uint8).ravel()
    return message(
        "Image", stamp_ns, encoding="16UC1", is_bigendian=0, step=2 * millimetres.shape[1], data=data
    )


def camera_info(stamp_ns: int) -> Any:
    """Return the CameraInfo of the images, without distortion."""
    lens = CAMERA.intrinsics()
    k = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    region = STORE.types["sensor_msgs/msg/RegionOfInterest"](
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    return message(
        "CameraInfo",
        stamp_ns,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack((k, np.zeros(3))).ravel(),
        binning_x=0,
        binning_y=0,
        roi=region,
    )


def main(folder: Path) -> None:
    """Write the bag into a new folder."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        image_type, info_type = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
        images = bag.add_connection("/camera/depth/image_rect_raw", image_type, typestore=STORE)
        infos = bag.add_connection("/camera/depth/camera_info", info_type, typestore=STORE)
        for number in range(SECONDS * FRAMES_PER_S):
            time_s = number / FRAMES_PER_S
            stamp_ns = START_NS + round(time_s * 1e9)
            image = depth_image(stamp_ns, depth_millimetres(opening_angle_deg(time_s)))
            bag.write(infos, stamp_ns, STORE.serialize_cdr(camera_info(stamp_ns), info_type))
            bag.write(images, stamp_ns, STORE.serialize_cdr(image, image_type))
    print(f"{folder}: {SECONDS * FRAMES_PER_S} depth images in {SECONDS} s")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
