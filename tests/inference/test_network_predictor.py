# SPDX-License-Identifier: Apache-2.0
"""From a raw cloud to an answer: the path of training, whatever form the cloud has."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from doorstate.clouds.normalization import normalize
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import CloudContentError, ConfigError, WeightsError
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.head_layers import add_heads, head_outputs
from doorstate.networks.heads import HEADS, head_columns
from doorstate.networks.packaged import packaged_networks, packaged_weights
from doorstate.networks.weights import WeightsCard, save_weights
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import unflatten
from doorstate.types import STATES
from tests.hand_made_clouds import image_of_a_rough_wall


@pytest.fixture(scope="module")
def predictor() -> NetworkPredictor:
    card = WeightsCard(network="pointnet2", num_points=160)
    return NetworkPredictor(TorchBackend(create_network("pointnet2"), card), thin=False)


def test_it_answers_what_the_network_says_of_the_prepared_cloud(
    predictor: NetworkPredictor, small_dataset: PreparedDataset
) -> None:
    raw = replay(unflatten(small_dataset.rows[5])).points
    answer = predictor(raw)
    with torch.no_grad():
        logits = predictor.backend.network(torch.from_numpy(normalize(small_dataset.cloud(5)))[None])
    expected = logits.softmax(1)[0].numpy()
    np.testing.assert_allclose(list(answer.probabilities.values()), expected, atol=1e-6)
    assert list(answer.probabilities) == list(STATES)
    assert answer.state == int(expected.argmax())
    assert answer.num_points == 160
    assert answer.milliseconds > 0


def test_organized_flat_and_shuffled_clouds_give_one_answer(
    predictor: NetworkPredictor, small_dataset: PreparedDataset
) -> None:
    raw = replay(unflatten(small_dataset.rows[1])).points
    flat = raw.reshape(-1, 3)
    assert predictor(raw).probabilities == predictor(flat).probabilities
    measured = flat[np.isfinite(flat).all(axis=1)]
    assert predictor(measured).probabilities == predictor(flat).probabilities


def test_thinning_takes_the_points_from_some_pixels(small_dataset: PreparedDataset) -> None:
    raw = replay(unflatten(small_dataset.rows[1])).points  # (480, 640, 3)
    card = WeightsCard(network="pointnet2", num_points=160)
    quick = NetworkPredictor(TorchBackend(create_network("pointnet2"), card))
    step = 10  # 48 x 64 = 3072 pixels are the fewest above 16 x 160
    every = NetworkPredictor(quick.backend, thin=False)
    assert quick(raw).probabilities == every(raw[::step, ::step]).probabilities
    assert quick(raw).probabilities != every(raw).probabilities
    assert quick(raw.reshape(-1, 3)).probabilities == every(raw).probabilities  # neighbours in no image


def test_fewer_points_than_trained_with_are_used_as_they_are(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (140, 3)).astype(np.float32)
    assert predictor(cloud).num_points == 140
    assert len(prepare_cloud(cloud, CloudSpec(num_points=160)).points) == 140


def test_a_frame_without_data_is_unknown_and_costs_its_batch_nothing(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)
    blank = np.full((480, 640, 3), np.nan, dtype=np.float32)
    ungated = NetworkPredictor(predictor.backend, gate=None)
    for asked in (predictor, ungated):
        first, empty, few, last = asked.batch([cloud, blank, cloud[:127], cloud])
        assert first.state is not None
        assert first.probabilities == last.probabilities == asked(cloud).probabilities
        assert (empty.state, empty.num_points, few.state, few.num_points) == (None, 0, None, 0)
        for prediction in (empty, few):
            assert prediction.abstention is not None
            assert prediction.abstention.code == "too_few_points"
    assert predictor.batch([]) == []


def test_one_cloud_is_no_batch_and_several_are_no_image(predictor: NetworkPredictor) -> None:
    image = image_of_a_rough_wall(60, 80)
    for cloud in (image, image.reshape(-1, 3)):
        with pytest.raises(CloudContentError, match="this is one cloud"):
            predictor.batch(cloud)
    several = np.random.default_rng(0).uniform(1, 3, (3, 300, 3)).astype(np.float32)
    assert len(predictor.batch(several)) == 3
    with pytest.raises(CloudContentError, match="is no image"):
        predictor(several)


def test_a_batch_in_another_unit_is_an_error(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)
    with pytest.raises(CloudContentError, match="1000 times too far"):
        predictor.batch([cloud, cloud * 1000])


@pytest.mark.parametrize(
    ("cloud", "complaint"),
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
def test_what_is_no_array_of_points_is_refused(
    predictor: NetworkPredictor, cloud: Any, complaint: str
) -> None:
    for asked in (predictor, RulePredictor.from_name("plane_state")):
        with pytest.raises(CloudContentError, match=complaint):
            asked(cloud)


def test_rows_of_a_list_are_points(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (200, 3)).astype(np.float32)
    assert predictor(cloud.tolist()).probabilities == predictor(cloud).probabilities  # type: ignore[arg-type]


def test_weights_load_by_path_and_by_name(tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    save_weights(path, create_network("pointcnn"), WeightsCard(network="pointcnn", num_points=256))
    assert NetworkPredictor.from_weights(path).num_points == 256
    assert NetworkPredictor.from_weights(path, num_points=512).num_points == 512
    fewer = WeightsCard(network="pointcnn", num_points=256, default_points=192)
    save_weights(path, create_network("pointcnn"), fewer)
    assert NetworkPredictor.from_weights(path).num_points == 192
    with pytest.raises(WeightsError, match=r"unknown packaged weights 'nonet'"):
        NetworkPredictor.from_weights("nonet")


@pytest.mark.parametrize("points", [0, -5, 127])
def test_fewer_points_than_a_network_needs_are_an_error(points: int) -> None:
    with pytest.raises(ConfigError, match="128"):
        NetworkPredictor.from_weights(num_points=points)


def clock_of(milliseconds: list[float]) -> Callable[[], float]:
    """A clock on which the n-th call of a predictor takes the n-th time."""
    stamps = iter([stamp for each in milliseconds for stamp in (0.0, each / 1000)])
    return lambda: next(stamps)


@pytest.mark.parametrize(
    ("budget_ms", "points"), [(100.0, 1024), (33.0, 1024), (29.9, 512), (20.0, 512), (19.0, 256), (0.1, 256)]
)
def test_a_budget_takes_the_most_points_it_has_time_for(
    tmp_path: Path, budget_ms: float, points: int
) -> None:
    path = tmp_path / "mine.safetensors"
    save_weights(path, create_network("pointnet"), WeightsCard(network="pointnet", num_points=1024))
    # Of six calls one warms up, and of five times the median counts.
    of_512, of_1024 = [500.0, 9.0, 20.0, 20.0, 20.0, 90.0], [500.0, 30.0, 30.0, 30.0, 7.0, 90.0]
    predictor = NetworkPredictor.from_weights(path, budget_ms=budget_ms, clock=clock_of(of_512 + of_1024))
    assert predictor.num_points == points


def test_a_budget_and_a_number_of_points_or_no_time_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    save_weights(path, create_network("pointnet"), WeightsCard(network="pointnet", num_points=200))
    assert NetworkPredictor.from_weights(path, budget_ms=1.0).num_points == 200
    for wrong in ({"num_points": 512, "budget_ms": 33.0}, {"budget_ms": 0.0}):
        with pytest.raises(ConfigError, match="give one of them"):
            NetworkPredictor.from_weights(path, **wrong)


def test_missing_data_are_no_answer_with_a_reason(small_dataset: PreparedDataset) -> None:
    card = WeightsCard(network="pointnet2", num_points=160)
    network = create_network("pointnet2")
    half = replay(unflatten(small_dataset.rows[2])).points.copy()
    half[:, :320] = np.nan
    answer = NetworkPredictor(TorchBackend(network, card))(half)
    assert answer.state is None
    assert answer.abstention is not None
    assert answer.abstention.code == "narrow_view"
    assert set(answer.probabilities.values()) == {0.0}
    assert answer.num_points == 160
    asked = NetworkPredictor(TorchBackend(network, card), gate=None)(half)
    assert asked.state is not None
    assert asked.reason == ""


def test_a_batch_answers_as_its_clouds_one_by_one(
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
        np.testing.assert_allclose(
            list(one.probabilities.values()), list(other.probabilities.values()), atol=1e-5
        )
    assert [answer.state is None for answer in together] == [False, False, True, False, False, False]
    assert predictor.batch([]) == []


def test_equal_clouds_go_through_the_network_at_once(
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
        together = [answer.probabilities for answer in threads.map(predictor, clouds * 4)]
    assert together == alone * 4


@pytest.mark.parametrize("name", [name for name in packaged_networks() if name.startswith("ogurob-")])
def test_packaged_weights_answer_new_doors(name: str, small_dataset: PreparedDataset) -> None:
    assert packaged_weights(name).stat().st_size < 8e6
    predictor = NetworkPredictor.from_weights(name)
    predictor.warm_up()
    right = sum(
        predictor(replay(unflatten(row)).points).state.label == row["state"]
        for row in small_dataset.rows[:18]
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


def test_heads_answer_in_metres_beside_the_state(headed: Path, small_dataset: PreparedDataset) -> None:
    predictor = NetworkPredictor.from_weights(headed)
    cloud = replay(unflatten(small_dataset.rows[5])).points
    answer = predictor(cloud)
    assert isinstance(predictor.backend.network, PointNetwork)
    prepared = prepare_cloud(cloud, CloudSpec(num_points=160, thin=True)).points[None]
    with torch.no_grad():
        said = head_outputs(predictor.backend.network, torch.from_numpy(normalize(prepared)))
    columns = head_columns(
        {name: said[name].numpy() for name in HEADS},
        prepared.mean(axis=1, dtype=np.float64).astype(np.float32),
    )
    assert answer.door_probability == pytest.approx(columns["p_door"][0])
    assert answer.opening_angle_deg == pytest.approx(columns["opening_angle_deg"][0])
    assert answer.hinge == ("left" if columns["p_hinge_left"][0] >= 0.5 else "right")
    assert answer.frame is not None
    assert answer.frame.x_m == pytest.approx(columns["door_x_m"][0], abs=1e-5)
    assert answer.frame.yaw_deg == pytest.approx(columns["door_yaw_deg"][0])
    assert answer.passable_width_m == pytest.approx(columns["passable_width_m"][0])
    # The mean point of a cloud is within two metres of its door.
    assert 0 < answer.frame.x_m < 6


def test_several_clouds_have_the_answers_of_each(headed: Path, small_dataset: PreparedDataset) -> None:
    predictor = NetworkPredictor.from_weights(headed)
    clouds = [small_dataset.cloud(index) for index in (0, 7)] + [small_dataset.cloud(3)[:140]]
    for alone, together in zip(map(predictor, clouds), predictor.batch(clouds), strict=True):
        assert alone.state == together.state
        assert alone.num_points == together.num_points
        assert together.frame == pytest.approx(alone.frame, abs=1e-4)


def test_no_door_is_no_state_with_the_reason(headed: Path, small_dataset: PreparedDataset) -> None:
    predictor = NetworkPredictor.from_weights(headed)
    door = predictor.backend.network.heads["door"]  # type: ignore[union-attr]
    cloud = small_dataset.cloud(2)
    for bias, sees in ((-9.0, False), (9.0, True)):
        torch.nn.init.constant_(door.linear.bias, bias)  # type: ignore[union-attr, arg-type]
        answer = predictor(cloud)
        assert (answer.state is not None) == sees == (answer.reason == "")
        assert sees or (answer.abstention is not None and answer.abstention.code == "no_door")


def test_an_unsure_answer_is_none_where_the_weights_say_so(small_dataset: PreparedDataset) -> None:
    network = create_network("pointnet2")
    cloud = small_dataset.cloud(2)
    answer = NetworkPredictor(TorchBackend(network, WeightsCard(network="pointnet2", num_points=160)))(cloud)
    assert answer.state is not None
    best = max(answer.probabilities.values())
    for least, answers_it in ((best - 0.01, True), (best + 0.01, False)):
        card = WeightsCard(network="pointnet2", num_points=160, abstain_below=least)
        asked = NetworkPredictor(TorchBackend(network, card))(cloud)
        assert (asked.state == answer.state) == answers_it
        if asked.abstention is not None:
            assert asked.abstention.code == "unsure"
            assert asked.abstention.values == {
                "state": answer.state.label,
                "probability": best,
                "min_probability": least,
            }
        assert asked.probabilities == answer.probabilities


def test_weights_that_saw_five_metres_look_no_farther(small_dataset: PreparedDataset) -> None:
    network = create_network("pointnet2")
    room = small_dataset.cloud(2)
    corridor = np.concatenate([room, room + np.array([8, 0, 0], np.float32)])
    near, far = (WeightsCard(network="pointnet2", num_points=160, max_depth_m=reach) for reach in (5.0, None))
    near_predictor, far_predictor = (NetworkPredictor(TorchBackend(network, card)) for card in (near, far))
    assert near_predictor(corridor) == replace(near_predictor(room), milliseconds=pytest.approx(0, abs=1e4))
    assert far_predictor(corridor).probabilities != far_predictor(room).probabilities


def test_a_run_on_simulated_clouds_says_how_far_its_camera_saw(small_dataset: PreparedDataset) -> None:
    assert small_dataset.max_depth_m == 5.0
