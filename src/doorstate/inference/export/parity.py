# SPDX-License-Identifier: Apache-2.0
"""Comparison of an exported file with torch on the same clouds.

Networks that look for neighbours among features (DGCNN) or weigh them in their order (PointCNN) turn rounding into
another neighbour, and then torch differs as much from itself. So where a difference is above `TOLERANCE`, twice the
effect of rounding in torch is allowed.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from doorstate._jobs import Progress, no_progress
from doorstate.inference.backends.base import Outputs
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.types import STATES, Points

TOLERANCE = 1e-4  # of a probability
_NUM_JITTERS = 3
_LAST_DIGIT = np.array([-(2.0**-23), 0.0, 2.0**-23], dtype=np.float32)  # of a float32, relative


@dataclass(frozen=True)
class Parity:
    """Agreement of an exported file with torch."""

    max_difference: float  # of a probability or of another output
    tolerance: float
    num_clouds: int
    num_correct: int  # states predicted by the file
    num_correct_torch: int


def compare_with_torch(
    path: Path,
    network: PointNetwork,
    card: WeightsCard,
    clouds: LabelledClouds,
    progress: Progress = no_progress,
) -> Parity:
    """Run a file and torch on the same clouds, alone and in pairs.

    Args:
        path: file written by `export_onnx`.
        network: network it was made of.
        card: card of the network's weights.
        clouds: clouds with as many points as the file takes.
        progress: called after every three clouds.
    """
    points, labels = clouds
    exported, original = OnnxBackend(path), TorchBackend(network, card)
    outputs, expected, withheld = [], [], []
    progress(0, len(points))
    for start in range(0, len(points), 3):
        for batch in (points[start : start + 1], points[start + 1 : start + 3]):
            if len(batch):
                of_batch = exported(batch)
                outputs.append(_output_columns(of_batch))
                withheld.append(
                    np.zeros(len(batch), bool) if of_batch.withheld is None else of_batch.withheld
                )
                expected.append(_output_columns(original(batch)))
        progress(min(start + 3, len(points)), len(points))
    of_file, of_torch = np.concatenate(outputs), np.concatenate(expected)
    # Heads are not given where the state is refused.
    is_withheld = np.concatenate(withheld)[:, None] & np.isnan(of_file)
    max_difference = float(np.abs(np.where(is_withheld, 0, of_file - of_torch)).max())
    tolerance = TOLERANCE
    if max_difference > TOLERANCE:
        tolerance = max(TOLERANCE, 2 * rounding_effect(network, card, points))
    return Parity(
        max_difference, tolerance, len(points), _num_correct(of_file, labels), _num_correct(of_torch, labels)
    )


def rounding_effect(network: PointNetwork, card: WeightsCard, points: Points) -> float:
    """Return the largest effect of rounding on an output of torch.

    Args:
        network: network.
        card: card of its weights.
        points: (M, n, 3) clouds; the last digits of their points are changed, and all is computed in float64.
    """
    original, rng = TorchBackend(network, card), np.random.default_rng(0)
    exact = TorchBackend(copy.deepcopy(network).double(), card)

    def jittered(cloud: Points) -> Points:
        factors: Points = np.float32(1) + rng.choice(_LAST_DIGIT, cloud.shape)
        return cloud * factors

    def change(cloud: Points) -> float:
        reference = _output_columns(original(cloud[None]))
        variants = [_output_columns(exact(cloud[None]))]
        variants += [_output_columns(original(jittered(cloud)[None])) for _ in range(_NUM_JITTERS)]
        return max(float(np.abs(reference - variant).max()) for variant in variants)

    return max((change(cloud) for cloud in points), default=0.0)


def _output_columns(outputs: Outputs) -> NDArray[np.float32]:
    """Return (B, 3 + heads) outputs, angles in radians so that their digits weigh the same."""
    heads = [
        np.radians(column) if name.endswith("_deg") else column for name, column in outputs.heads.items()
    ]
    return np.column_stack([outputs.probabilities, *heads]).astype(np.float32)


def _num_correct(outputs: NDArray[np.float32], labels: NDArray[np.int64]) -> int:
    return int((outputs[:, : len(STATES)].argmax(1) == labels).sum())
