# SPDX-License-Identifier: Apache-2.0
"""Share of a door hidden by clutter."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.draw.scenes import draw_cluttered
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.occlusion import BINS, DoorView, occluded_bin
from doorstate.simulation.scene import Box, Door, Opening, Scene
from doorstate.simulation.scene.scene import clutter_boxes
from doorstate.types import Part

AHEAD = CameraPose(0.0, 2.5, 1.0, -np.pi / 2)
CAMERA = DepthCamera(width=320, height=240)
SCENE = Scene(door=Door(swing="away"))
LEFT_HALF = Box(Part.OTHER, (0.5, 0.02, 1.2), (1.0, 0.001, 2.4))


def view(angle_deg: float) -> DoorView:
    return DoorView(SCENE, Opening(angle_deg=angle_deg), AHEAD, CAMERA)


@pytest.mark.parametrize("angle_deg", [0.0, 100.0])
def test_a_box_before_the_left_half_hides_half_of_the_door(angle_deg: float) -> None:
    # The opening counts as part of the door, so an open leaf gives the same share.
    assert view(angle_deg).occluded_share([LEFT_HALF]) == pytest.approx(0.5, abs=0.02)
    assert view(angle_deg).occluded_share([LEFT_HALF._replace(center_m=(0.0, 2.0, 1.2))]) == 1.0


def test_image_size_and_centre_hardly_change_the_share() -> None:
    off_centre = DepthCamera(width=640, height=480, cx_px=310.0, cy_px=250.0)
    share = DoorView(SCENE, Opening(), AHEAD, off_centre).occluded_share([LEFT_HALF])
    assert share == pytest.approx(view(0).occluded_share([LEFT_HALF]), abs=0.01)


def test_boxes_behind_and_beside_the_door_hide_nothing() -> None:
    assert view(0).occluded_share([]) == 0
    behind = Box(Part.OTHER, (0.0, -1.0, 1.0), (0.4, 0.4, 2.0))
    beside = Box(Part.OTHER, (1.5, 0.5, 1.0), (0.4, 0.4, 2.0))
    assert view(0).occluded_share([behind, beside]) == 0
    # Visible through the open door, it still hides nothing of it.
    assert view(100).occluded_share([behind, beside]) == 0


def test_bins() -> None:
    shares = (0.0, 0.009, 0.01, 0.25, 0.251, 0.5, 0.501, 0.75, 0.751, 1.0)
    expected = (0, 0, 1, 1, 2, 2, 3, 3, 4, 4)
    assert [occluded_bin(share) for share in shares] == [BINS[number] for number in expected]


def test_drawn_clutter_covers_all_bins_evenly() -> None:
    drawn = [draw_cluttered(Stream(0, index, "cluttered")) for index in range(32)]
    shares = []
    for scene in drawn:
        assert 1 <= len(scene.scene.items) <= 8
        assert 1 <= scene.clutter_tries <= 150
        door_view = DoorView(scene.scene, scene.openings[0], scene.viewpoint.camera_pose(), CAMERA)
        shares.append(door_view.occluded_share(clutter_boxes(scene.scene)))
    counts = [sum(occluded_bin(share) == name for share in shares) for name in BINS]
    assert counts[4] == 0
    assert min(counts[:4]) >= 4
