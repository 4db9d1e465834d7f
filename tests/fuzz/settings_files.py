# SPDX-License-Identifier: Apache-2.0
"""Targets of settings that come from files: experiments, data sets, comparisons and weights."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from hypothesis import strategies as st
from safetensors.numpy import save

from doorstate._files import read_csv
from doorstate.dataset.store import DatasetDescription, open_dataset
from doorstate.evaluation.predictions import load_results
from doorstate.networks.card import WeightsCard
from doorstate.networks.card_file import read_card
from doorstate.networks.weights import load_weights
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.training.comparison import read_comparison
from doorstate.training.experiment import Experiment, load_experiment
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
_OPTIONS: dict[str, dict[str, Any]] = {
    "pointnet": {"batchnorm_eps": 1e-3},
    "pointnet2": {"radii": [0.1, 0.2], "num_samples": 8},
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


def read_settings(data: bytes, name: str) -> str:
    """Read a damaged file beside good ones, and return `read` or the name of the error that refused it."""
    path, (read, good) = _FOLDER / name, _FILES[name]
    path.write_bytes(data)
    try:
        return outcome_of(lambda: read(path) or "read")
    finally:
        path.write_bytes(_compressed(name, good))


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


def _weights_files() -> st.SearchStrategy[bytes]:
    tensors = {"output.bias": np.zeros(3, np.float32)}
    cards = [
        WeightsCard(network=name, network_options=options, num_points=256, heads=("angle",))
        .model_dump_json()
        .encode()
        for name, options in _OPTIONS.items()
    ]

    def weights_file(card: bytes) -> bytes:
        return save(tensors, {"doorstate": card.decode(errors="replace")})

    return damaged(cards, _TOKENS).map(weights_file) | damaged([weights_file(cards[0])])


def _read_weights(path: Path) -> None:
    read_card(path)
    load_weights(path)


def _csv_line(values: Any) -> str:
    return ",".join('"' + value.replace('"', '""') + '"' for value in values)


def _files() -> dict[str, tuple[Callable[[Path], None], bytes]]:
    """Return the reader and good content of every file by name; what is compressed is written compressed."""
    rows = [flatten(row) for row in draw_rows(PRESETS["ogurob"], 7, 0)]
    text = "\n".join([",".join(rows[0]), *(_csv_line(row.values()) for row in rows)])
    comparison = Experiment(name="a", dataset="data").model_dump(mode="json") | {"recipe": {"name": "common"}}
    description = DatasetDescription(
        kind="imported", source="a", num_points=256, samples=3, doorstate_version="0", clouds="replayed"
    )
    return {
        "experiment.toml": (_read_experiment, _EXPERIMENT),
        "rows.csv": (_read_rows, text.encode()),
        "comparison.json": (_read_comparison, json.dumps(comparison).encode()),
        "data/dataset.json": (_open_dataset, description.model_dump_json().encode()),
        "weights.safetensors": (_read_weights, b""),
        **{name: (_load_published, content) for name, content in _PUBLISHED.items()},
    }


_FILES = _files()


def targets() -> dict[str, Target]:
    """Return the targets by name."""
    (_FOLDER / "data").mkdir(exist_ok=True)
    damaged_files = {"weights.safetensors": st.deferred(_weights_files)}
    for name, (_, content) in _FILES.items():
        (_FOLDER / name).write_bytes(_compressed(name, content))
        text = damaged([content], _TOKENS).map(partial(_compressed, name))
        damaged_files.setdefault(name, text | damaged([_compressed(name, content)]))
    return {
        name: fuzz_target(partial(read_settings, name=name), data=data)
        for name, data in damaged_files.items()
    }


def _compressed(name: str, content: bytes) -> bytes:
    return gzip.compress(content, mtime=0) if name.endswith(".gz") else content
