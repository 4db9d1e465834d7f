# SPDX-License-Identifier: Apache-2.0
"""Doors of a list in the reports of a live camera, with the history of their states."""

from __future__ import annotations

from collections.abc import Sequence

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.history import DoorHistory
from doorstate.doors.named_door import NamedDoor
from doorstate.doors.named_predictor import name_doors
from doorstate.doors.tracker import DoorTracker, TrackedFrame
from doorstate.inference.door_report import DoorReport
from doorstate.inference.predictor import Predictor
from doorstate.types import Points


class LiveDoors:
    """Names the doors of report after report. Not for several threads.

    Args:
        doors: doors of the list.
        predictor: network or rule of the reports.
        history: file for what changes.
        asks: ask for doors in view that were not found, at the cost of one more prediction for each.
    """

    def __init__(
        self,
        doors: Sequence[NamedDoor],
        predictor: Predictor,
        history: DoorHistory | None = None,
        *,
        asks: bool = False,
    ) -> None:
        self._tracker = DoorTracker(doors)
        self._predictor, self._history, self._asks = predictor, history, asks

    def follow(
        self, report: DoorReport, points: Points | None, camera: CameraPlace | MissingPlace
    ) -> TrackedFrame:
        """Return what a report says of the doors, and add what changed to the history.

        Args:
            report: report; its stamp is the time of the doors.
            points: points in the body frame that it was made from; None without a cloud, so that no door is seen.
            camera: pose of the camera in the map at that moment.

        Raises:
            DoorFileError: the history cannot be written any more.
        """
        prediction, stamp_s = report.prediction, report.stamp_ns / 1e9
        if points is None:
            tracked = self._tracker.miss(prediction.reason, stamp_s)
        else:
            tracked = name_doors(
                prediction,
                self._predictor,
                points,
                report.pose,
                self._tracker,
                camera,
                stamp_s,
                asks=self._asks,
            )
        if self._history is not None:
            self._history.record(tracked.events, self._tracker.last_seen, stamp_s)
        return tracked

    def drop_history(self) -> None:
        """Go on without the history, as after a disk that is full."""
        self._history = None

    def end(self) -> None:
        """Let every door count as not seen, in the history too.

        Raises:
            DoorFileError: the history cannot be written any more.
        """
        events = self._tracker.end()
        if self._history is not None:
            self._history.record(events, {})
