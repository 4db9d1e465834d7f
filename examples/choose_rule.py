# SPDX-License-Identifier: Apache-2.0
"""Which rule suits your doors? Each is asked about labelled clouds, whole and with the left half of the image lost.

    doorstate simulate --poses 20 --keep pcd --out doors
    python examples/choose_rule.py doors/pcd

The folder has one folder for each state (open, semi-open, closed, in any usual spelling). The last two columns count
doors that are not open and are called open when data are missing: with the gate, and without. No torch is needed.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from statistics import median

import numpy as np

from doorstate import read_cloud
from doorstate.dataset.class_folders import labelled_rows
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.rules import create_rule, list_rules
from doorstate.types import DoorState


def main(root: Path) -> None:
    """Print a row for each rule."""
    labelled = [
        (read_cloud(root / row["file"]), DoorState[row["state"].upper()]) for row in labelled_rows(root)
    ]
    print(f"{len(labelled)} clouds")
    print(
        f"{'rule':16}{'right':>6}{'wrong':>6}{'no answer':>11}{'ms':>6}   called open by mistake: gate, no gate"
    )
    for name in list_rules():
        gated, careless = RulePredictor.from_name(name), RulePredictor(create_rule(name), gate=None)
        verdicts: Counter[str] = Counter()
        milliseconds = []
        by_mistake = [0, 0]
        for cloud, state in labelled:
            prediction = gated(cloud)
            milliseconds.append(prediction.milliseconds)
            verdicts["none" if prediction.state is None else str(prediction.state == state)] += 1
            if cloud.ndim == 3 and state != DoorState.OPEN:
                half = cloud.copy()
                half[:, : half.shape[1] // 2] = np.nan
                for place, predictor in enumerate((gated, careless)):
                    by_mistake[place] += predictor(half).state == DoorState.OPEN
        counts = f"{verdicts['True']:6}{verdicts['False']:6}{verdicts['none']:11}{median(milliseconds):6.0f}"
        print(f"{name:16}{counts}{by_mistake[0]:29}{by_mistake[1]:9}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
