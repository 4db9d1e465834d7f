# SPDX-License-Identifier: Apache-2.0
"""From a raw cloud to every door in it, with a scripted finder and network, and with an untrained one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import torch

from doorstate.clouds.leveling import Leveling
from doorstate.clouds.vertical import LevelingRefusal
from doorstate.errors import CloudContentError, ConfigError
from doorstate.inference.door import Door
from doorstate.inference.doorway_predictor import MAX_DOORS, DoorwayPredictor
from doorstate.inference.gate import DoorwayCheck, Gate
from doorstate.inference.known import DoorHint
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.io.rotations import tilt_matrix
from doorstate.networks import create_network
from doorstate.networks.head_layers import add_heads
from doorstate.networks.weights import save_weights
from doorstate.types import DoorState, Points
from tests.inference.scripted_doorways import (
    CARD,
    FLOOR_M,
    HEADS,
    ScriptedBackend,
    doorway,
    outputs,
    room,
    scripted_predictor,
)

AHEAD, LEFT, RIGHT = doorway(3.0), doorway(2.5, 40.0), doorway(2.0, -50.0)


@pytest.fixture(scope="module")
def cloud() -> Points:
    return room()


def test_doors_are_in_order_of_remoteness_after_one_call_of_the_network(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = [outputs("closed"), outputs("open"), outputs("semi_open", 0.1)]
    predictor = scripted_predictor(monkeypatch, [LEFT, AHEAD, RIGHT], script)
    prediction = predictor(cloud)
    assert isinstance(predictor.backend, ScriptedBackend)
    assert predictor.backend.batches == [(3, 128, 3)]
    assert [door.state for door in prediction.doors] == [DoorState.OPEN, DoorState.CLOSED]
    assert prediction.state is DoorState.OPEN
    assert prediction.frame == prediction.doors[0].frame
    assert prediction.frame.x_m == pytest.approx(3.0)
    assert (prediction.opening_angle_deg, prediction.hinge) == (pytest.approx(90.0), "left")
    assert [door.bearing_deg for door in prediction.doors] == pytest.approx([0.0, 40.0], abs=1e-3)
    assert [door.bearing_deg for door in prediction.refused] == pytest.approx([-50.0], abs=1e-3)
    assert prediction.num_points == 3 * 128
    assert prediction.tilt is None


def test_a_batch_passes_the_network_together_and_keeps_its_order(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = [outputs("closed"), outputs("open"), outputs("semi_open"), outputs("open")]
    predictor = scripted_predictor(monkeypatch, [AHEAD, LEFT], script)
    empty = np.full((40, 40, 3), np.nan, np.float32)
    first, blank, second = predictor.batch([cloud, empty, cloud])
    assert isinstance(predictor.backend, ScriptedBackend)
    assert predictor.backend.batches == [(4, 128, 3)]
    assert [door.label for door in first.doors] == ["closed", "open"]
    assert [door.label for door in second.doors] == ["semi_open", "open"]
    assert (blank.state, blank.num_points, blank.doors) == (None, 0, ())
    assert blank.abstention is not None
    assert blank.abstention.code == "too_few_points"
    assert predictor.batch([]) == []


def test_crops_reach_the_network_in_the_doorways_frame(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Points] = []
    predictor = scripted_predictor(monkeypatch, [LEFT], [outputs()])
    call = predictor.backend.__call__
    monkeypatch.setattr(
        ScriptedBackend,
        "__call__",
        lambda self, points: (seen.append(points), type(call).__call__(call, points))[1],
    )
    predictor(cloud)
    (crops,) = seen
    low, high = crops[0].min(axis=0), crops[0].max(axis=0)
    np.testing.assert_allclose(low, [-1.5, -1.5, 0.0], atol=0.1)
    np.testing.assert_allclose(high, [1.5, 1.5, 2.4], atol=0.1)


def test_without_candidates_there_is_no_doorway(cloud: Points, monkeypatch: pytest.MonkeyPatch) -> None:
    prediction = scripted_predictor(monkeypatch, [], [])(cloud)
    assert (prediction.state, prediction.doors) == (None, ())
    assert prediction.abstention is not None
    assert prediction.abstention.code == "no_doorway"
    assert prediction.num_points > 0


def test_candidates_without_points_are_refused(cloud: Points, monkeypatch: pytest.MonkeyPatch) -> None:
    prediction = scripted_predictor(monkeypatch, [doorway(15.0), AHEAD], [outputs()])(cloud)
    assert len(prediction.doors) == 1
    (refused,) = prediction.refused
    assert refused.abstention is not None
    assert (refused.abstention.code, refused.distance_m) == ("too_few_points", pytest.approx(15.0))


def test_invalid_outputs_for_one_crop_refuse_the_cloud(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = [outputs(), outputs(opening_angle_deg=math.nan)]
    prediction = scripted_predictor(monkeypatch, [AHEAD, LEFT], script)(cloud)
    assert prediction.abstention is not None
    assert (prediction.abstention.code, prediction.doors) == ("invalid_outputs", ())


def test_no_more_than_eight_doors(cloud: Points, monkeypatch: pytest.MonkeyPatch) -> None:
    found = [doorway(distance, bearing) for distance in (2.0, 3.0, 4.0) for bearing in (-50, -20, 20, 50)]
    prediction = scripted_predictor(monkeypatch, found, [outputs()] * 12)(cloud)
    assert len(prediction.doors) == MAX_DOORS
    remoteness = [door.remoteness_m for door in prediction.doors]
    assert remoteness == sorted(remoteness)


def test_a_known_door_is_asked_for_its_state(cloud: Points, monkeypatch: pytest.MonkeyPatch) -> None:
    script = [outputs("closed", 0.1), outputs("open", 0.3)]
    assert scripted_predictor(monkeypatch, [AHEAD, LEFT], script)(cloud).state is None
    prediction = scripted_predictor(monkeypatch, [AHEAD, LEFT], script)(cloud, door_known=True)
    assert (prediction.state, prediction.door_probability) == (DoorState.OPEN, pytest.approx(0.3))
    assert len(prediction.refused) == 1


def test_a_rough_pose_comes_first_and_is_cropped_itself_without_a_candidate(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    hint = DoorHint(LEFT.x_m + 0.2, LEFT.y_m - 0.2)
    prediction = scripted_predictor(monkeypatch, [AHEAD, LEFT], [outputs("closed", 0.2), outputs("open")])(
        cloud, door_known=hint
    )
    assert [door.label for door in prediction.doors] == ["closed", "open"]
    assert prediction.doors[0].frame == pytest.approx((LEFT.x_m, LEFT.y_m, LEFT.yaw_deg), abs=1e-5)
    alone = scripted_predictor(monkeypatch, [AHEAD], [outputs("semi_open", 0.2), outputs("open")])(
        cloud, door_known=DoorHint(2.0, -1.5, 40.0, 0.8)
    )
    assert [door.label for door in alone.doors] == ["semi_open", "open"]
    assert (alone.frame and alone.frame.x_m) == pytest.approx(2.0)


def test_a_rough_pose_needs_a_floor(cloud: Points, monkeypatch: pytest.MonkeyPatch) -> None:
    leveling = Leveling(cloud, np.eye(3), "walls")
    prediction = scripted_predictor(monkeypatch, [AHEAD], [], leveling=leveling)(
        cloud, door_known=DoorHint(3.0, 0.0)
    )
    assert prediction.abstention is not None
    assert prediction.abstention.code == "no_floor"


def test_a_cloud_without_a_vertical_is_refused_with_its_reason(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    leveling = Leveling(
        cloud, np.eye(3), None, refusal=LevelingRefusal("tilt_no_planes", {"share": 0.1, "min_share": 0.2})
    )
    prediction = scripted_predictor(monkeypatch, [AHEAD], [], leveling=leveling)(cloud)
    assert prediction.abstention is not None
    assert (prediction.abstention.code, prediction.state) == ("tilt_no_planes", None)
    assert str(prediction.abstention)


def test_poses_are_level_and_lead_back_to_the_tilted_cloud(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    rotation = np.array(tilt_matrix(10.0, -20.0))
    tilted = (cloud.astype(np.float64) @ rotation).astype(np.float32)  # R^T of every point
    leveling = Leveling(cloud, rotation, "floor", 0.4, FLOOR_M)
    prediction = scripted_predictor(monkeypatch, [AHEAD], [outputs("open")], leveling=leveling)(tilted)
    assert prediction.tilt is not None
    assert prediction.tilt[:2] == pytest.approx((10.0, -20.0))
    assert (prediction.tilt.source, prediction.tilt.error_deg) == ("floor", 0.4)
    door = prediction.doors[0]
    assert (door.x_m, door.y_m) == pytest.approx((3.0, 0.0), abs=1e-5)
    back = prediction.tilt.from_level(np.array([door.x_m, door.y_m, FLOOR_M]))
    np.testing.assert_allclose(back, [3.0, 0.0, FLOOR_M] @ rotation, atol=1e-5)
    np.testing.assert_allclose(prediction.tilt.to_level(tilted), cloud, atol=1e-5)


def test_the_gate_is_asked_about_every_door_with_a_state(
    cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float] = []

    class Strict(Gate):
        def check_doorways(self, cloud: Points, doors: Sequence[Door]) -> list[DoorwayCheck]:
            asked.extend(door.distance_m for door in doors)
            return [DoorwayCheck(None, leaf_seen=number == 0) for number in range(len(doors))]

    predictor = scripted_predictor(
        monkeypatch, [AHEAD, LEFT, RIGHT], [outputs("closed"), outputs("closed"), outputs("closed", 0.2)]
    )
    predictor.gate = Strict()
    prediction = predictor(cloud)
    assert asked == pytest.approx([3.0, 2.5])
    assert [door.leaf_seen for door in prediction.doors] == [True, False]


def test_points_in_another_unit_are_an_error(cloud: Points, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CloudContentError):
        scripted_predictor(monkeypatch, [AHEAD], [outputs()])(cloud * 1000)


@pytest.fixture(scope="module")
def untrained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Weights of an untrained PointNet for doorways, with every head for whole clouds."""
    torch.manual_seed(0)
    network = create_network("pointnet")
    add_heads(network, HEADS)
    path = tmp_path_factory.mktemp("doorways") / "pointnet.safetensors"
    save_weights(path, network, CARD)
    return path


def test_weights_for_doorways_are_loaded_as_such(
    untrained: Path, cloud: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    predictor = Predictor.load(untrained, gate=None)
    assert isinstance(predictor, DoorwayPredictor)
    assert predictor.name == "pointnet"
    scripted_predictor(monkeypatch, [AHEAD, LEFT], [])
    predictor.warm_up()
    prediction = predictor(cloud, door_known=True)
    assert prediction.state is not None
    prepared = predictor.prepare(cloud)
    assert prepared.points.shape == (256, 3)
    np.testing.assert_allclose(prepared.points, cloud[prepared.indices], atol=1e-5)
    limited = Predictor.load(untrained, num_points=200, gate=None)
    assert limited(cloud).num_points == 400


def test_whole_clouds_take_no_rough_place(weights: Path, cloud: Points) -> None:
    for predictor in (Predictor.load(weights), Predictor.load(rule="plane_state")):
        with pytest.raises(ConfigError) as caught:
            predictor(cloud, door_known=DoorHint(3.0, 0.0))
        assert caught.value.field == "door_known"
    whole = NetworkPredictor.from_weights(weights, gate=None)
    assert whole(cloud, door_known=True).probabilities == whole(cloud).probabilities
