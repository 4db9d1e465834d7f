# SPDX-License-Identifier: Apache-2.0
"""Compare all rules on your labelled clouds, whole and with the left half of the image missing.

    doorstate simulate --poses 20 --keep pcd --out doors
    python examples/choose_rule.py doors/pcd

The folder has one sub-folder for each state (open, semi-open, closed, in any usual spelling). The last two columns
count doors that are not open and are called open when data are missing: with the gate, and without it. Needs no torch.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from statistics import median

import numpy as np

from doorstate import Predictor, read_cloud
from doorstate.dataset.class_folders import labelled_rows
from doorstate.rules import list_rules
from doorstate.types import DoorState


def main(root: Path) -> None:
    """Print a row for each rule."""
    labelled = [(read_cloud(root / row["file"]), DoorState(row["state"])) for row in labelled_rows(root)]
    print(f"{len(labelled)} clouds")
    print(f"{'rule':16}{'right':>6}{'wrong':>6}{'unknown':>9}{'ms':>6}  open by mistake: gate, no gate")
    for name in list_rules():
        gated, ungated = Predictor.load(rule=name), Predictor.load(rule=name, gate=None)
        counts: Counter[str] = Counter()
        milliseconds = []
        for cloud, state in labelled:
            prediction = gated(cloud)
            milliseconds.append(prediction.milliseconds)
            if prediction.state is None:
                counts["unknown"] += 1
            else:
                counts["right" if prediction.state == state else "wrong"] += 1
            if cloud.ndim == 3 and state != DoorState.OPEN:
                half = cloud.copy()
                half[:, : half.shape[1] // 2] = np.nan
                counts["open with gate"] += gated(half).state == DoorState.OPEN
                counts["open without gate"] += ungated(half).state == DoorState.OPEN
        row = (
            f"{name:16}{counts['right']:6}{counts['wrong']:6}{counts['unknown']:9}{median(milliseconds):6.0f}"
        )
        print(f"{row}{counts['open with gate']:23}{counts['open without gate']:9}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
