# SPDX-License-Identifier: Apache-2.0
"""Predict the state of the door in one cloud, and handle every kind of result.

    python examples/one_cloud.py cloud.pcd && echo go

Exit code: 0 the door is open, 1 it is not, 2 unknown. A program that moves a robot needs all three.
"""

from __future__ import annotations

import sys
from pathlib import Path

from doorstate import DoorState, Predictor, read_cloud
from doorstate.errors import CloudError


def main(path: Path) -> int:
    """Print the result, and return the exit code."""
    predictor = Predictor.load()  # once: loading takes longer than predicting
    try:
        prediction = predictor(read_cloud(path))
    except CloudError as error:  # the file cannot be read, or its content is no cloud
        print(f"unusable: {error}")
        return 2
    if prediction.state is None:  # too much is missing, or the network is unsure
        print(f"unknown: {prediction.reason}")
        return 2
    print(f"{prediction.state}, probability {prediction.probability:.2f}")
    return 0 if prediction.state == DoorState.OPEN else 1


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1])))
