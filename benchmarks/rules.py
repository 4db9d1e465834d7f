# SPDX-License-Identifier: Apache-2.0
"""Time of each rule on raw clouds in memory, beside the multi-view CNN and a point network."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.clouds import raw_clouds
from benchmarks.store import Group
from benchmarks.tables import milliseconds
from doorstate._jobs import Progress
from doorstate._memory import keep_freed_memory
from doorstate.evaluation.table import Table
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.prediction import Prediction
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.rules import list_rules
from doorstate.training.run import torch_threads
from doorstate.types import Points

BESIDE = ("mvcnn", "pointnet2")


def measure(count: int, points: int, threads: int, repeats: int, progress: Progress) -> list[Group]:
    """Milliseconds of every method on the same clouds, all poses and states, gate included."""
    keep_freed_memory()  # as `doorstate predict` does
    clouds = raw_clouds(count)
    methods: dict[str, Callable[[Points], Prediction]] = {
        name: RulePredictor.from_name(name) for name in list_rules()
    }
    for name in BESIDE:
        methods[name] = NetworkPredictor(
            TorchBackend(create_network(name), WeightsCard(network=name, num_points=points))
        )
    rows = []
    with torch_threads(threads):
        for done, (name, predict) in enumerate(methods.items()):
            progress(done, len(methods))
            predict(clouds[0])
            times = [predict(cloud).milliseconds for _ in range(repeats) for cloud in clouds]
            rows.append(
                {
                    "method": name,
                    "points": points if name in BESIDE else None,
                    "threads": threads,
                    "median_ms": float(np.median(times)),
                    "p90_ms": float(np.percentile(times, 90)),
                    "most_ms": max(times),
                }
            )
    progress(len(methods), len(methods))
    return rows


def rules_table(rows: Sequence[Group]) -> Table:
    """One row per method."""
    lines = tuple(
        (
            row["method"],
            "all" if row["points"] is None else str(row["points"]),
            *(milliseconds(row[name]) for name in ("median_ms", "p90_ms", "most_ms")),
        )
        for row in rows
    )
    return Table(
        "Rules: from a raw cloud to a state",
        ("method", "points", "median, ms", "90th percentile", "longest"),
        lines,
        "One call on a simulated 640 × 480 cloud in memory, with the gate on missing data; networks have untrained "
        "weights, which changes no time.",
    )
