# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours in the feature space of DGCNN: `knn` beside a full matrix product and scikit-learn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from statistics import median

import torch
from sklearn.neighbors import NearestNeighbors
from threadpoolctl import threadpool_limits
from torch import Tensor

from benchmarks.clouds import Clouds
from benchmarks.store import Result
from benchmarks.timing import format_ms, median_seconds
from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.networks.dgcnn import DGCNN
from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.knn import knn
from doorstate.training.run import torch_threads

K = 20
_SEED = 0
_NOTE = (
    f"Milliseconds for the {K} nearest neighbours of every point of one cloud, median of the rounds, in which the "
    "methods alternate; `doorstate` gets the points in an order in which neighbours are close, as in the network. "
    "The features are those of an untrained DGCNN on a simulated cloud: 64 channels after its first edge "
    "convolution, 128 after its third."
)


def full_product(features: Tensor) -> Tensor:
    """Return the neighbours by one matrix product of all pairs and a selection, as in the authors' code."""
    squares = features.square().sum(-1)
    distances = squares.unsqueeze(2) - 2 * features @ features.mT + squares.unsqueeze(1)
    return distances.topk(K, largest=False).indices


def brute_force(features: Tensor) -> Tensor:
    """Return the neighbours by scikit-learn's brute force."""
    rows = features[0].cpu().numpy()
    search = NearestNeighbors(n_neighbors=K, algorithm="brute").fit(rows)
    return torch.from_numpy(search.kneighbors(rows, return_distance=False)).unsqueeze(0)


METHODS: dict[str, Callable[[Tensor], Tensor]] = {
    "doorstate": lambda features: knn(features, features, K, in_order=True),
    "full product": full_product,
    "scikit-learn": brute_force,
}


def measure_neighbours(
    clouds: Clouds,
    numbers_of_points: Sequence[int],
    repeats: int,
    threads: int,
    progress: Progress,
    device: str = "cpu",
) -> list[Result]:
    """Return the times of every method."""
    rows = []
    torch.manual_seed(_SEED)
    network = DGCNN(k=K).eval().to(device)
    with torch.inference_mode(), torch_threads(threads), threadpool_limits(threads):
        for number, num_points in enumerate(numbers_of_points):
            progress(number, len(numbers_of_points))
            points = torch.from_numpy(clouds.first_points(num_points).points).to(device)
            order, nearest = network.neighbourhoods(points)
            first, _, third, _ = network.edge_features(gather_rows(points, order), nearest)
            for features in (first.clone(), third.clone()):
                rounds = [_measure_round(features) for _ in range(repeats)]
                medians = {name: median(values[name] for values in rounds) for name in METHODS}
                rows.append({"points": num_points, "channels": features.shape[-1], "ms": medians})
    progress(len(numbers_of_points), len(numbers_of_points))
    return rows


def neighbours_table(rows: Sequence[Result]) -> Table:
    """Return one row per number of points and channels."""
    cells = [
        (str(row["points"]), str(row["channels"]), *(format_ms(row["ms"][name]) for name in METHODS))
        for row in rows
    ]
    title = f"The {K} nearest neighbours in feature space"
    return Table(title, ("points", "channels", *METHODS), tuple(cells), _NOTE, text_columns=0)


def _measure_round(features: Tensor) -> dict[str, float]:
    return {
        name: median_seconds(partial(method, features), device=str(features.device)) * 1000
        for name, method in METHODS.items()
    }
