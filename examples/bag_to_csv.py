# SPDX-License-Identifier: Apache-2.0
"""Read a bag in your own code: one row for each time that the door's state changes.

    python examples/bag_to_csv.py door-bag changes.csv

`doorstate predict --bag` writes a row for every message; this is for what it does not write. Needs the extra `bags`.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from doorstate import Predictor
from doorstate.errors import DoorstateError
from doorstate.io.bags import open_bag
from doorstate.io.options import ReadOptions


def main(recording: Path, table: Path) -> None:
    """Write the changes."""
    # It knows the door of make_bag.py; for doors of the world leave the name out.
    predictor = Predictor.load("ogurob-pointnet2", num_points=512)
    before = None
    with open_bag(recording) as bag, table.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow(["stamp_s", "state", "probability"])
        topic = bag.choose()  # the only one that can be read; else give its name
        # The frame is that of PointCloud2 topics; depth images are always optical.
        for stamp_s, _, cloud in bag.clouds(topic, ReadOptions(frame="optical")):
            if isinstance(cloud, DoorstateError):  # a damaged message: the others are read all the same
                print(f"{stamp_s:.3f}: {cloud}", file=sys.stderr)
                continue
            prediction = predictor(cloud)
            if prediction.state not in (None, before):
                before = prediction.state
                rows.writerow(
                    [f"{stamp_s:.3f}", before.label, f"{prediction.probabilities[before.label]:.3f}"]
                )
    print(f"{topic.messages} messages of {topic.name}: changes in {table}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
