# SPDX-License-Identifier: Apache-2.0
"""Follow a door over time without flicker, then wait until it has been open for a second.

    python examples/stream.py door-bag

`StateFilter` and `wait_for` take any stamped clouds: here those of a recording, on a robot those of a camera driver.
Exit code 0 if the door was opened, 1 if not. Needs the extra `bags`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from doorstate import Predictor, StateFilter, wait_for
from doorstate.errors import DoorstateError
from doorstate.io.bags import open_bag
from doorstate.types import Points


def stamped_clouds(recording: Path) -> Iterator[tuple[float, Points]]:
    """Yield stamps in seconds and clouds; replace this by your camera."""
    with open_bag(recording) as bag:
        for message in bag.clouds(bag.choose()):
            if not isinstance(message.cloud, DoorstateError):
                yield message.stamp_s, message.cloud


def main(recording: Path) -> int:
    """Print every change, then wait; return the exit code."""
    # Or Predictor.load(budget_ms=33). A camera that is not level: without is_level, the tilt is told from each cloud.
    predict = partial(Predictor.load(), is_level=True)
    state_filter = StateFilter()
    start_s = previous = None
    for stamp_s, cloud in stamped_clouds(recording):
        start_s = stamp_s if start_s is None else start_s
        prediction = predict(cloud)
        door = state_filter.update(prediction, stamp_s)
        states = (prediction.state, door.state)
        if states != previous:
            single, filtered = (state or "unknown" for state in states)
            print(f"{stamp_s - start_s:4.1f} s  this frame: {single:9}  filtered: {filtered}")
            previous = states
    if wait_for("open", stamped_clouds(recording), timeout_s=30, hold_s=1.0, predictor=predict):
        print("the way is free")
        return 0
    print("still not open: ask for help")
    return 1


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1])))
