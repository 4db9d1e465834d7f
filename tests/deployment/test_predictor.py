# SPDX-License-Identifier: Apache-2.0
"""From a raw cloud to an answer: the path of training, whatever form the cloud has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from doorstate.clouds.preparation import normalize, prepare_cloud
from doorstate.dataset.store import PreparedDataset
from doorstate.deployment.predictor import Predictor, packaged_networks, packaged_weights
from doorstate.errors import CloudContentError, WeightsError
from doorstate.networks import create_network
from doorstate.simulation.generate import replay
from doorstate.simulation.manifest import unflatten
from doorstate.training.weights import WeightsCard, save_weights
from doorstate.types import STATES


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    card = WeightsCard(network="pointnet2", num_points=160)
    return Predictor(create_network("pointnet2"), card, 160, thin=False)


def test_it_answers_what_the_network_says_of_the_prepared_cloud(
    predictor: Predictor, small_dataset: PreparedDataset
) -> None:
    raw = replay(unflatten(small_dataset.rows[5])).points
    answer = predictor(raw)
    with torch.no_grad():
        logits = predictor.network(torch.from_numpy(normalize(small_dataset.cloud(5)))[None])
    expected = logits.softmax(1)[0].numpy()
    np.testing.assert_allclose(list(answer.probabilities.values()), expected, atol=1e-6)
    assert list(answer.probabilities) == list(STATES)
    assert answer.state == int(expected.argmax())
    assert answer.points == 160
    assert answer.milliseconds > 0


def test_organized_flat_and_shuffled_clouds_give_one_answer(
    predictor: Predictor, small_dataset: PreparedDataset
) -> None:
    raw = replay(unflatten(small_dataset.rows[1])).points
    flat = raw.reshape(-1, 3)
    assert predictor(raw).probabilities == predictor(flat).probabilities
    measured = flat[np.isfinite(flat).all(axis=1)]
    assert predictor(measured).probabilities == predictor(flat).probabilities


def test_thinning_takes_the_points_from_some_pixels(small_dataset: PreparedDataset) -> None:
    raw = replay(unflatten(small_dataset.rows[1])).points  # (480, 640, 3)
    card = WeightsCard(network="pointnet2", num_points=160)
    quick = Predictor(create_network("pointnet2"), card, 160)
    step = 10  # 48 x 64 = 3072 pixels are the fewest above 16 x 160
    every = Predictor(quick.network, card, 160, thin=False)
    assert quick(raw).probabilities == every(raw[::step, ::step]).probabilities
    assert quick(raw).probabilities != every(raw).probabilities
    assert quick(raw.reshape(-1, 3)).probabilities == every(raw).probabilities  # neighbours in no image


def test_fewer_points_than_trained_with_are_used_as_they_are(predictor: Predictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (140, 3)).astype(np.float32)
    assert predictor(cloud).points == 140
    assert len(prepare_cloud(cloud, 160).points) == 140


def test_a_cloud_without_data_is_an_error_and_not_an_answer(predictor: Predictor) -> None:
    with pytest.raises(CloudContentError):
        predictor(np.full((480, 640, 3), np.nan, dtype=np.float32))


def test_weights_load_by_path_and_by_name(tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    save_weights(path, create_network("pointcnn"), WeightsCard(network="pointcnn", num_points=256))
    assert Predictor.load(path).points == 256
    assert Predictor.load(path, points=512).points == 512
    with pytest.raises(WeightsError, match=r"no weights for 'nonet' in the package \(there are: .*pointnet2"):
        Predictor.load("nonet")


@pytest.mark.parametrize("name", packaged_networks())
def test_packaged_weights_answer_new_doors(name: str, small_dataset: PreparedDataset) -> None:
    assert packaged_weights(name).stat().st_size < 8e6
    predictor = Predictor.load(name)
    predictor.warm_up()
    right = sum(
        predictor(replay(unflatten(row)).points).state.label == row["state"]
        for row in small_dataset.rows[:18]
    )
    # Another seed than they were trained on; a weights file that was mixed up would get a third.
    assert right >= 16
