# SPDX-License-Identifier: Apache-2.0
"""From a raw cloud to a prediction, on the path of training."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import torch

from doorstate.clouds.normalization import Input, normalize
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import CloudContentError, ConfigError
from doorstate.inference.backends import Outputs
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.doorway_predictor import DoorwayPredictor
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import add_heads, head_outputs
from doorstate.networks.heads import HEADS, head_columns
from doorstate.networks.packaged import packaged_networks, packaged_weights
from doorstate.networks.weights import save_weights
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import unflatten
from doorstate.types import STATES, Points
from tests.hand_made_clouds import image_of_a_rough_wall


@pytest.fixture(scope="module")
def predictor() -> NetworkPredictor:
    card = WeightsCard(network="pointnet2", num_points=160)
    return NetworkPredictor(TorchBackend(create_network("pointnet2"), card), thin=False)


def test_probabilities_are_those_of_the_network_for_the_prepared_cloud(
    predictor: NetworkPredictor, small_dataset: PreparedDataset
) -> None:
    raw = replay(unflatten(small_dataset.rows[5])).points
    prediction = predictor(raw)
    with torch.no_grad():
        logits = predictor.backend.network(torch.from_numpy(normalize(small_dataset.cloud(5)))[None])
    expected = logits.softmax(1)[0].numpy()
    np.testing.assert_allclose(list(prediction.probabilities.values()), expected, atol=1e-6)
    assert list(prediction.probabilities) == list(STATES)
    assert prediction.state == STATES[expected.argmax()]
    assert prediction.num_points == 160
    assert prediction.milliseconds > 0


def test_organized_and_flat_clouds_give_the_same_prediction(
    predictor: NetworkPredictor, small_dataset: PreparedDataset
) -> None:
    raw = replay(unflatten(small_dataset.rows[1])).points
    flat = raw.reshape(-1, 3)
    assert predictor(raw).probabilities == predictor(flat).probabilities
    measured = flat[np.isfinite(flat).all(axis=1)]
    assert predictor(measured).probabilities == predictor(flat).probabilities


def test_thinning_samples_a_grid_of_pixels(small_dataset: PreparedDataset) -> None:
    raw = replay(unflatten(small_dataset.rows[1])).points  # (480, 640, 3)
    card = WeightsCard(network="pointnet2", num_points=160)
    quick = NetworkPredictor(TorchBackend(create_network("pointnet2"), card))
    step = 10  # 48 x 64 = 3072 pixels are the fewest above 16 x 160
    every = NetworkPredictor(quick.backend, thin=False)
    assert quick(raw).probabilities == every(raw[::step, ::step]).probabilities
    assert quick(raw).probabilities != every(raw).probabilities


def test_fewer_points_than_trained_with_are_all_used(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (140, 3)).astype(np.float32)
    assert predictor(cloud).num_points == 140
    assert len(prepare_cloud(cloud, CloudSpec(num_points=160)).points) == 140


def test_a_frame_without_data_is_unknown_and_does_not_change_its_batch(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)
    blank = np.full((480, 640, 3), np.nan, dtype=np.float32)
    ungated = NetworkPredictor(predictor.backend, gate=None)
    for variant in (predictor, ungated):
        first, empty, few, last = variant.batch([cloud, blank, cloud[:127], cloud])
        assert first.state is not None
        # The sums of a batch may be ordered differently from those of one cloud.
        assert first.probabilities == pytest.approx(last.probabilities, abs=1e-6)
        assert first.probabilities == pytest.approx(variant(cloud).probabilities, abs=1e-6)
        assert (empty.state, empty.num_points, few.state, few.num_points) == (None, 0, None, 0)
        for prediction in (empty, few):
            assert prediction.abstention is not None
            assert prediction.abstention.code == "too_few_points"
    assert predictor.batch([]) == []


def test_one_cloud_is_not_a_batch_and_a_batch_is_not_an_image(predictor: NetworkPredictor) -> None:
    image = image_of_a_rough_wall(60, 80)
    for cloud in (image, image.reshape(-1, 3)):
        with pytest.raises(CloudContentError):
            predictor.batch(cloud)
    several = np.random.default_rng(0).uniform(1, 3, (3, 300, 3)).astype(np.float32)
    assert len(predictor.batch(several)) == 3
    with pytest.raises(CloudContentError):
        predictor(several)


def test_a_batch_in_another_unit_is_an_error(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)
    with pytest.raises(CloudContentError, match="1000 times too far"):
        predictor.batch([cloud, cloud * 1000])


@pytest.mark.parametrize(
    ("cloud", "form"),
    [
        (
            np.ones((480, 640, 4), np.float32),
            r"float32 of shape \(480, 640, 4\)",
        ),
        (np.ones((1000, 4), np.float32), r"float32 of shape \(1000, 4\)"),
        (np.ones((480, 640), np.float32), r"float32 of shape \(480, 640\)"),
        (np.ones((1000, 2), np.float32), r"float32 of shape \(1000, 2\)"),
        (np.ones((1, 480, 640, 3), np.float32), r"float32 of shape \(1, 480, 640, 3\)"),
        (None, r"object of shape \(\)"),
        ("cloud.pcd", r"<U9 of shape \(\)"),
    ],
)
def test_other_arrays_are_content_errors(predictor: NetworkPredictor, cloud: Any, form: str) -> None:
    for method in (predictor, RulePredictor.from_name("plane_state")):
        with pytest.raises(CloudContentError, match=form):
            method(cloud)


def test_a_list_of_rows_is_a_cloud(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)
    assert predictor(cloud.tolist()).probabilities == predictor(cloud).probabilities  # type: ignore[arg-type]


def test_missing_data_give_no_state_and_a_reason(small_dataset: PreparedDataset) -> None:
    card = WeightsCard(network="pointnet2", num_points=160)
    network = create_network("pointnet2")
    half = replay(unflatten(small_dataset.rows[2])).points.copy()
    half[:, :320] = np.nan
    prediction = NetworkPredictor(TorchBackend(network, card))(half)
    assert prediction.state is None
    assert prediction.abstention is not None
    assert prediction.abstention.code == "narrow_view"
    assert (prediction.probabilities, prediction.raw_probabilities) == (None, None)
    assert prediction.num_points == 160
    limited = NetworkPredictor(TorchBackend(network, card), gate=None)(half)
    assert limited.state is not None
    assert limited.reason == ""


def test_a_batch_gives_the_predictions_of_its_clouds(
    predictor: NetworkPredictor, small_dataset: PreparedDataset
) -> None:
    raw = [replay(unflatten(row)).points for row in small_dataset.rows[:4]]
    few = np.random.default_rng(0).uniform(1, 3, (140, 3)).astype(np.float32)
    half = raw[0].copy()
    half[:, 320:] = np.nan
    clouds = [raw[0], few, half, raw[1].reshape(-1, 3), raw[2], raw[3]]
    together, alone = predictor.batch(clouds), [predictor(cloud) for cloud in clouds]
    for one, other in zip(together, alone, strict=True):
        assert (one.state, one.num_points, one.reason) == (other.state, other.num_points, other.reason)
        assert one.probabilities == pytest.approx(other.probabilities, abs=1e-5)
    assert [prediction.state is None for prediction in together] == [False, False, True, False, False, False]
    assert predictor.batch([]) == []


def test_clouds_of_equal_size_pass_the_network_together(
    predictor: NetworkPredictor, small_dataset: PreparedDataset
) -> None:
    sizes: list[int] = []
    assert isinstance(predictor.backend.network, PointNetwork)
    handle = predictor.backend.network.get_submodule("level1").register_forward_hook(
        lambda _, inputs, __: sizes.append(len(inputs[0]))
    )
    predictor.batch([replay(unflatten(row)).points for row in small_dataset.rows[:3]])
    handle.remove()
    assert sizes == [3]


def test_threads_share_a_predictor(predictor: NetworkPredictor, small_dataset: PreparedDataset) -> None:
    clouds = [small_dataset.cloud(number) for number in range(12)]
    alone = [predictor(cloud).probabilities for cloud in clouds]
    with ThreadPoolExecutor(4) as threads:
        together = [prediction.probabilities for prediction in threads.map(predictor, clouds * 4)]
    assert together == alone * 4


@pytest.mark.parametrize("name", [name for name in packaged_networks() if name.startswith("ogurob-")])
def test_packaged_weights_predict_new_doors(name: str, small_dataset: PreparedDataset) -> None:
    assert packaged_weights(name).stat().st_size < 8e6
    predictor = NetworkPredictor.from_weights(name)
    predictor.warm_up()
    right = sum(
        predictor(replay(unflatten(row)).points).state == row["state"] for row in small_dataset.rows[:18]
    )
    # Another seed than they were trained on; a weights file that was mixed up would get a third.
    assert right >= 16


@pytest.fixture(scope="module")
def headed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Untrained weights with every head."""
    torch.manual_seed(0)
    network, heads = create_network("pointnet2"), (*HEADS, "parts")
    add_heads(network, heads)
    path = tmp_path_factory.mktemp("headed") / "pointnet2.safetensors"
    save_weights(path, network, WeightsCard(network="pointnet2", num_points=160, heads=heads))
    return path


def test_heads_are_in_metres_and_degrees(headed: Path, small_dataset: PreparedDataset) -> None:
    predictor = NetworkPredictor.from_weights(headed)
    cloud = replay(unflatten(small_dataset.rows[5])).points
    assert isinstance(predictor.backend.network, PointNetwork)
    torch.nn.init.constant_(predictor.backend.network.heads["door"].linear.bias, 9.0)  # type: ignore[union-attr, arg-type]
    prediction = predictor(cloud)
    prepared = prepare_cloud(cloud, CloudSpec(num_points=160, thin=True)).points[None]
    with torch.no_grad():
        outputs = head_outputs(predictor.backend.network, torch.from_numpy(normalize(prepared)))
    columns = head_columns(
        {name: outputs[name].numpy() for name in HEADS}, predictor.card.normalization.placement(prepared)
    )
    assert prediction.door_probability == pytest.approx(columns["p_door"][0])
    assert prediction.opening_angle_deg == pytest.approx(columns["opening_angle_deg"][0])
    p_left = columns["p_hinge_left"][0]
    assert prediction.hinge == ("left" if p_left >= 0.5 else "right")
    assert prediction.hinge_probability == pytest.approx(max(p_left, 1 - p_left))
    assert prediction.frame is not None
    assert prediction.frame.x_m == pytest.approx(columns["door_x_m"][0], abs=1e-5)
    assert prediction.frame.yaw_deg == pytest.approx(columns["door_yaw_deg"][0])
    assert prediction.passable_width_m == pytest.approx(columns["passable_width_m"][0])
    # The mean point of a cloud is within two metres of its door.
    assert 0 < prediction.frame.x_m < 6


def test_a_batch_gives_the_heads_of_its_clouds(headed: Path, small_dataset: PreparedDataset) -> None:
    predictor = NetworkPredictor.from_weights(headed)
    clouds = [small_dataset.cloud(index) for index in (0, 7)] + [small_dataset.cloud(3)[:140]]
    for alone, together in zip(map(predictor, clouds), predictor.batch(clouds), strict=True):
        assert alone.state == together.state
        assert alone.num_points == together.num_points
        assert together.frame == (alone.frame and pytest.approx(alone.frame, abs=1e-4))


def test_no_door_gives_no_state(headed: Path, small_dataset: PreparedDataset) -> None:
    predictor = NetworkPredictor.from_weights(headed)
    door = predictor.backend.network.heads["door"]  # type: ignore[union-attr]
    cloud = small_dataset.cloud(2)
    for bias, sees in ((-9.0, False), (9.0, True)):
        torch.nn.init.constant_(door.linear.bias, bias)  # type: ignore[union-attr, arg-type]
        prediction = predictor(cloud)
        assert (prediction.state is not None) == sees == (prediction.reason == "")
        assert sees or (prediction.abstention is not None and prediction.abstention.code == "no_door")


def test_an_unsure_network_abstains_below_the_limit_of_its_weights(small_dataset: PreparedDataset) -> None:
    network = create_network("pointnet2")
    cloud = small_dataset.cloud(2)
    prediction = NetworkPredictor(TorchBackend(network, WeightsCard(network="pointnet2", num_points=160)))(
        cloud
    )
    assert prediction.state is not None
    best = max(prediction.probabilities.values())
    for least, has_state in ((best - 0.01, True), (best + 0.01, False)):
        card = WeightsCard(network="pointnet2", num_points=160, abstain_below=least)
        limited = NetworkPredictor(TorchBackend(network, card))(cloud)
        assert (limited.state == prediction.state) == has_state
        if limited.abstention is not None:
            assert limited.abstention.code == "unsure"
            assert limited.abstention.values == {
                "state": prediction.state,
                "probability": best,
                "min_probability": least,
            }
        assert limited.raw_probabilities == prediction.probabilities
        assert (limited.probabilities is None) != has_state


def test_points_beyond_the_depth_of_the_training_data_are_ignored(small_dataset: PreparedDataset) -> None:
    network = create_network("pointnet2")
    room = small_dataset.cloud(2)
    corridor = np.concatenate([room, room + np.array([8, 0, 0], np.float32)])
    near, far = (WeightsCard(network="pointnet2", num_points=160, max_depth_m=reach) for reach in (5.0, None))
    near_predictor, far_predictor = (NetworkPredictor(TorchBackend(network, card)) for card in (near, far))
    assert near_predictor(corridor) == replace(near_predictor(room), milliseconds=pytest.approx(0, abs=1e4))
    assert far_predictor(corridor).probabilities != far_predictor(room).probabilities


def test_a_simulated_dataset_has_the_range_of_its_camera(small_dataset: PreparedDataset) -> None:
    assert small_dataset.depth_range_m == 5.0


def test_warming_up_gives_an_exported_network_all_its_points() -> None:
    class FixedSize(TorchBackend):
        num_points = 1024
        counts: ClassVar[list[int]] = []

        def __call__(self, points: Points) -> Outputs:
            self.counts.append(points.shape[1])
            return super().__call__(points)

    card = WeightsCard(network="pointnet", num_points=1024)
    NetworkPredictor(FixedSize(create_network("pointnet"), card)).warm_up()
    assert FixedSize.counts == [1024]


@pytest.mark.parametrize(("kind", "input_"), [(NetworkPredictor, "doorway"), (DoorwayPredictor, "whole")])
def test_weights_for_clouds_of_another_kind_are_refused(kind: type[NetworkPredictor], input_: Input) -> None:
    card = WeightsCard(network="pointnet", num_points=128, input=input_)
    backend = TorchBackend(create_network("pointnet"), card)
    with pytest.raises(ConfigError, match=input_):
        kind(backend)
    assert NetworkPredictor.for_card(card)(backend).input == input_
