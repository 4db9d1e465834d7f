# SPDX-License-Identifier: Apache-2.0
"""From a raw organized cloud in memory to a state: where each millisecond goes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.clouds import raw_cloud
from benchmarks.store import Group
from benchmarks.tables import milliseconds
from doorstate._jobs import Progress
from doorstate._memory import keep_freed_memory
from doorstate.clouds import preparation
from doorstate.evaluation.table import Table
from doorstate.inference import network_predictor
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.export import export_onnx
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.training.run import torch_threads
from doorstate.types import Points

STAGES = ("clean", "sample", "network", "total")
_NOTE = (
    "Milliseconds of one `Predictor` call, median (90th percentile), on a simulated 640 × 480 cloud in memory; the "
    "weights are untrained, which changes no time. *Clean* drops unmeasured points and checks the rest, *sample* puts "
    "them in farthest-point order, *network* centres them and computes the probabilities; it includes the "
    "gate on missing data. *onnxruntime* is the same network as `doorstate export` writes it."
)


def measure(
    networks: Sequence[str],
    numbers_of_points: Sequence[int],
    threads: Sequence[int],
    repeats: int,
    progress: Progress,
) -> list[Group]:
    """Times of every stage in every repeat, one network after the other, as a robot runs one."""
    keep_freed_memory()  # as `doorstate predict` does
    raw, rows = raw_cloud(), []
    settings = [(count, points) for count in threads for points in numbers_of_points]
    with tempfile.TemporaryDirectory() as folder:
        for done, (count, points) in enumerate(settings):
            progress(done, len(settings))
            for name in networks:
                for runtime, predict in _predictors(name, points, count, raw, Path(folder)).items():
                    with torch_threads(count):
                        predict(raw)
                        runs = [_stages(predict, raw) for _ in range(repeats)]
                    stages = {stage: [run[stage] for run in runs] for stage in STAGES}
                    setting = {"network": name, "runtime": runtime, "points": points, "threads": count}
                    rows.append(setting | {"stages": _summary(stages)})
    progress(len(settings), len(settings))
    return rows


def latency_table(rows: Sequence[Group]) -> Table:
    """One row per network, runtime, number of points and threads."""
    cells = [
        (
            row["network"],
            row["runtime"],
            str(row["points"]),
            str(row["threads"]),
            *(
                f"{milliseconds(s['median_ms'])} ({milliseconds(s['p90_ms'])})"
                for s in row["stages"].values()
            ),
        )
        for row in rows
    ]
    return Table(
        "From a raw cloud to a state",
        ("network", "runtime", "points", "threads", *STAGES),
        tuple(cells),
        _NOTE,
        2,
    )


def _predictors(
    name: str, points: int, threads: int, raw: Points, folder: Path
) -> dict[str, NetworkPredictor]:
    network, card = create_network(name), WeightsCard(network=name, num_points=points)
    predictors = {"torch": NetworkPredictor(TorchBackend(network, card))}
    for runtime, int8 in (("onnxruntime", False), ("onnxruntime int8", True)):
        path = folder / f"{name}-{points}-{runtime}.onnx"
        if not path.is_file():
            cloud = preparation.prepare_cloud(
                raw, preparation.CloudSpec(num_points=points, thin=True)
            ).points[None]
            labels = np.zeros(1, dtype=np.int64)
            export_onnx(path, network, card, LabelledClouds(cloud, labels), int8=int8)
        predictors[runtime] = NetworkPredictor(OnnxBackend(path, threads))
    return predictors


def _summary(stages: dict[str, list[float]]) -> dict[str, dict[str, Any]]:
    return {
        stage: {
            "median_ms": float(np.median(values)),
            "p90_ms": float(np.percentile(values, 90)),
            "all_ms": values,
        }
        for stage, values in stages.items()
    }


def _stages(predict: NetworkPredictor, raw: Points) -> dict[str, float]:
    """Milliseconds of each stage of one call, taken inside it: stages that are timed one by one are other stages."""
    with (
        _timed(preparation, "farthest_point_indices") as sampling,
        _timed(network_predictor, "prepare_cloud") as preparing,
    ):
        total = predict(raw).milliseconds
    sample, prepare = sum(sampling), sum(preparing)
    return {"clean": prepare - sample, "sample": sample, "network": total - prepare, "total": total}


@contextmanager
def _timed(module: ModuleType, name: str) -> Iterator[list[float]]:
    """Note the milliseconds of every call that a module makes of one function."""
    function, spent = getattr(module, name), []

    def timed(*arguments: Any, **options: Any) -> Any:
        started = time.perf_counter()
        answer = function(*arguments, **options)
        spent.append((time.perf_counter() - started) * 1000)
        return answer

    with patch.object(module, name, timed):
        yield spent
