# SPDX-License-Identifier: Apache-2.0
"""Worlds for Gazebo: read back, they hold the scene's boxes and give the row's depth."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from doorstate.errors import ConfigError
from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.frames import replay
from doorstate.simulation.generate import with_sensor
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.render import cut_range, render_behind_glass
from doorstate.simulation.row import Row
from doorstate.simulation.scene import Box, Door
from doorstate.simulation.scene.capsule import Capsule
from doorstate.simulation.scene.fittings import Fitting
from doorstate.simulation.scene.scene import Scene
from doorstate.simulation.sdf import sdf_world
from doorstate.types import Part
from tests.simulation.scene.doors_by_share import BI_FOLD, LIFT, REVOLVING

ROWS = [draw_rows(preset, 0, 3)[-1] for preset in PRESETS.values()]
GLASS = next(
    rows[1]
    for rows in (draw_rows(PRESETS["varied"], 0, index) for index in range(99))
    if rows[0].door_kind == "full_glass"
)
KINDS = [
    ROWS[0].model_copy(update={"scene": Scene(door=door), "opening_share": 0.4, "sample_id": door.kind})
    for door in (
        LIFT,
        BI_FOLD.model_copy(update={"leaf_material": "dark"}),
        REVOLVING.model_copy(update={"glass_panels": 2}),
        Door(fittings=(Fitting(kind="vision_panel", middle_m=1.5, width_m=0.2, height_m=0.4),)),
    )
]


def numbers(element: ET.Element, path: str) -> list[float]:
    return [float(word) for word in element.findtext(path, "").split()]


def read_boxes(world: ET.Element, kind: str) -> list[Box]:
    boxes, ends = [], {}
    for element in world.iterfind(f"model[@name='scene']/link/{kind}"):
        x, y, z, roll, pitch, yaw = numbers(element, "pose")
        assert roll == pitch == 0
        number, part, *shape = element.get("name", "").split("_")
        glass = element.find("transparency") is not None
        if not shape:
            size = tuple(numbers(element, "geometry/box/size"))
            boxes.append(Box(Part[part.upper()], (x, y, z), size, yaw, "glass" if glass else "matte"))
            continue
        # A capsule: its spheres are at the ends of its cylinder, which is left out if it has no length.
        (radius,) = numbers(element, f"geometry/{'cylinder' if shape == ['cylinder'] else 'sphere'}/radius")
        if shape == ["cylinder"]:
            ends[number] = numbers(element, "geometry/cylinder/length")[0]
        elif shape == ["top"]:
            ends[number, "top"] = z
        else:
            top = ends[number, "top"]
            assert top - z == pytest.approx(ends.get(number, 0.0))
            boxes.append(
                Capsule(
                    Part[part.upper()],
                    (x, y, (top + z) / 2),
                    (2 * radius, 2 * radius, top - z + 2 * radius),
                    yaw,
                )
            )
    return boxes


def read_camera(world: ET.Element) -> tuple[CameraPose, DepthCamera]:
    model = world.find("model[@name='depth_camera']")
    assert model is not None
    x, y, z, roll, pitch, yaw = numbers(model, "pose")
    optics = model.find("link/sensor[@type='depth']/camera")
    assert optics is not None
    camera = DepthCamera(
        width=int(optics.findtext("image/width", "")),
        height=int(optics.findtext("image/height", "")),
        hfov_deg=math.degrees(float(optics.findtext("horizontal_fov", ""))),
    )
    return CameraPose(x, y, z, yaw, pitch, roll), camera


@pytest.mark.parametrize(
    "row", [*ROWS, *KINDS, GLASS, draw_rows(PRESETS["ogurob"], 0, 700)[1]], ids=lambda row: row.sample_id
)
def test_a_world_reads_back_to_the_same_boxes_and_depth(row: Row) -> None:
    root = ET.fromstring(sdf_world(row, row.sample_id))
    assert (root.tag, root.get("version")) == ("sdf", "1.7")
    world = root.find("world")
    assert world is not None
    assert world.get("name") == row.sample_id
    boxes = read_boxes(world, "visual")
    assert [type(box) for box in boxes] == [type(box) for box in row.boxes()]
    for box, expected in zip(boxes, row.boxes(), strict=True):
        assert (box.part, box.material == "glass") == (expected.part, expected.material == "glass")
        # Heights of capsules are sums.
        assert [*box.center_m, *box.size_m, box.yaw_rad] == pytest.approx(
            [*expected.center_m, *expected.size_m, expected.yaw_rad],
            rel=0,
            abs=1e-12 if isinstance(expected, Capsule) else 0,
        )
    assert len(read_boxes(world, "collision")) == len(boxes)
    names = [element.get("name") for element in world.iter("visual")]
    assert len(set(names)) == len(names)
    pose, camera = read_camera(world)
    assert pose == row.camera_pose()
    depth = cut_range(render_behind_glass(boxes, pose, camera.intrinsics()), camera).depth_m
    factor = 1.0 if row.bias is None else row.bias.depth_factor  # Gazebo's camera has no such error
    np.testing.assert_allclose(depth * factor, replay(row).cut.depth_m, atol=1e-6)


def test_an_off_centre_camera_is_refused() -> None:
    with pytest.raises(ConfigError, match="centred"):
        sdf_world(with_sensor(ROWS[0], "deepdoors2"), "world")
