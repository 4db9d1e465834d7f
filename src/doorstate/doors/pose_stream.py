# SPDX-License-Identifier: Apache-2.0
"""Poses of a camera that come while it moves: lines of a pipe, or of a file to which they are appended."""

from __future__ import annotations

import os
import stat
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import TracebackType
from typing import Self, TextIO

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.pose_file import DEFAULTS, PoseDefaults, PoseFile, PoseReader
from doorstate.errors import DoorFileError

STANDARD_INPUT = Path("-")
MAX_AGE_S = 0.5  # of the newest pose; chosen: a robot drives a quarter of a metre in it
_KEPT = 512  # poses; ten seconds at 50 Hz
_WAIT_S = 0.02
_MAX_LINE = 4096


class PoseStream:
    """Newest poses of a stream in the formats of `pose_file`, as a context manager with a thread that reads.

    Times are seconds since 1970 on the clock of this machine, as those of images are. A line that is no pose is
    skipped, and told until a good one follows. Poses of before a clock that is set back are forgotten.

    Args:
        path: pipe, or file that grows; `-` is standard input.
        defaults: errors, frame and axes of poses without their own.

    Raises:
        DoorFileError: there are no such axes; on entering, the file cannot be opened.
    """

    def __init__(self, path: Path, defaults: PoseDefaults = DEFAULTS) -> None:
        self._path = path
        self._reader = PoseReader(path, defaults)
        self._poses: deque[tuple[float, CameraPlace]] = deque(maxlen=_KEPT)
        self._problem = "no pose has come yet"
        self._lock, self._stopping = threading.Lock(), threading.Event()
        # A pipe that sends nothing keeps the thread, which the interpreter does not wait for.
        self._thread = threading.Thread(target=self._run, name="doorstate-poses", daemon=True)

    def __enter__(self) -> Self:
        if self._path != STANDARD_INPUT and not self._path.exists():
            raise DoorFileError("there is no such file", path=self._path)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()
        self._thread.join(0.2)

    def at(self, stamp_s: float) -> CameraPlace | MissingPlace:
        """Return the pose at a moment: between two poses, or the newest one if it is younger than `MAX_AGE_S`."""
        with self._lock:
            poses, problem = tuple(self._poses), self._problem
        if not poses or problem:
            return MissingPlace(problem)
        newest_s, newest = poses[-1]
        if stamp_s <= newest_s:
            stamps, places = zip(*poses, strict=True)
            return PoseFile(stamps, places).at(stamp_s)
        if stamp_s - newest_s <= MAX_AGE_S:
            return newest
        return MissingPlace(f"the newest pose is {stamp_s - newest_s:.1f} s old")

    def add(self, line: str, number: int) -> None:
        """Add a line of the stream."""
        try:
            pose = self._reader.read(line, number)
        except DoorFileError as error:
            with self._lock:
                self._problem = error.message
            return
        if pose is None or pose.stamp_s is None:
            return
        with self._lock:
            if self._poses and pose.stamp_s < self._poses[-1][0]:
                self._poses.clear()
            self._poses.append((pose.stamp_s, pose.place))
            self._problem = ""

    def _run(self) -> None:
        try:
            for number, line in enumerate(self._lines(), 1):
                self.add(line, number)
        except (OSError, UnicodeDecodeError) as error:
            with self._lock:
                self._problem = f"the poses cannot be read: {error}"

    def _lines(self) -> Iterator[str]:
        """Yield whole lines until the pipe ends; a file has no end."""
        is_input = self._path == STANDARD_INPUT
        with nullcontext(sys.stdin) if is_input else self._path.open(encoding="utf-8") as stream:
            grows = _is_file(stream)
            part = ""
            while not self._stopping.is_set():
                text = stream.readline(_MAX_LINE)
                part += text
                if part.endswith("\n") or len(part) >= _MAX_LINE:
                    yield part
                    part = ""
                elif not text:
                    if not grows:
                        return
                    self._stopping.wait(_WAIT_S)


def _is_file(stream: TextIO) -> bool:
    try:
        return stat.S_ISREG(os.fstat(stream.fileno()).st_mode)
    except OSError:  # a stream of a test has no number
        return False
