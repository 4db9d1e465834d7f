# SPDX-License-Identifier: Apache-2.0
"""Truth of doors of all kinds: state, hinge, opening and passable width."""

from __future__ import annotations

import pytest

from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.simulation.row import Row
from doorstate.simulation.scene import Door, Opening, Scene
from doorstate.simulation.scene.box import Pose
from doorstate.simulation.true_door import TrueDoor, describe_door
from doorstate.simulation.truth import main_columns, true_doors
from doorstate.types import UNKNOWN_STATE
from tests.simulation.scene.doors_by_share import BI_FOLD, BI_PARTING, BY_SHARE, LIFT, REVOLVING

BOLTED = Door(kind="double_equal", opening_width_m=1.8, active_share=0.5, hinge_offset_m=0.0125)
CAMERA = Pose(0.4, 2.5, -1.6)


def describe(door: Door, **opening: float) -> TrueDoor:
    return describe_door(door, Opening(**opening), CAMERA, 1.0)


@pytest.mark.parametrize(("angle_deg", "state"), [(0.0, "closed"), (40.0, "semi_open"), (90.0, "open")])
def test_a_double_door_with_a_bolted_leaf_has_the_state_of_the_other(angle_deg: float, state: str) -> None:
    truth = describe(BOLTED, angle_deg=angle_deg)
    assert (truth.state, truth.hinge, truth.ambiguous) == (state, "left", False)
    assert (truth.opening_angle_deg, truth.passive_angle_deg) == (angle_deg, 0.0)
    single = describe(Door(opening_width_m=0.9, hinge_offset_m=0.0125), angle_deg=angle_deg)
    assert truth.passable_width_m == pytest.approx(single.passable_width_m, abs=0.025)
    assert truth.width_m == 1.8


def test_two_open_leaves_set_the_whole_opening_free() -> None:
    both = describe(BOLTED, angle_deg=90.0, passive_angle_deg=90.0)
    assert both.passable_width_m == pytest.approx(1.8 - 2 * (0.043 + 0.0125), abs=0.001)


@pytest.mark.parametrize("door", [BI_PARTING, LIFT], ids=["before the wall", "in the wall"])
@pytest.mark.parametrize(("share", "state"), [(0.0, "closed"), (0.5, "semi_open"), (0.9, "open")])
def test_bi_parting_doors_have_a_state_by_their_share(door: Door, share: float, state: str) -> None:
    truth = describe(door, share=share)
    assert (truth.kind, truth.state, truth.hinge) == ("sliding_double", state, "")
    assert (truth.opening_angle_deg, truth.passive_angle_deg, truth.opening_share) == (None, None, share)
    assert truth.passable_width_m == pytest.approx(share * door.opening_width_m)


@pytest.mark.parametrize("door", [BI_FOLD, REVOLVING], ids=lambda door: door.kind)
def test_the_state_of_folding_and_revolving_doors_is_unknown(door: Door) -> None:
    for share in (0.0, 0.4, 1.0):
        truth = describe(door, share=share)
        assert (truth.state, truth.ambiguous, truth.hinge) == (UNKNOWN_STATE, False, "")
        assert (truth.opening_angle_deg, truth.opening_share) == (None, share)
        assert main_columns(truth)["state"] == "unknown"


def row_of(door: Door, share: float) -> Row:
    """Return a row of the preset `varied` with another door."""
    row = draw_rows(PRESETS["varied"], 0, 0)[0]
    truth = describe_door(door, Opening(share=share), Pose(row.x_m, row.y_m, row.camera_pose().yaw_rad), 1.0)
    return row.model_copy(update=main_columns(truth) | {"scene": Scene(door=door)})


@pytest.mark.parametrize("door", BY_SHARE.values(), ids=BY_SHARE)
def test_a_row_keeps_how_far_a_door_is_open(door: Door) -> None:
    row = row_of(door, 0.35)
    read = unflatten(flatten(row))
    assert read == row
    assert read.opening() == Opening(share=0.35)
    (truth,) = true_doors(read)
    assert (truth.kind, truth.state) == (door.kind, row.state)


@pytest.mark.parametrize("door", [BI_FOLD, REVOLVING], ids=lambda door: door.kind)
def test_samples_of_an_unknown_state_are_told_apart(door: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    from doorstate.simulation.draw import scenes

    monkeypatch.setattr(scenes, "draw_door", lambda stream: door)
    rows, _ = simulate_rows(PRESETS["varied"], 0, 1)
    assert [row.sample_id.rsplit("-", 1)[1] for row in rows] == ["a0", "a1", "a2"]
    assert {row.state for row in rows} == {UNKNOWN_STATE}
    assert len({row.opening_share for row in rows}) == 3
    assert all(row.visible_leaf_px > 0 and not row.same_image_as for row in rows)
