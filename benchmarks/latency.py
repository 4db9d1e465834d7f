# SPDX-License-Identifier: Apache-2.0
"""Latency from a raw organized cloud in memory to a state, by stage."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.clouds import raw_cloud
from benchmarks.store import Result
from benchmarks.timing import format_ms, summarize_ms, timed_calls
from doorstate._jobs import Progress
from doorstate._memory import keep_freed_memory
from doorstate.clouds import preparation, sampling
from doorstate.clouds.samplers import NUMPY, Sampler, choose_sampler
from doorstate.evaluation.table import Table
from doorstate.inference import network_predictor, predictor
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
    "weights are untrained, which does not change the time. *Sampling* by numpy is that of `pip install doorstate` "
    "alone, which has no torch and no compiled sampling; × is its median ratio to the compiled one, in turns. *Clean* "
    "drops unmeasured points and outliers and checks the others, *sample* puts them in farthest-point order, *network* "
    "includes the gate and the normalisation. *onnxruntime* is the same network as `doorstate export` writes it."
)


def measure_latency(
    networks: Sequence[str],
    numbers_of_points: Sequence[int],
    numbers_of_threads: Sequence[int],
    repeats: int,
    progress: Progress,
) -> list[Result]:
    """Return the times of every stage, one network after another, as on a robot."""
    keep_freed_memory()  # as `doorstate predict` does
    cloud, rows = raw_cloud(), []
    settings = [(threads, points) for threads in numbers_of_threads for points in numbers_of_points]
    with tempfile.TemporaryDirectory() as folder:
        for number, (threads, points) in enumerate(settings):
            progress(number, len(settings))
            for network in networks:
                predictors = _predictors(network, points, threads, cloud, Path(folder))
                for runtime, measured in predictors.items():
                    with torch_threads(threads):
                        calls = _measure_calls(measured, cloud, _samplers(runtime), repeats)
                    setting = {"network": network, "runtime": runtime, "points": points, "threads": threads}
                    rows += [setting | row for row in _rows_of_calls(calls)]
    progress(len(settings), len(settings))
    return rows


def latency_table(rows: Sequence[Result]) -> Table:
    """Return one row per network, runtime, sampling, number of points and of threads."""
    cells = [
        (
            row["network"],
            row["runtime"],
            row["sampling"],
            str(row["points"]),
            str(row["threads"]),
            *(_stage_cell(row["stages"][stage]) for stage in STAGES),
            f"{row['ratio']:.2f}",
        )
        for row in rows
    ]
    columns = ("network", "runtime", "sampling", "points", "threads", *STAGES, "×")
    return Table("From a raw cloud to a state", columns, tuple(cells), _NOTE, text_columns=3)


def _stage_cell(stage: Mapping[str, float]) -> str:
    return f"{format_ms(stage['median_ms'])} ({format_ms(stage['p90_ms'])})"


def _predictors(
    network_name: str, points: int, threads: int, cloud: Points, folder: Path
) -> dict[str, NetworkPredictor]:
    network, card = create_network(network_name), WeightsCard(network=network_name, num_points=points)
    predictors = {"torch": NetworkPredictor(TorchBackend(network, card))}
    for runtime, int8 in (("onnxruntime", False), ("onnxruntime int8", True)):
        path = folder / f"{network_name}-{points}-{runtime}.onnx"
        if not path.is_file():
            spec = preparation.CloudSpec(num_points=points, thin=True)
            prepared = preparation.prepare_cloud(cloud, spec).points[None]
            labels = np.zeros(1, dtype=np.int64)
            export_onnx(path, network, card, LabelledClouds(prepared, labels), int8=int8)
        predictors[runtime] = NetworkPredictor(OnnxBackend(path, threads))
    return predictors


def _samplers(runtime: str) -> list[Sampler]:
    """Return what an installation with this runtime may sample with, the quickest first."""
    compiled = choose_sampler(import_torch=True)
    return [compiled] if runtime == "torch" or compiled == NUMPY else [compiled, NUMPY]


def _measure_calls(
    measured: NetworkPredictor, cloud: Points, samplers: Sequence[Sampler], repeats: int
) -> dict[str, list[dict[str, float]]]:
    """Return the stages of every call, by library; the libraries take turns."""
    calls: dict[str, list[dict[str, float]]] = {sampler.library: [] for sampler in samplers}
    for turn in range(repeats + 1):
        for sampler in samplers:
            with patch.object(sampling, "choose_sampler", return_value=sampler):
                stages = _stages_of_call(measured, cloud)
            if turn > 0:
                calls[sampler.library].append(stages)
    return calls


def _rows_of_calls(calls: Mapping[str, list[dict[str, float]]]) -> list[Result]:
    first = next(iter(calls.values()))
    return [
        {
            "sampling": library,
            "stages": {stage: summarize_ms([call[stage] for call in own]) for stage in STAGES},
            "ratio": float(
                np.median([one["total"] / other["total"] for one, other in zip(own, first, strict=True)])
            ),
        }
        for library, own in calls.items()
    ]


def _stages_of_call(measured: NetworkPredictor, cloud: Points) -> dict[str, float]:
    """Return the milliseconds of each stage within one call, because a stage alone takes another time."""
    with (
        timed_calls(predictor, "remove_outliers") as outliers_ms,
        timed_calls(preparation, "farthest_point_indices") as sample_ms,
        timed_calls(network_predictor, "prepare_cloud") as prepare_ms,
    ):
        total = measured(cloud).milliseconds
    sample, prepare = sum(sample_ms), sum(outliers_ms) + sum(prepare_ms)
    return {"clean": prepare - sample, "sample": sample, "network": total - prepare, "total": total}
