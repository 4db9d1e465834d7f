# SPDX-License-Identifier: Apache-2.0
"""What hides a door, and by how much."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.simulation.clutter import Item, item_boxes
from doorstate.simulation.doors import Opening, VariedDoor
from doorstate.simulation.draws import Draws
from doorstate.simulation.occlusion import BINS, DoorView, occluded_bin
from doorstate.simulation.plan import collide
from doorstate.simulation.rooms import Space
from doorstate.simulation.scene import Box
from doorstate.simulation.scene_draws import draw_cluttered
from doorstate.simulation.scenes import Scene, clutter_boxes
from doorstate.simulation.sensor import CameraPose, DepthCamera
from doorstate.types import Part

AHEAD = CameraPose(0.0, 2.5, 1.0, -np.pi / 2)
CAMERA = DepthCamera(width=320, height=240)
SCENE = Scene(door=VariedDoor(swing="away"), near=Space(), far=Space())


def view(angle_deg: float) -> DoorView:
    return DoorView(SCENE, Opening(angle_deg=angle_deg), AHEAD, CAMERA)


@pytest.mark.parametrize("angle_deg", [0.0, 100.0])
def test_half_a_door_is_hidden_by_what_stands_before_its_left_half(angle_deg: float) -> None:
    # An opening counts as the door: it does not matter that the leaf is gone.
    half = Box(Part.OTHER, (0.5, 0.02, 1.2), (1.0, 0.001, 2.4))
    assert view(angle_deg).occluded_share([half]) == pytest.approx(0.5, abs=0.02)
    assert view(angle_deg).occluded_share([half._replace(center_m=(0.0, 2.0, 1.2))]) == 1.0


def test_a_camera_that_is_larger_or_not_centred_gives_much_the_same_share() -> None:
    half = Box(Part.OTHER, (0.5, 0.02, 1.2), (1.0, 0.001, 2.4))
    off_centre = DepthCamera(width=640, height=480, cx_px=310.0, cy_px=250.0)
    share = DoorView(SCENE, Opening(), AHEAD, off_centre).occluded_share([half])
    assert share == pytest.approx(view(0).occluded_share([half]), abs=0.01)


def test_nothing_and_what_stands_elsewhere_hide_nothing() -> None:
    assert view(0).occluded_share([]) == 0
    behind = Box(Part.OTHER, (0.0, -1.0, 1.0), (0.4, 0.4, 2.0))
    aside = Box(Part.OTHER, (1.5, 0.5, 1.0), (0.4, 0.4, 2.0))
    assert view(0).occluded_share([behind, aside]) == 0
    # Through an open door it is seen, and hides nothing of the door.
    assert view(100).occluded_share([behind, aside]) == 0


def test_bins() -> None:
    shares = (0.0, 0.009, 0.01, 0.25, 0.251, 0.5, 0.501, 0.75, 0.751, 1.0)
    expected = (0, 0, 1, 1, 2, 2, 3, 3, 4, 4)
    assert [occluded_bin(share) for share in shares] == [BINS[number] for number in expected]


def test_drawn_clutter_hides_what_was_asked_for() -> None:
    drawn = [draw_cluttered(Draws(0, index, "cluttered")) for index in range(32)]
    shares = []
    for scene, viewpoint, openings, tries in drawn:
        assert 1 <= len(scene.items) <= 8
        assert 1 <= tries <= 150
        seen = DoorView(scene, openings[0], viewpoint.camera_pose(), CAMERA)
        shares.append(seen.occluded_share(clutter_boxes(scene)))
    counts = [sum(occluded_bin(share) == name for share in shares) for name in BINS]
    assert counts[4] == 0
    assert min(counts[:4]) >= 4


@pytest.mark.parametrize("kind", ["chair", "table", "cabinet", "bin", "plant", "person", "carton"])
def test_things_stand_on_the_floor_in_one_piece_within_their_size(kind: str) -> None:
    item = Item.model_validate(
        {
            "kind": kind,
            "x_m": 1.0,
            "y_m": 2.0,
            "yaw_deg": 0.0,
            "width_m": 0.5,
            "depth_m": 0.4,
            "height_m": 1.2,
        }
    )
    boxes = item_boxes(item)
    low = np.min([np.array(box.center_m) - np.array(box.size_m) / 2 for box in boxes], axis=0)
    high = np.max([np.array(box.center_m) + np.array(box.size_m) / 2 for box in boxes], axis=0)
    np.testing.assert_allclose(low, (0.75, 1.8, 0.0), atol=1e-12)
    np.testing.assert_allclose(high, (1.25, 2.2, 1.2), atol=1e-12)
    for box in boxes:
        others = [other for other in boxes if other != box]
        assert not others or collide([box], others, -0.001)
        assert min(box.size_m) > 0
