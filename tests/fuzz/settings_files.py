# SPDX-License-Identifier: Apache-2.0
"""Targets of settings that come from files: experiments, data sets, comparisons and weights."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import torch
from onnx import TensorProto, helper
from safetensors.numpy import save
from torch import nn

from doorstate._files import read_csv
from doorstate.dataset.description import DatasetDescription
from doorstate.dataset.store import open_dataset
from doorstate.evaluation.predictions import load_results
from doorstate.inference.backends.onnx_backend import INPUT, PROBABILITIES, OnnxBackend
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.card_file import read_card
from doorstate.networks.weights import load_weights
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.presets import PRESETS, PresetName, draw_rows
from doorstate.simulation.row import Row
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import read_settings as read_simulation_settings
from doorstate.training.checkpoint import Checkpoint, EpochProgress, TrainingState
from doorstate.training.comparison import read_comparison
from doorstate.training.experiment import Experiment, load_experiment
from doorstate.training.recipes import Recipe
from doorstate.training.resolution import ResolutionStudy
from doorstate.training.schedules import RateSchedule
from doorstate.training.study import load_study
from doorstate.training.transfer import TransferStudy
from tests.fuzz.harness import Target, fuzz_target, outcome_of
from tests.fuzz.strategies import damaged

_SCRATCH = TemporaryDirectory()
_FOLDER = Path(_SCRATCH.name)
_TOKENS = (b"[" * 5000, b"{", b"[]", b"null", b"1" * 5000, b"1e999", b'"', b"true", b"\\ud800")
_EXPERIMENT = b"""protocol = "by-pose"
folds = 1
networks = ["pointnet"]
rules = ["plane_state"]
heads = ["angle"]
dataset = "data"
recipe_changes = {epochs = 2, augmentation = {yaw_deg = 1.0}, loss_weights = {angle = 0.5}}
network_changes.pointnet.coarse_to_fine = [{share = 0.5, points = 128}]
"""
_RESOLUTION = b"""dataset = "data"
start_from = "runs"
points = [256, 512]
networks = ["pointnet"]
heads = ["angle"]
fine_tuning = {epochs = 2, learning_rate = 1e-3, schedule = "steps", step_epochs = 1}
"""
_TRANSFER = f"""networks = ["pointnet"]
num_points = 512
[trained]
a = "{_FOLDER}"
[tested]
b = "data"
""".encode()
_MAX_PIXELS = 2000
_OPTIONS: dict[str, dict[str, Any]] = {
    "pointnet": {"batchnorm_eps": 1e-3},
    "pointnet2": {"radii": [0.1, 0.2], "num_samples": 8, "centres": [256, 64]},
    "dgcnn": {"k": 20},
    "point2sequence": {"region_feature": "attention", "dilation": 2},
}
_PUBLISHED = {
    "experiment.json": b'{"name": "a", "folds": 1, "networks": ["pointnet"], "rules": [], "num_points": 256, '
    b'"seed": 0, "protocol": "paper", "dataset": "data", "recipe": {}, "runs": {"pointnet": {"epochs": 1}}}',
    "metrics.json": b'{"runs": [{"method": "pointnet", "fold": 0, "metrics": {"seconds": 1.5}, '
    b'"environment": {"threads": 1}, "log": {"epoch": [0.0, 1.0], "loss": [1.0, null]}}]}',
    "splits.csv.gz": b"sample_id,fold_0\na,test\nb,train\nc,unused\n",
    "predictions.csv.gz": b"method,fold,role,sample_id,state,predicted,p_closed,p_semi_open,p_open,reason,"
    b"opening_angle_deg,open_or_not\npointnet,0,test,a,open,closed,0.8,0.1,0.1,,12.5,\n",
    "data/manifest.csv": b"sample_id,state,opening_angle_deg\na,open,80\nb,closed,0\nc,no_door,\n",
}


class _File(NamedTuple):
    """How a file is read, its good contents, and what turns a content into the bytes of the file."""

    read: Callable[[Path], None]
    contents: tuple[bytes, ...]
    encode: Callable[[bytes], bytes] = bytes


def read_settings(data: bytes, name: str) -> str:
    """Read a damaged file beside good ones, and return `read` or the name of the error that refused it."""
    path, file = _FOLDER / name, _FILES[name]
    path.write_bytes(data)
    try:
        return outcome_of(lambda: file.read(path) or "read")
    finally:
        path.write_bytes(file.encode(file.contents[0]))


def read_content(content: bytes, name: str) -> None:
    """Read a file of this content, before it is compressed or becomes the card of weights."""
    read_settings(_FILES[name].encode(content), name)


def seeds(name: str) -> tuple[bytes, ...]:
    """Return good contents of a file, from which guided fuzzing starts."""
    return _FILES[name].contents


def _load_published(_: Path) -> None:
    results = load_results(_FOLDER)
    assert len(results.joined) >= len(results.tested) >= len(results.errors)


def _read_experiment(path: Path) -> None:
    load_experiment(path, {})


def _open_dataset(path: Path) -> None:
    dataset = open_dataset(path.parent)
    assert len(dataset.labels) == len(dataset)


def _read_rows(path: Path) -> None:
    for row in read_csv(path):
        unflatten(row)


def _read_comparison(path: Path) -> None:
    settings = read_comparison(path.parent)
    assert {"dataset", "networks", "heads", "extra_train_datasets"} <= set(settings)


def _replay_rows(path: Path) -> None:
    for line in read_csv(path):
        row = unflatten(line)
        if row.camera.width * row.camera.height <= _MAX_PIXELS:  # larger ones only take longer
            replay(row)


def _read_study(path: Path) -> None:
    kind = ResolutionStudy if path.stem == "resolution" else TransferStudy
    list(load_study(path, kind).parts())


def _read_simulation(path: Path) -> None:
    settings = read_simulation_settings(path.parent)
    assert len(settings.preset.indices(min(settings.poses or 1, 9))) > 0


def _read_weights(path: Path) -> None:
    read_card(path)
    load_weights(path)


def _open_network(path: Path) -> None:
    assert OnnxBackend(path, threads=1).card.num_points > 0


def _load_checkpoint(path: Path) -> None:
    network = nn.Linear(2, 3)
    optimizers = [torch.optim.AdamW(network.parameters(), lr=0.1)]
    Checkpoint(path, network, optimizers, RateSchedule(Recipe(name="a"), optimizers, 2, 128)).load()


def _checkpoint() -> bytes:
    network = nn.Linear(2, 3)
    optimizers = [torch.optim.AdamW(network.parameters(), lr=0.1)]
    network(torch.ones(1, 2)).sum().backward()
    optimizers[0].step()
    checkpoint = Checkpoint(
        _FOLDER / "good.pt", network, optimizers, RateSchedule(Recipe(name="a"), optimizers, 2, 128)
    )
    progress = EpochProgress([1.0], 0.1, torch.get_rng_state(), 1.0)
    checkpoint.save(TrainingState([{"epoch": 0.0}], (0.5, -1.0), 0, progress))
    return checkpoint.path.read_bytes()


def _cards() -> tuple[bytes, ...]:
    return tuple(
        WeightsCard(network=name, network_options=options, num_points=256, heads=("angle",))
        .model_dump_json()
        .encode()
        for name, options in _OPTIONS.items()
    )


def _weights_file(card: bytes) -> bytes:
    return save({"output.bias": np.zeros(3, np.float32)}, {CARD_KEY: card.decode(errors="replace")})


def _onnx_file(card: bytes) -> bytes:
    points = helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, ["batch", "points", 3])
    probabilities = helper.make_tensor_value_info(PROBABILITIES, TensorProto.FLOAT, ["batch", "points", 3])
    node = helper.make_node("Softmax", [INPUT], [PROBABILITIES])
    model = helper.make_model(
        helper.make_graph([node], "g", [points], [probabilities]),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=8,
    )
    helper.set_model_props(model, {CARD_KEY: card.decode(errors="replace")})
    content: bytes = model.SerializeToString()
    return content


def _csv_line(values: Any) -> str:
    return ",".join('"' + value.replace('"', '""') + '"' for value in values)


def _table(rows: Sequence[Row]) -> bytes:
    lines = [flatten(row) for row in rows]
    return "\n".join([",".join(lines[0]), *(_csv_line(line.values()) for line in lines)]).encode()


def _small_rows(preset: PresetName) -> list[Row]:
    camera = DepthCamera(width=16, height=12)
    return [row.model_copy(update={"camera": camera}) for row in draw_rows(PRESETS[preset], 7, 0)]


def _files() -> dict[str, _File]:
    comparison = Experiment(name="a", dataset="data").model_dump(mode="json") | {"recipe": {"name": "common"}}
    description = DatasetDescription(
        kind="imported", source="a", num_points=256, samples=3, doorstate_version="0", clouds="replayed"
    )
    simulation = SimulationSettings(preset=PRESETS["varied"], seed=1, poses=4, sensor="d435", raw=("pcd",))
    return {
        "experiment.toml": _File(_read_experiment, (_EXPERIMENT,)),
        "resolution.toml": _File(_read_study, (_RESOLUTION,)),
        "transfer.toml": _File(_read_study, (_TRANSFER,)),
        "simulation.json": _File(_read_simulation, (simulation.model_dump_json().encode(),)),
        "rows.csv": _File(_read_rows, (_table(_small_rows("ogurob")),)),
        "replayed.csv": _File(
            _replay_rows,
            tuple(_table(_small_rows(name)[:1]) for name in ("ogurob", "cluttered", "no-door", "two-doors")),
        ),
        "comparison.json": _File(_read_comparison, (json.dumps(comparison).encode(),)),
        "data/dataset.json": _File(_open_dataset, (description.model_dump_json().encode(),)),
        "checkpoint.pt": _File(_load_checkpoint, (_checkpoint(),)),
        "weights.safetensors": _File(_read_weights, _cards(), _weights_file),
        "network.onnx": _File(_open_network, _cards(), _onnx_file),
        **{
            name: _File(
                _load_published,
                (content,),
                partial(gzip.compress, mtime=0) if name.endswith(".gz") else bytes,
            )
            for name, content in _PUBLISHED.items()
        },
    }


(_FOLDER / "data").mkdir(exist_ok=True)
_FILES = _files()
for _name, _file in _FILES.items():
    (_FOLDER / _name).write_bytes(_file.encode(_file.contents[0]))


def targets() -> dict[str, Target]:
    """Return the targets by name."""
    return {
        name: fuzz_target(
            partial(read_settings, name=name),
            data=damaged(file.contents, _TOKENS).map(file.encode)
            | damaged([file.encode(content) for content in file.contents]),
        )
        for name, file in _FILES.items()
    }
