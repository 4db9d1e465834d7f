# SPDX-License-Identifier: Apache-2.0
"""Training of the column scorer for a number of steps, and its export."""

from __future__ import annotations

import io
import math
import warnings
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from doorstate._files import atomic_path
from doorstate._jobs import Progress, no_progress

from .network import ColumnNetwork, loss
from .samples import TARGETS, WallSamples

DEFAULT_STEPS = 30_000
_WALLS = 32  # of a step
_RATE, _WEIGHT_DECAY, _WARM_UP, _CLIP = 3e-3, 0.02, 50, 5.0
_MIRROR, _FLOOR_ERROR, _MAX_FLOOR_ROWS = 0.5, 0.4, 2
_RELIEF_SIGMA = 0.1  # of the plane's place and of its tilt per metre of height, in units of the relief: 1 cm
_MIDDLE_ROW, _ROWS_PER_M = 10, 10.0
_OPSET = 17


def train_scorer(
    samples: WallSamples, steps: int = DEFAULT_STEPS, seed: int = 0, progress: Progress = no_progress
) -> ColumnNetwork:
    """Return a trained network.

    Args:
        samples: walls to learn from.
        steps: batches of 32 walls.
        seed: of weights, order and augmentation.
        progress: called with steps done and steps in all.
    """
    rng = np.random.default_rng(seed)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        network = ColumnNetwork()
    optimizer = torch.optim.AdamW(network.parameters(), _RATE, weight_decay=_WEIGHT_DECAY)
    for step in range(steps):
        rate = _RATE * min(1.0, (step + 1) / _WARM_UP) * (0.01 + 0.5 * (1 + math.cos(math.pi * step / steps)))
        for group in optimizer.param_groups:
            group["lr"] = rate
        batch = augmented(samples, rng.integers(len(samples.lengths), size=_WALLS), rng)
        cells, columns, targets = (torch.from_numpy(array) for array in batch)
        error = loss(network(cells, columns), targets)
        optimizer.zero_grad()
        error.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(network.parameters(), _CLIP)
        optimizer.step()
        progress(step + 1, steps)
    return network.eval()


def augmented(
    samples: WallSamples, numbers: NDArray[np.int64], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return cells, columns and targets of walls: mirrored, with errors of floor, plane and tilt."""
    cells = samples.cells[numbers].astype(np.float32)
    columns, targets = samples.columns[numbers].copy(), samples.targets[numbers].copy()
    for wall in np.flatnonzero(rng.random(len(numbers)) < _MIRROR):
        used = slice(samples.lengths[numbers[wall]])
        _mirror(cells[wall, used], columns[wall, used], targets[wall, used])
    for wall in np.flatnonzero(rng.random(len(numbers)) < _FLOOR_ERROR):
        rows = int(rng.integers(-_MAX_FLOOR_ROWS, _MAX_FLOOR_ROWS + 1))
        cells[wall] = np.roll(cells[wall], rows, axis=1)
        cells[wall][:, slice(0, rows) if rows >= 0 else slice(rows, None)] = 0
    height_m = (np.arange(cells.shape[2]) - _MIDDLE_ROW) / _ROWS_PER_M
    place, tilt = rng.normal(0, _RELIEF_SIGMA, (2, len(numbers), 1, 1)).astype(np.float32)
    relief = cells[..., 1] + place + tilt * height_m.astype(np.float32)
    cells[..., 1] = np.where(cells[..., 0] > 0, relief, 0)
    return cells, columns, targets


def export_scorer(network: ColumnNetwork, path: Path) -> None:
    """Write a network as an ONNX file for any number of walls and columns."""
    example = torch.zeros(1, 8, 24, 7), torch.zeros(1, 8, 2)
    content = io.BytesIO()
    axes = {name: {0: "walls", 1: "columns"} for name in ("cells", "columns", "scores")}
    with warnings.catch_warnings():
        # The exporter without torch.export needs no further package, and the graph is a chain of convolutions.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            network,
            example,
            content,  # type: ignore[arg-type]
            input_names=["cells", "columns"],
            output_names=["scores"],
            dynamic_axes=axes,
            opset_version=_OPSET,
            dynamo=False,
        )
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.getvalue())


def _mirror(cells: NDArray[np.float32], columns: NDArray[np.float32], targets: NDArray[np.float32]) -> None:
    for array in (cells, columns, targets):
        array[:] = array[::-1].copy()
    columns[:, 1] *= -1
    left, right = [TARGETS.left, TARGETS.left_place], [TARGETS.right, TARGETS.right_place]
    targets[:, left + right] = targets[:, right + left]
    for place in (TARGETS.place, TARGETS.left_place, TARGETS.right_place):
        targets[:, place] *= -1
