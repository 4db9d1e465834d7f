# SPDX-License-Identifier: Apache-2.0
"""Samples of one pose: drawn, rendered, and described by the counts of visible pixels."""

from __future__ import annotations

from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import Frame, depth_sha256, replay
from doorstate.simulation.noise.sensors import find_sensor
from doorstate.simulation.occlusion import DoorView, occluded_bin
from doorstate.simulation.presets import Preset, draw_rows
from doorstate.simulation.render import cut_range
from doorstate.simulation.row import Row
from doorstate.simulation.scene.scene import clutter_boxes
from doorstate.simulation.visibility import looks_into, opening_depth_m, same_image
from doorstate.types import DepthImage, Part


def simulate_rows(
    preset: Preset, seed: int, index: int, sensor: str = "none"
) -> tuple[list[Row], list[Frame]]:
    """Draw and render the samples of one pose, and fill in the columns that depend on their images.

    Raises:
        ConfigError: no such sensor.
    """
    rows = [with_sensor(row, sensor) for row in draw_rows(preset, seed, index)]
    frames = [replay(row) for row in rows]
    # Compared without noise: two states that differ in noise alone are still the same.
    clean = [cut_range(frame.full, row.camera).depth_m for row, frame in zip(rows, frames, strict=True)]
    opening_m = _opening_depth_m(rows[0])
    described = []
    for row, frame, depth_m in zip(rows, frames, clean, strict=True):
        columns: dict[str, object] = {
            "measured_px": int((frame.cut.part != Part.NONE).sum()),
            "same_image_as": _same_images(row, depth_m, rows, clean),
            "depth_sha256": depth_sha256(frame),
        }
        described.append(row.model_copy(update=columns | _door_columns(row, frame, opening_m)))
    return described, frames


def with_sensor(row: Row, sensor: str) -> Row:
    """Return the row for this sensor, with the sensor's own camera unless that is the default camera.

    Raises:
        ConfigError: no such sensor.
    """
    camera = find_sensor(sensor).camera
    return row.model_copy(update={"sensor": sensor} | ({} if camera == DepthCamera() else {"camera": camera}))


def _same_images(row: Row, depth_m: DepthImage, rows: list[Row], images: list[DepthImage]) -> str:
    """Return the states of the pose's other samples with the same image, sorted and separated by spaces."""
    states = {
        sample.state
        for sample, image in zip(rows, images, strict=True)
        if sample.state != row.state and same_image(depth_m, image)
    }
    return " ".join(sorted(states))


def _opening_depth_m(row: Row) -> DepthImage | None:
    door = row.scene.door
    if door is None:
        return None
    size_m = door.opening_width_m, door.opening_height_m
    return opening_depth_m(row.camera_pose(), row.camera.intrinsics(), *size_m)


def _door_columns(row: Row, frame: Frame, opening_m: DepthImage | None) -> dict[str, object]:
    if opening_m is None:
        return {}
    share = 0.0
    if row.scene.items:
        view = DoorView(row.scene, row.opening(), row.camera_pose(), row.camera)
        share = view.occluded_share(clutter_boxes(row.scene))
    return {
        "visible_leaf_px": int((frame.cut.part == Part.LEAF).sum()),
        "visible_frame_px": int((frame.cut.part == Part.FRAME).sum()),
        "visible_opening_px": int(looks_into(frame.full.depth_m, opening_m).sum()),
        "occluded_share": share,
        "occluded_bin": occluded_bin(share),
    }
