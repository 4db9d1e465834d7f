# SPDX-License-Identifier: Apache-2.0
"""Batches: every cloud once, normalised, the same for the same seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.distance import pdist

from doorstate.clouds.augmentation import Augmentation
from doorstate.clouds.normalization import normalize
from doorstate.dataset.loader import Batch, CloudLoader
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.errors import ConfigError, DatasetError

NOTHING = Augmentation()


@pytest.fixture
def dataset(prepared: Path) -> PreparedDataset:
    return open_dataset(prepared)


@pytest.fixture
def loader(dataset: PreparedDataset) -> CloudLoader:
    return CloudLoader(dataset, [row["sample_id"] for row in dataset.rows], 40)


def indices_of(loader: CloudLoader, batches: list[Batch]) -> list[int]:
    """Return the loader's sample numbers of all clouds in batches, by points and label."""
    (everything,) = loader.in_order(len(loader))
    places = []
    for batch in batches:
        for cloud, label in zip(batch.points, batch.labels, strict=True):
            (place,) = (everything.points == cloud).all(dim=(1, 2)).nonzero().flatten().tolist()
            assert label == everything.labels[place]
            places.append(place)
    return places


def test_clouds_are_normalised_and_in_order(dataset: PreparedDataset) -> None:
    samples = ["s7", "s0", "s9", "s4", "s5"]
    batches = list(CloudLoader(dataset, samples, 32).in_order(2))
    assert [tuple(batch.points.shape) for batch in batches] == [(2, 32, 3), (2, 32, 3), (1, 32, 3)]
    points, labels = torch.cat([b.points for b in batches]), torch.cat([b.labels for b in batches])
    assert (points.dtype, labels.dtype) == (torch.float32, torch.int64)
    for cloud, label, sample in zip(points, labels, samples, strict=True):
        index = dataset.index_of(sample)
        # The first points are normalised by their own centroid.
        np.testing.assert_array_equal(cloud, normalize(dataset.cloud(index)[:32]))
        assert label == dataset.labels[index]
    assert points.mean(dim=1).abs().max() < 1e-6


@pytest.mark.parametrize(
    ("batch_size", "batches", "clouds"), [(3, 3, 9), (11, 1, 11), (1, 11, 11), (64, 1, 11)]
)
def test_an_epoch_has_every_cloud_once_without_an_incomplete_batch(
    loader: CloudLoader, batch_size: int, batches: int, clouds: int
) -> None:
    epoch = list(loader.shuffled(batch_size, NOTHING, (0, 0, 0)))
    assert len(epoch) == batches
    assert {len(batch.labels) for batch in epoch} == {min(batch_size, 11)}
    places = indices_of(loader, epoch)
    assert len(places) == len(set(places)) == clouds


def test_a_limited_epoch_draws_clouds_at_random(loader: CloudLoader) -> None:
    epochs = [list(loader.shuffled(2, NOTHING, (0, 0, epoch), limit=5)) for epoch in range(20)]
    assert {len(epoch) for epoch in epochs} == {2}
    assert {place for epoch in epochs for place in indices_of(loader, epoch)} == set(range(11))
    later = list(loader.shuffled(2, NOTHING, (0, 0, 7), skip=1, limit=5))
    assert [torch.equal(a.points, b.points) for a, b in zip(epochs[7][1:], later, strict=True)] == [True]


def test_all_clouds_occur_over_several_epochs(loader: CloudLoader) -> None:
    epochs = [
        set(indices_of(loader, list(loader.shuffled(4, NOTHING, (0, 0, epoch))))) for epoch in range(12)
    ]
    assert set.union(*epochs) == set(range(11))
    assert len({frozenset(places) for places in epochs}) > 1


def test_an_epoch_depends_on_its_seed(loader: CloudLoader) -> None:
    everything = Augmentation(yaw_deg=30, mirror=0.5, scale=(0.9, 1.1), shift=0.1, jitter=0.01)
    first, same, different = (list(loader.shuffled(4, everything, (1, 2, epoch))) for epoch in (3, 3, 4))
    assert all(
        torch.equal(a.points, b.points) and torch.equal(a.labels, b.labels)
        for a, b in zip(first, same, strict=True)
    )
    assert not any(torch.equal(a.points, b.points) for a, b in zip(first, different, strict=True))


def test_augmentation_differs_by_cloud_and_leaves_stored_clouds_unchanged(loader: CloudLoader) -> None:
    (before,) = loader.in_order(11)
    plain = next(loader.shuffled(11, NOTHING, (5,)))
    turned = next(loader.shuffled(11, Augmentation(yaw_deg=180), (5,)))
    assert torch.equal(plain.labels, turned.labels)
    assert torch.equal(plain.points[..., 2], turned.points[..., 2])
    yaw_rad = []
    for cloud, augmented in zip(plain.points.numpy(), turned.points.numpy(), strict=True):
        np.testing.assert_allclose(pdist(augmented), pdist(cloud), rtol=1e-4, atol=1e-6)
        yaw_rad.append(np.angle(complex(*augmented[0, :2]) / complex(*cloud[0, :2])))
    assert len(np.unique(np.round(yaw_rad, 3))) == 11
    (after,) = loader.in_order(11)
    assert torch.equal(before.points, after.points)


def test_too_many_points_and_unknown_samples_are_refused(dataset: PreparedDataset) -> None:
    with pytest.raises(ConfigError, match="40") as refused:
        CloudLoader(dataset, ["s0"], 41)
    assert (refused.value.path, refused.value.field) == (dataset.folder, "num_points")
    with pytest.raises(DatasetError, match="s99") as unknown:
        CloudLoader(dataset, ["s0", "s99"], 40)
    assert unknown.value.field == "sample_id"


def test_neighbours_are_searched_once_per_cloud(dataset: PreparedDataset) -> None:
    searched: list[int] = []

    def nearest(points: torch.Tensor) -> tuple[torch.Tensor, ...]:
        searched.append(len(points))
        return (torch.cdist(points, points).argsort(dim=2, stable=True)[:, :, :4],)

    samples = [row["sample_id"] for row in dataset.rows]
    loader = CloudLoader(dataset, samples, 40, nearest)
    turned = Augmentation(yaw_deg=30, mirror=0.5, scale=(0.8, 1.2), shift=0.1)
    for epoch in range(3):
        for batch in loader.shuffled(4, turned, (0, 0, epoch)):
            assert batch.neighbourhoods is not None
            (neighbours,) = batch.neighbourhoods
            assert (neighbours.dtype, neighbours.shape) == (torch.int64, (4, 40, 4))
            distances = torch.cdist(batch.points.double(), batch.points.double())
            expected = distances.sort(dim=2).values[:, :, :4]
            torch.testing.assert_close(distances.gather(2, neighbours), expected, rtol=0, atol=1e-5)
    list(loader.in_order(5))
    assert sum(searched) == len(samples)


def test_without_a_search_there_are_no_neighbours(loader: CloudLoader) -> None:
    assert {batch.neighbourhoods for batch in loader.in_order(5)} == {None}


def test_extra_data_sets_are_appended_as_a_whole(
    scene_dataset: PreparedDataset, more_dataset: PreparedDataset
) -> None:
    heads = ("door", "angle", "parts")
    selected = scene_dataset.sample_ids[5:9]
    loader = CloudLoader(
        scene_dataset, selected, 128, heads=heads, extra=[(more_dataset, more_dataset.sample_ids)]
    )
    assert loader.sample_ids == [*selected, *more_dataset.sample_ids]
    (joined,) = loader.in_order(len(loader))
    separate = [
        next(CloudLoader(dataset, samples, 128, heads=heads).in_order(len(samples)))
        for dataset, samples in ((scene_dataset, selected), (more_dataset, more_dataset.sample_ids))
    ]
    assert torch.equal(joined.points, torch.cat([batch.points for batch in separate]))
    assert torch.equal(joined.labels, torch.cat([batch.labels for batch in separate]))
    for name, values in joined.targets.items():
        expected = torch.cat([batch.targets[name] for batch in separate])
        torch.testing.assert_close(values, expected, rtol=0, atol=0, equal_nan=True)
    assert len(loader.placement.centres) == len(loader)
    with pytest.raises(ConfigError, match="160"):
        CloudLoader(more_dataset, [], 161)


def test_parts_of_a_batch_are_what_processes_share(dataset: PreparedDataset) -> None:
    loader = CloudLoader(dataset, [row["sample_id"] for row in dataset.rows], 40)
    augmentation = Augmentation(yaw_deg=20, mirror=0.5, jitter=0.01)
    whole = list(loader.shuffled(4, augmentation, (1, 2)))
    parts = [list(loader.shuffled(4, augmentation, (1, 2), part=(number, 2))) for number in range(2)]
    for batch, *shares in zip(whole, *parts, strict=True):
        assert torch.equal(torch.cat([share.points for share in shares]), batch.points)
        assert torch.equal(torch.cat([share.labels for share in shares]), batch.labels)


def test_batches_and_searches_are_on_the_device(dataset: PreparedDataset) -> None:
    """The meta device stands for CUDA."""
    searched: list[torch.device] = []

    def search(points: torch.Tensor) -> tuple[torch.Tensor, ...]:
        searched.append(points.device)
        return (torch.zeros(*points.shape[:2], 3, dtype=torch.int64, device=points.device),)

    samples = [row["sample_id"] for row in dataset.rows]
    loader = CloudLoader(dataset, samples, 40, search, device=torch.device("meta"))
    batch = next(loader.in_order(2))
    assert batch.neighbourhoods is not None
    tensors = [batch.points, batch.labels, *batch.neighbourhoods]
    assert {tensor.device.type for tensor in tensors} == {"meta"} == {device.type for device in searched}
    assert batch.neighbourhoods[0].dtype == torch.int64


def test_a_share_of_an_epoch_is_from_the_own_data_set(dataset: PreparedDataset) -> None:
    own = [dataset.sample_ids[number] for number, label in enumerate(dataset.labels) if label < 2][:5]
    loader = CloudLoader(dataset, own, 32, extra=[(dataset, dataset.sample_ids)])
    batches = list(loader.shuffled(8, NOTHING, (1,), limit=16, own_share=0.5))
    repeated = list(loader.shuffled(8, NOTHING, (1,), limit=16, own_share=0.5))
    assert all(
        torch.equal(batch.points, again.points) for batch, again in zip(batches, repeated, strict=True)
    )
    assert [len(batch.labels) for batch in batches] == [8, 8]
    drawn = loader._draw(np.random.default_rng(0), 16, None, 0.5)
    assert (drawn < len(own)).sum() == 8
    labels = dataset.labels[[dataset.index_of(sample) for sample in own]][drawn[drawn < len(own)]]
    assert np.bincount(labels).tolist() == [4, 4]
