# SPDX-License-Identifier: Apache-2.0
"""Boxes of clutter."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.simulation.scene.clutter import Item, item_boxes
from doorstate.simulation.scene.plan import collide


@pytest.mark.parametrize("kind", ["chair", "table", "cabinet", "bin", "plant", "person", "carton"])
def test_items_stand_on_the_floor_in_one_piece_within_their_size(kind: str) -> None:
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
        rest = [part for part in boxes if part != box]
        assert not rest or collide([box], rest, -0.001)
        assert min(box.size_m) > 0
