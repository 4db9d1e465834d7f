# SPDX-License-Identifier: Apache-2.0
"""Latency of every rule on raw clouds in memory, beside the multi-view CNN and a point network."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.clouds import raw_clouds
from benchmarks.store import Result
from benchmarks.timing import format_ms, summarize_ms
from doorstate._jobs import Progress
from doorstate._memory import keep_freed_memory
from doorstate.evaluation.table import Table
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.rules import list_rules
from doorstate.training.run import torch_threads

NETWORKS = ("mvcnn", "pointnet2")


def measure_rules(count: int, points: int, threads: int, repeats: int, progress: Progress) -> list[Result]:
    """Return the times of every method, gate included, on clouds of all poses and states."""
    keep_freed_memory()  # as `doorstate predict` does
    clouds = raw_clouds(count)
    methods: dict[str, Predictor] = {name: RulePredictor.from_name(name) for name in list_rules()}
    for name in NETWORKS:
        card = WeightsCard(network=name, num_points=points)
        methods[name] = NetworkPredictor(TorchBackend(create_network(name), card))
    rows: list[Result] = []
    with torch_threads(threads):
        for number, (name, predictor) in enumerate(methods.items()):
            progress(number, len(methods))
            predictor(clouds[0])
            durations_ms = [predictor(cloud).milliseconds for _ in range(repeats) for cloud in clouds]
            used_points = points if name in NETWORKS else None
            rows.append({"method": name, "points": used_points, **summarize_ms(durations_ms)})
    progress(len(methods), len(methods))
    return rows


def rules_table(rows: Sequence[Result]) -> Table:
    """Return one row per method."""
    cells = tuple(
        (
            row["method"],
            "all" if row["points"] is None else str(row["points"]),
            *(format_ms(row[name]) for name in ("median_ms", "p90_ms", "max_ms")),
        )
        for row in rows
    )
    return Table(
        "Rules: from a raw cloud to a state",
        ("method", "points", "median, ms", "90th percentile", "longest"),
        cells,
        "One call on a simulated 640 × 480 cloud in memory, with the gate; the networks have untrained weights, which "
        "does not change the time.",
    )
