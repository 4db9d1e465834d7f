# SPDX-License-Identifier: Apache-2.0
"""Samples of one pose: drawn, rendered, and described by the counts of visible pixels."""

from __future__ import annotations

import numpy as np

from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import Frame, depth_sha256, replay_pose
from doorstate.simulation.noise.model import conditions_for
from doorstate.simulation.noise.sensors import find_sensor
from doorstate.simulation.occlusion import DoorView, occluded_bin
from doorstate.simulation.presets import Preset, draw_rows
from doorstate.simulation.render import Render, cut_range, render_behind_glass
from doorstate.simulation.row import Row
from doorstate.simulation.scene.scene import clutter_boxes
from doorstate.simulation.visibility import count_visible, opening_depths_m, same_image
from doorstate.types import DepthImage, Part


def simulate_rows(
    preset: Preset, seed: int, index: int, sensor: str = "none"
) -> tuple[list[Row], list[Frame]]:
    """Draw and render the samples of one pose, and fill in the columns that depend on their images.

    Raises:
        ConfigError: no such sensor.
    """
    rows = [with_sensor(row, sensor) for row in draw_rows(preset, seed, index)]
    frames = replay_pose(rows)
    # Compared without noise: two states that differ in noise alone are still the same.
    clean = [cut_range(frame.full, row.camera) for row, frame in zip(rows, frames, strict=True)]
    openings_m = opening_depths_m(rows[0].scene, rows[0].camera_pose(), rows[0].camera.intrinsics())
    described = []
    for row, frame, image in zip(rows, frames, clean, strict=True):
        columns: dict[str, object] = {
            "measured_px": int(np.count_nonzero(frame.cut.part != Part.NONE)),
            "same_image_as": _same_images(row, image, rows, clean),
            "depth_sha256": depth_sha256(frame),
        }
        described.append(row.model_copy(update=columns | _door_columns(row, frame, openings_m)))
    return described, frames


def with_sensor(row: Row, sensor: str) -> Row:
    """Return the row for this sensor, with the sensor's own camera unless that is the default camera.

    Samples of one pose have the same conditions.

    Raises:
        ConfigError: no such sensor.
    """
    model = find_sensor(sensor)
    update = {"sensor": sensor, "conditions": conditions_for(model, row.seed, row.pose_id)}
    own_camera = {} if model.camera == DepthCamera() else {"camera": model.camera}
    return row.model_copy(update=update | own_camera)


def _same_images(row: Row, image: Render, rows: list[Row], images: list[Render]) -> str:
    """Return the states of the pose's other samples with the same image, sorted and separated by spaces.

    Beside other doors, which have states of their own: the states of the main door that would give the same image.
    """
    others = [
        (sample, other) for sample, other in zip(rows, images, strict=True) if sample.state != row.state
    ]
    if row.other_doors:
        main_leaf = (image.part == Part.LEAF) & (image.box < row.box_groups().doors()[0].stop)
        others = [] if main_leaf.any() else [(sample, _render_with(row, sample)) for sample, _ in others]
    return " ".join(
        sorted({sample.state for sample, other in others if same_image(image.depth_m, other.depth_m)})
    )


def _render_with(row: Row, sample: Row) -> Render:
    """Render a row with the main door as in another sample."""
    boxes = row.box_groups(sample.opening()).all()
    return cut_range(render_behind_glass(boxes, row.camera_pose(), row.camera.intrinsics()), row.camera)


def _door_columns(row: Row, frame: Frame, openings_m: list[DepthImage]) -> dict[str, object]:
    if not openings_m:
        return {}
    ranges = row.box_groups().doors()
    main, *others = (
        count_visible(frame.full, frame.cut, numbers, opening_m)
        for numbers, opening_m in zip(ranges, openings_m, strict=True)
    )
    share = 0.0
    if row.scene.items or row.scene.people:
        other_openings = [door.opening for door in row.other_doors]
        view = DoorView(row.scene, row.opening(), row.camera_pose(), row.camera, other_openings)
        share = view.occluded_share(clutter_boxes(row.scene))
    return {
        "visible_leaf_px": main.leaf,
        "visible_frame_px": main.frame,
        "visible_opening_px": main.opening,
        "occluded_share": share,
        "occluded_bin": occluded_bin(share),
        "other_doors": tuple(
            door.model_copy(update={"truth": door.truth.model_copy(update={"visible_px": seen})})
            for door, seen in zip(row.other_doors, others, strict=True)
        ),
    }
