# SPDX-License-Identifier: Apache-2.0
"""Answer cloud after cloud on a robot without torch, and say which answers came too late.

    doorstate export pointnet2 --points 512 --out door.onnx     # once, where torch is
    python examples/onnx_robot.py door.onnx recording/          # on the robot

docs/onnx.md says what to install on the robot.
"""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import median

from doorstate import Predictor, read_cloud
from doorstate.io.find import find_clouds

BUDGET_MS = 100  # until the next cloud comes


def main(network: Path, recording: Path) -> None:
    """Print the answers, then how long they took."""
    predictor = Predictor.load(network)
    predictor.warm_up()  # the first answer would take longer than the others
    took_ms = []
    for path in find_clouds([recording]):
        prediction = predictor(read_cloud(path))
        took_ms.append(prediction.milliseconds)
        state = prediction.reason if prediction.state is None else prediction.state.label
        print(f"{path.name}: {state}{' (late)' if prediction.milliseconds > BUDGET_MS else ''}")
    print(f"{median(took_ms):.0f} ms, at most {max(took_ms):.0f}; torch loaded: {'torch' in sys.modules}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
