# SPDX-License-Identifier: Apache-2.0
"""Read a bag in your own code: write one row for each change of the door's state.

    python examples/bag_to_csv.py door-bag changes.csv

`doorstate predict --bag` writes a row for every message. Needs the extra `bags`.
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
    predictor = Predictor.load(num_points=512)  # quicker than 1024 points
    previous = None
    with open_bag(recording) as bag, table.open("w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow(["stamp_s", "state", "probability"])
        topic = bag.choose()  # by name, if there are several
        # The axes are those of PointCloud2 topics; depth images are always optical.
        for message in bag.clouds(topic, ReadOptions(axes="optical")):
            stamp_s, cloud = message.stamp_s, message.cloud
            if isinstance(cloud, DoorstateError):  # a damaged message
                print(f"{stamp_s:.3f}: {cloud}", file=sys.stderr)
                continue
            prediction = predictor(cloud, is_level=True)  # without it, the tilt is told from the cloud
            if prediction.state not in (None, previous):
                previous = prediction.state
                rows.writerow([f"{stamp_s:.3f}", previous, f"{prediction.probability:.3f}"])
    print(f"{topic.messages} messages of {topic.name}: changes in {table}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
