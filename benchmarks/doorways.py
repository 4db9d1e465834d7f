# SPDX-License-Identifier: Apache-2.0
"""Latency from a raw, tilted cloud in memory to every door in it, by stage and number of candidates."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.clouds import sensor_cloud
from benchmarks.store import Result
from benchmarks.timing import format_ms, summarize_ms, timed_calls
from doorstate._jobs import Progress
from doorstate._memory import keep_freed_memory
from doorstate.clouds.leveling import level_cloud
from doorstate.clouds.outliers import remove_outliers
from doorstate.doorways import upright
from doorstate.doorways.crop import CROP_POINTS
from doorstate.doorways.finder import FinderSettings, find_doorways, thinned
from doorstate.errors import ConfigError
from doorstate.evaluation.table import Table
from doorstate.inference import doorway_predictor, predictor
from doorstate.inference.backends import Backend, Outputs, load_backend
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.door import Door
from doorstate.inference.doorway_predictor import DoorwayPredictor
from doorstate.inference.export import export_onnx
from doorstate.inference.gate import DEFAULT_GATE, Gate
from doorstate.inference.reference_clouds import reference_clouds
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import add_heads
from doorstate.training.run import torch_threads
from doorstate.types import STATES, DoorState, Points

PRESETS = ("varied", "corridor")
SENSOR = "xtion"
HEADS = ("door", "angle", "hinge", "frame", "widths")
_STAGES: dict[str, tuple[object, str]] = {
    "outliers": (predictor, "remove_outliers"),
    "view": (Gate, "check_view"),
    "level": (upright, "level_cloud"),
    "find": (upright, "find_doorways"),
    "crops": (doorway_predictor, "crop_cloud"),
    "network": (doorway_predictor, "run_by_size"),
    "decide": (doorway_predictor, "decide_doors"),
    "check": (Gate, "check_doorways"),
}
STAGES = (*_STAGES, "other", "total", "processor")
_EACH = ("crops", "check")  # called for each candidate or door
_NOTE = (
    "Milliseconds of one `Predictor` call on a simulated 640 × 480 cloud of the Xtion in memory, median; *total* with "
    "its 90th percentile, *crops* and *check* with the time of one. *View* is the gate for the whole view, *decide* "
    "places and merges the answers, *check* looks at each door, *processor* is the time of all threads together. The "
    "finder is asked for its best *candidates*, however improbable. {answers} The last columns are the check of a door "
    "at the best candidate, by the state it is said to have. *onnxruntime* is the same network as `doorstate export` "
    "writes it."
)
_ANSWERS = {
    True: "The answers are those of the weights.",
    False: "The weights are untrained, which does not change the time; every candidate is taken for a door, of the "
    "states in turn, so that each is checked.",
}


class _SureDoors:
    """Network whose answers are replaced by those of sure doors, of the states in turn."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self.card = backend.card
        self.num_points = backend.num_points
        self.network = backend.network

    def __call__(self, points: Points) -> Outputs:
        outputs = self._backend(points)
        probabilities = np.eye(len(STATES), dtype=np.float32)[np.arange(len(points)) % len(STATES)]
        heads = {name: np.zeros_like(column) for name, column in outputs.heads.items()}
        heads["p_door"] = np.ones_like(heads["p_door"])
        return Outputs(probabilities, heads)


def measure_doorways(
    source: Path | str,
    numbers_of_candidates: Sequence[int],
    numbers_of_threads: Sequence[int],
    repeats: int,
    progress: Progress,
) -> list[Result]:
    """Return the times of every stage.

    Args:
        source: file with weights for doorways, or the name of a network, which is not trained then.
        numbers_of_candidates: candidates that the finder is asked for.
        numbers_of_threads: threads of the network.
        repeats: calls that are measured.
        progress: called with settings measured and settings in all.
    """
    keep_freed_memory()  # as `doorstate predict` does
    clouds = {preset: sensor_cloud(preset, SENSOR) for preset in PRESETS}
    rows: list[Result] = []
    settings = [(threads, preset) for threads in numbers_of_threads for preset in PRESETS]
    with tempfile.TemporaryDirectory() as folder:
        for number, (threads, preset) in enumerate(settings):
            progress(number, len(settings))
            checks_ms = _measure_checks(clouds[preset], repeats)
            for runtime, measured in _predictors(source, threads, Path(folder)).items():
                for candidates in numbers_of_candidates:
                    with torch_threads(threads), _best_candidates(candidates):
                        calls = [_stages_of_call(measured, clouds[preset]) for _ in range(repeats + 1)][1:]
                    setting = {"cloud": preset, "runtime": runtime, "threads": threads}
                    rows.append(setting | _row(calls) | {"check_ms": checks_ms})
    progress(len(settings), len(settings))
    return rows


def doorways_table(rows: Sequence[Result], has_weights: bool) -> Table:
    """Return one row per cloud, runtime, number of threads and of candidates."""
    cells = tuple(
        (
            row["cloud"],
            row["runtime"],
            *(str(row[name]) for name in ("threads", "candidates", "doors")),
            *(_stage_cell(row, stage) for stage in STAGES),
            *(format_ms(row["check_ms"][state]) for state in STATES),
        )
        for row in rows
    )
    columns = ("cloud", "runtime", "threads", "candidates", "doors", *STAGES, *STATES)
    note = _NOTE.format(answers=_ANSWERS[has_weights])
    return Table("From a raw cloud to every door in it", columns, cells, note, text_columns=2)


def _stage_cell(row: Result, stage: str) -> str:
    median_ms = row["stages"][stage]["median_ms"]
    if stage == "total":
        return f"{format_ms(median_ms)} ({format_ms(row['stages'][stage]['p90_ms'])})"
    number = row["candidates"] if stage == "crops" else row["doors"]
    if stage in _EACH and number:
        return f"{format_ms(median_ms)} ({format_ms(median_ms / number)})"
    return format_ms(median_ms)


def _predictors(source: Path | str, threads: int, folder: Path) -> dict[str, DoorwayPredictor]:
    """Return the predictors by runtime; an exported network has one."""
    if isinstance(source, Path) and source.suffix == ".onnx":
        return {"onnxruntime": _predictor(load_backend(source, threads), source)}
    if isinstance(source, str):
        card = WeightsCard(network=source, num_points=CROP_POINTS, input="doorway", scale_m=1.5, heads=HEADS)
        module = create_network(source)
        add_heads(module, HEADS)
        backend: Backend = TorchBackend(module, card)
    else:
        backend = load_backend(source, threads, "torch")
    path = folder / "network.onnx"
    torch_predictor = _predictor(backend, source)
    if not path.is_file() and backend.network is not None:
        clouds = reference_clouds(3, torch_predictor.num_points, cloud_input="doorway")
        export_onnx(path, backend.network, backend.card, clouds)
    return {"torch": torch_predictor, "onnxruntime": _predictor(OnnxBackend(path, threads), source)}


def _predictor(backend: Backend, source: Path | str) -> DoorwayPredictor:
    if backend.card.input != "doorway":
        raise ConfigError("weights for whole clouds", path=source, field="weights", expected="for doorways")
    return DoorwayPredictor(_SureDoors(backend) if isinstance(source, str) else backend)


@contextmanager
def _best_candidates(number: int) -> Iterator[None]:
    """Let predictors take the `number` best candidates within the block, however improbable."""
    settings = FinderSettings(most=number, min_score=0.0)
    with patch.object(upright, "find_doorways", partial(find_doorways, settings=settings)):
        yield


def _stages_of_call(measured: DoorwayPredictor, cloud: Points) -> dict[str, float]:
    """Return the milliseconds of each stage within one call, and the numbers of candidates and doors."""
    with ExitStack() as stack:
        times = {stage: stack.enter_context(timed_calls(*function)) for stage, function in _STAGES.items()}
        started = time.process_time()
        prediction = measured(cloud)
        processor_ms = (time.process_time() - started) * 1000
    stages = {stage: sum(durations_ms) for stage, durations_ms in times.items()}
    total = prediction.milliseconds
    numbers = {"candidates": len(times["crops"]), "doors": len(prediction.doors)}
    sums = {"other": total - sum(stages.values()), "total": total, "processor": processor_ms}
    return stages | sums | numbers


def _row(calls: Sequence[Mapping[str, float]]) -> Result:
    numbers = {name: int(calls[0][name]) for name in ("candidates", "doors")}
    return numbers | {"stages": {stage: summarize_ms([call[stage] for call in calls]) for stage in STAGES}}


def _measure_checks(cloud: Points, repeats: int) -> dict[str, float]:
    """Return the median milliseconds of the check of a door at the finder's best candidate, by state."""
    level = level_cloud(remove_outliers(cloud).points)
    best = find_doorways(level.points, level.floor_z_m)[0]
    points = thinned(level.points)
    checks_ms = {}
    for state in STATES:
        door = Door(
            best.x_m, best.y_m, best.yaw_deg, best.width_m, DoorState(state), floor_z_m=best.floor_z_m
        )
        with timed_calls(Gate, "check_doorways") as durations_ms:
            for _ in range(repeats + 1):
                DEFAULT_GATE.check_doorways(points, [door])
        checks_ms[state] = float(np.median(durations_ms[1:]))
    return checks_ms
