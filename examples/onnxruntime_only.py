# SPDX-License-Identifier: Apache-2.0
"""Answer for one cloud with NumPy and onnxruntime alone, to be written again in any language.

    doorstate export --network ogurob-pointnet2 --points 512 --out door.onnx   # once, where doorstate is
    python examples/onnxruntime_only.py door.onnx cloud.npy

The cloud is (N, 3) or (H, W, 3) metres, x forward, y left, z up, NaN where nothing was measured. The graph refuses what
it can see: no door, too unsure a state, and points that are not those of a camera before a door. What it cannot see,
holes and a missing share of the raw cloud, is left to the program (docs/onnx.md). Networks for doorways need the search
for doorways too, which is more than fits here. Exit code: 0 a state, 2 none.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
import onnxruntime

TOO_FEW = "too_few_points"


def farthest_points(points: np.ndarray, count: int) -> np.ndarray:
    """Return `count` points, each the farthest from all before it; the order matters to the network."""
    corner = points.min(0) - (np.linalg.norm(np.ptp(points, axis=0)) + 1)
    chosen = [int(np.square(points - corner).sum(1).argmax())]
    nearest = np.full(len(points), np.inf, np.float32)
    while len(chosen) < count:
        nearest = np.minimum(nearest, np.square(points - points[chosen[-1]]).sum(1))
        chosen.append(int(nearest.argmax()))
    return points[chosen]


def prepare(cloud: np.ndarray, count: int, max_depth_m: float | None) -> np.ndarray | None:
    """Return (count, 3) points for the graph; None if the cloud has fewer."""
    if cloud.ndim == 3:  # a part of the rows and columns is enough
        step = max(1, int((cloud.shape[0] * cloud.shape[1] / (16 * count)) ** 0.5))
        cloud = cloud[::step, ::step]
    points = cloud.reshape(-1, 3).astype(np.float32)
    points = points[np.isfinite(points).all(1) & points.any(1)]
    if max_depth_m is not None:  # before sampling, which would spread points over what is far away
        points = points[points[:, 0] <= max_depth_m]
    points = np.unique(points, axis=0)
    return farthest_points(points, count) if len(points) >= count else None


def answer(session: onnxruntime.InferenceSession, cloud: np.ndarray) -> dict[str, Any]:
    """Return the state with its probability and the heads, or the reason why there is none."""
    metadata = session.get_modelmeta().custom_metadata_map
    card = json.loads(metadata["doorstate"])
    if card["input"] != "whole":
        sys.exit("this network takes crops of doorways: doorstate finds them, see docs/onnx.md")
    points = prepare(cloud, card["num_points"], card["max_depth_m"])
    if points is None:
        return {"state": None, "reason": TOO_FEW}
    names = [output.name for output in session.get_outputs()]
    outputs = {
        name: values[0]
        for name, values in zip(names, session.run(None, {"points": points[None]}), strict=True)
    }
    state, reason = int(outputs.pop("state")), int(outputs.pop("reason"))
    if state < 0:
        return {"state": None, "reason": json.loads(metadata["reasons"])[reason]}
    probabilities, _ = outputs.pop("probabilities"), outputs.pop("raw_probabilities")
    heads = {name: values.tolist() for name, values in outputs.items()}  # units: metadata["outputs"]
    return {"state": metadata["labels"].split(",")[state], "probability": float(probabilities[state])} | heads


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    found = answer(onnxruntime.InferenceSession(sys.argv[1]), np.load(sys.argv[2], allow_pickle=False))
    print(json.dumps(found))
    sys.exit(0 if found["state"] else 2)
