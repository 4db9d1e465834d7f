# SPDX-License-Identifier: Apache-2.0
"""Predict cloud after cloud without torch, and report late predictions.

    doorstate export --points 512 --out door.onnx     # once, with torch
    python examples/onnx_robot.py door.onnx recording/          # on the robot

docs/onnx.md lists the packages that the robot needs.
"""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import median

from doorstate import Predictor, read_cloud
from doorstate.io.find import find_clouds

BUDGET_MS = 100  # until the next cloud comes


def main(weights: Path, recording: Path) -> None:
    """Print the predictions, then their times."""
    predictor = Predictor.load(weights)
    predictor.warm_up()  # otherwise the first prediction is slower
    milliseconds = []
    for path in find_clouds([recording]):
        prediction = predictor(read_cloud(path))
        milliseconds.append(prediction.milliseconds)
        late = " (late)" if prediction.milliseconds > BUDGET_MS else ""
        print(f"{path.name}: {prediction.state or prediction.reason}{late}")
    torch_loaded = "torch" in sys.modules
    print(f"{median(milliseconds):.0f} ms, at most {max(milliseconds):.0f}; torch loaded: {torch_loaded}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
