# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours in feature space, DGCNN's floor: ours against a full product and scikit-learn's brute force."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from statistics import median

import torch
from sklearn.neighbors import NearestNeighbors
from threadpoolctl import threadpool_limits
from torch import Tensor

from benchmarks.clouds import Clouds
from benchmarks.store import Group
from benchmarks.tables import milliseconds
from benchmarks.timing import step_s
from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.networks.dgcnn import DGCNN
from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.knn import knn
from doorstate.training.run import torch_threads

K = 20
_SEED = 0
_NOTE = (
    f"Milliseconds for the {K} nearest neighbours of every point of one cloud, median of the rounds, in "
    "which the methods take turns; ours is told, as in the network, that near points follow each other. "
    "The features are those of an untrained DGCNN on a simulated cloud: 64 channels after its first edge "
    "convolution, 128 after its third."
)


def full_product(features: Tensor) -> Tensor:
    """Every squared distance by one matrix product, then a selection, as the authors' code does."""
    squares = features.square().sum(-1)
    distances = squares.unsqueeze(2) - 2 * features @ features.mT + squares.unsqueeze(1)
    return distances.topk(K, largest=False).indices


def brute_force(features: Tensor) -> Tensor:
    """scikit-learn's."""
    rows = features[0].numpy()
    found = (
        NearestNeighbors(n_neighbors=K, algorithm="brute").fit(rows).kneighbors(rows, return_distance=False)
    )
    return torch.from_numpy(found).unsqueeze(0)


METHODS: dict[str, Callable[[Tensor], Tensor]] = {
    "doorstate": lambda features: knn(features, features, K, in_order=True),
    "full product": full_product,
    "scikit-learn": brute_force,
}


def measure(
    clouds: Clouds, numbers_of_points: Sequence[int], repeats: int, threads: int, progress: Progress
) -> list[Group]:
    """Milliseconds of every method."""
    rows = []
    torch.manual_seed(_SEED)
    network = DGCNN(k=K).eval()
    with torch.inference_mode(), torch_threads(threads), threadpool_limits(threads):
        for done, num_points in enumerate(numbers_of_points):
            progress(done, len(numbers_of_points))
            points = torch.from_numpy(clouds.cut(num_points).points)
            order, nearest = network.neighbourhoods(points)
            first, _, third, _ = network.edge_features(gather_rows(points, order), nearest)
            for features in (first.clone(), third.clone()):
                rounds = [_one_round(features) for _ in range(repeats)]
                medians = {name: median(one[name] for one in rounds) for name in METHODS}
                rows.append(
                    {"points": num_points, "channels": features.shape[-1], "ms": medians, "rounds": rounds}
                )
    progress(len(numbers_of_points), len(numbers_of_points))
    return rows


def _one_round(features: Tensor) -> dict[str, float]:
    return {name: step_s(partial(method, features)) * 1000 for name, method in METHODS.items()}


def knn_table(rows: Sequence[Group]) -> Table:
    """One row per number of points and channels."""
    cells = [
        (str(row["points"]), str(row["channels"]), *(milliseconds(row["ms"][name]) for name in METHODS))
        for row in rows
    ]
    title = f"The {K} nearest neighbours in feature space"
    return Table(title, ("points", "channels", *METHODS), tuple(cells), _NOTE, text_columns=0)
