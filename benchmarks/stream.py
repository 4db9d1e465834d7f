# SPDX-License-Identifier: Apache-2.0
"""Memory of a watch and its publisher over a day of frames, on a clock that runs as fast as frames are processed.

The network is replaced by a script, since its memory does not depend on how long it runs: a door that opens and closes,
frames without a state, and each hour a camera that is silent, and a clock that is set back.
"""

from __future__ import annotations

import gc
import time
from collections import Counter
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.store import Result
from benchmarks.timing import resident_mib
from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.inference.abstention import Abstention
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.watch import DoorWatch
from doorstate.inference.watch_settings import parse_settings
from doorstate.mqtt.publisher import MqttPublisher
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.status import status_of_front_door
from doorstate.types import STATES, DoorState, Points

RATE_HZ = 30
_HOUR_S = 3600.0
_ROUND_S = 20.0  # of the door
_SILENT_S = 30.0  # at the beginning of each hour but the first
_SET_BACK_S = 3600.0  # of the clock, in the middle of each hour
_POINTS = 64


class _Script(Predictor):
    """Predictor that says what the script says, of any cloud."""

    name = "script"

    def __init__(self) -> None:
        self.time_s = 0.0

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        share = self.time_s % _ROUND_S / _ROUND_S
        if share > 0.9:
            return [Prediction.abstain(Abstention("no_doorway"), _POINTS, 1.0)]
        state = STATES[min(2, int(share * 4))]
        probabilities = {name: 0.9 if name == state else 0.05 for name in STATES}
        return [Prediction(DoorState(state), _POINTS, 1.0, raw_probabilities=probabilities)]


def measure_stream(hours: float, rows: int, settings: MqttSettings, progress: Progress) -> list[Result]:
    """Return the memory of this process after each of `rows` equal parts of the stream, the first being the start.

    Args:
        hours: simulated length of the stream.
        rows: number of parts.
        settings: broker; one that cannot be reached is looked for all the time.
        progress: called with simulated and all seconds.
    """
    script, stamp_s, lines = _Script(), 1_700_000_000.0, Counter[str]()
    watch = DoorWatch(parse_settings({}), script)
    measured: list[Result] = []
    length_s, frames = hours * _HOUR_S, 0
    started_s = time.perf_counter()
    publisher = MqttPublisher(settings, lambda line: lines.update([line]), lambda: script.time_s)
    with publisher:
        while True:
            if script.time_s >= len(measured) * length_s / rows:
                gc.collect()
                measured.append(
                    {
                        "hours": script.time_s / _HOUR_S,
                        "frames": frames,
                        "resident_mib": resident_mib(),
                        "objects": len(gc.get_objects()),
                        "seconds": time.perf_counter() - started_s,
                        "lines": lines.total(),
                    }
                )
                progress(int(script.time_s), int(length_s))
            if script.time_s >= length_s:
                return measured
            before_s, script.time_s = script.time_s, script.time_s + 1 / RATE_HZ
            in_hour_s = script.time_s % _HOUR_S
            stamp_s += 1 / RATE_HZ - (_SET_BACK_S if _passes(before_s, script.time_s) else 0.0)
            if script.time_s > _HOUR_S and in_hour_s < _SILENT_S:
                continue
            report = watch.process(_message(stamp_s), 0)
            publisher.update([status_of_front_door(report.prediction, report.filtered)])
            frames += 1


def stream_table(rows: Sequence[Result]) -> Table:
    """Return one row per measurement."""
    return Table(
        "Memory of a watch and its publisher",
        ("hours of stream", "frames", "resident, MiB", "Python objects", "seconds here"),
        tuple(
            (
                f"{row['hours']:.1f}",
                str(row["frames"]),
                f"{row['resident_mib']:.1f}",
                str(row["objects"]),
                f"{row['seconds']:.0f}",
            )
            for row in rows
        ),
        f"A simulated stream of {RATE_HZ} frames a second, on a clock that runs as fast as frames are processed; the "
        "network is replaced by a script. Each hour the camera is silent for 30 s, and the clock of the stamps is set "
        "back by an hour.",
    )


def _passes(before_s: float, after_s: float) -> bool:
    """Return True once an hour, in its middle."""
    return before_s % _HOUR_S < _HOUR_S / 2 <= after_s % _HOUR_S


def _message(stamp_s: float) -> Any:
    """Return a PointCloud2 of a few points, another one each time."""
    points = np.full((_POINTS, 3), stamp_s % 7, "<f4")
    fields = [
        SimpleNamespace(name=name, offset=4 * place, datatype=7, count=1) for place, name in enumerate("xyz")
    ]
    seconds, fraction = divmod(stamp_s, 1)
    stamp = SimpleNamespace(sec=int(seconds), nanosec=int(fraction * 1e9))
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp, frame_id="camera_link"),
        height=1,
        width=_POINTS,
        fields=fields,
        is_bigendian=False,
        point_step=12,
        row_step=12 * _POINTS,
        data=points.tobytes(),
    )
