# SPDX-License-Identifier: Apache-2.0
"""Options of doors with names: their list, the poses of the camera, and the history."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.shared_options import with_shared_options
from doorstate.errors import ConfigError, DoorFileError

if TYPE_CHECKING:
    from doorstate.doors.camera_place import CameraPlace, MissingPlace
    from doorstate.doors.history import DoorHistory
    from doorstate.doors.live_doors import LiveDoors
    from doorstate.doors.named_predictor import NamedPrediction
    from doorstate.doors.pose_file import PoseFile
    from doorstate.doors.pose_stream import PoseStream
    from doorstate.doors.tracker import DoorTracker
    from doorstate.inference.predictor import Predictor
    from doorstate.io.sensor_pose import PosedCloud

DoorsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="List of doors with names (doors.yaml): tell their states by name; needs poses.",
    ),
]
_POSES = (
    "Poses of the camera in the map: a table with time or file, x, y, yaw (or x, y, z, qx, qy, qz, qw), or"
    " lines of a TUM trajectory."
)
PosesOption = Annotated[Path | None, typer.Option(metavar="FILE", help=_POSES)]
PoseStreamOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help=_POSES + " They are read as they come, from a pipe or a file that grows; - is standard input.",
    ),
]
CameraPose = Annotated[
    str | None,
    typer.Option(
        metavar="POSE",
        help="In place of --poses: 'x y yaw' of a camera that stands still, in metres and degrees in the map.",
    ),
]
PoseError = Annotated[
    str | None,
    typer.Option(
        metavar="ERROR",
        help="Standard error of these poses: 'metres degrees'. [default: 0.1 3]",
        show_default=False,
    ),
]
PoseAxes = Annotated[
    str,
    typer.Option(
        help="Directions of x, y and z of the camera in poses with a quaternion: ros, optical, opengl."
    ),
]
MapFrame = Annotated[str, typer.Option(help="Frame of poses that name none, as in the list of doors.")]
HistoryOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Add changes of these doors to this SQLite file.")
]
HistoryDays = Annotated[
    float, typer.Option(help="Days of changes that the history keeps, back from its newest.", min=0.01)
]
AskDoors = Annotated[
    bool,
    typer.Option(
        "--ask-doors", help="Ask for doors of the list that are in view and were not found: slower."
    ),
]


@dataclass(frozen=True)
class CameraPoses:
    """Poses of the camera that a user gave."""

    file: PoseFile | None = None
    place: CameraPlace | None = None  # of a camera that stands still
    stream: PoseStream | None = None  # of a camera that is watched

    def of_file(self, path: Path) -> tuple[float | None, CameraPlace | MissingPlace]:
        """Return time, if it is known, and pose of the camera of a file."""
        if self.place is not None:
            return None, self.place
        assert self.file is not None
        return self.file.of_file(path)

    def at(self, stamp_s: float) -> CameraPlace | MissingPlace:
        """Return the pose of the camera at a time."""
        if self.place is not None:
            return self.place
        known = self.file or self.stream
        assert known is not None
        return known.at(stamp_s)


def parse_pose_error(text: str | None) -> tuple[float, float]:
    """Return the standard errors of poses, in metres and degrees; None is the default.

    Raises:
        ConfigError: not two numbers.
    """
    from doorstate.doors.camera_place import POSITION_ERROR_M, YAW_ERROR_DEG

    if text is None:
        return POSITION_ERROR_M, YAW_ERROR_DEG
    try:
        error_m, error_deg = (float(part) for part in text.replace(",", " ").split())
        if not (0 <= error_m < 100 and 0 <= error_deg < 180):
            raise ValueError
    except ValueError as error:
        raise ConfigError(f"--pose-error {text!r}: expected two numbers: metres degrees") from error
    return error_m, error_deg


def read_camera_poses(
    poses: Path | None,
    camera_pose: str | None,
    pose_error: str | None,
    pose_axes: str,
    map_frame: str,
    *,
    live: bool = False,
) -> CameraPoses | None:
    """Return the poses of the camera; None if none are given. Live ones are read once the stream is entered.

    Raises:
        ConfigError: an option has no such value, or options exclude each other.
        DoorFileError: the file cannot be used.
    """
    from doorstate.doors.pose_file import DEFAULTS, parse_place, read_poses
    from doorstate.doors.pose_stream import PoseStream

    if poses is not None and camera_pose is not None:
        raise ConfigError("give either --poses or --camera-pose")
    if poses is None and camera_pose is None:
        return None
    defaults = DEFAULTS._replace(frame=map_frame, axes=pose_axes)
    error_m, error_deg = parse_pose_error(pose_error)
    defaults = defaults._replace(position_error_m=error_m, yaw_error_deg=error_deg)
    try:
        if camera_pose is not None:
            return CameraPoses(place=parse_place(camera_pose, defaults))
        assert poses is not None
        if live:
            return CameraPoses(stream=PoseStream(poses, defaults))
        return CameraPoses(read_poses(poses, defaults))
    except DoorFileError as error:
        if error.path is not None:
            raise
        field_name = "camera_pose" if camera_pose is not None else "pose_axes"
        raise ConfigError(error.message, field=field_name, expected=error.expected) from error


@dataclass
class NamedDoors:
    """Doors of a list that are followed through the clouds of one command."""

    tracker: DoorTracker
    poses: CameraPoses
    asks: bool
    new_tracker: Callable[[], DoorTracker]
    history: DoorHistory | None = field(default=None)

    def predict(
        self,
        predictor: Predictor,
        cloud: PosedCloud,
        frame: str,
        stamp_s: float | None,
        place: CameraPlace | MissingPlace,
    ) -> NamedPrediction:
        """Predict a cloud, and add what changed to the history; a cloud without a time stands alone.

        Raises:
            DoorFileError: the history needs a time, or cannot be written any more.
            DoorstateError: the cloud cannot be used.
        """
        from doorstate.doors.named_predictor import predict_named

        if stamp_s is None and self.history is not None:
            raise DoorFileError("this cloud has no time for the history", field="time")
        tracker = self.new_tracker() if stamp_s is None else self.tracker
        found = predict_named(
            predictor, cloud.points, cloud.pose, tracker, place, stamp_s or 0.0, frame=frame, asks=self.asks
        )
        if self.history is not None:
            self.history.record(found.tracked.events, tracker.last_seen, stamp_s)
        return found


@dataclass(frozen=True)
class NamedOptions:
    """What a user says of doors with names; `doors` is None without a list."""

    doors: Path | None
    poses: CameraPoses | None
    history: Path | None
    history_days: float
    asks: bool

    @contextmanager
    def open(self) -> Iterator[NamedDoors | None]:
        """Yield the doors to follow; None without a list. The history ends with all doors not seen."""
        if self.doors is None:
            yield None
            return
        from doorstate.doors.door_file import read_doors
        from doorstate.doors.tracker import DoorTracker

        list_ = read_doors(self.doors).doors
        assert self.poses is not None
        named = NamedDoors(DoorTracker(list_), self.poses, self.asks, lambda: DoorTracker(list_))
        with self._open_history() as named.history:
            try:
                yield named
            finally:
                if named.history is not None:
                    named.history.record(named.tracker.end(), {})

    @contextmanager
    def open_live(self, predictor: Predictor) -> Iterator[LiveDoors | None]:
        """Yield the same for the reports of a live camera, whose poses are read meanwhile."""
        if self.doors is None:
            yield None
            return
        from doorstate.doors.door_file import read_doors
        from doorstate.doors.live_doors import LiveDoors

        list_ = read_doors(self.doors).doors
        assert self.poses is not None
        with self.poses.stream or nullcontext(), self._open_history() as history:
            live = LiveDoors(list_, predictor, history, asks=self.asks)
            try:
                yield live
            finally:
                live.end()

    def _open_history(self) -> AbstractContextManager[DoorHistory | None]:
        from doorstate.doors.history import DoorHistory

        return nullcontext() if self.history is None else DoorHistory(self.history, self.history_days)


def read_named_options(
    doors: DoorsOption = None,
    poses: PosesOption = None,
    camera_pose: CameraPose = None,
    pose_error: PoseError = None,
    pose_axes: PoseAxes = "ros",
    map_frame: MapFrame = "map",
    history: HistoryOption = None,
    history_days: HistoryDays = 365.0,
    ask_doors: AskDoors = False,
) -> NamedOptions:
    """Return the options of doors with names that a user typed.

    Raises:
        ConfigError: an option has no such value, or options exclude each other.
        DoorFileError: poses cannot be read.
    """
    known = read_camera_poses(poses, camera_pose, pose_error, pose_axes, map_frame)
    return _named_options(doors, known, history, history_days, ask_doors)


def read_live_named_options(
    doors: DoorsOption = None,
    poses: PoseStreamOption = None,
    camera_pose: CameraPose = None,
    pose_error: PoseError = None,
    pose_axes: PoseAxes = "ros",
    map_frame: MapFrame = "map",
    history: HistoryOption = None,
    history_days: HistoryDays = 365.0,
    ask_doors: AskDoors = False,
) -> NamedOptions:
    """Return the same for a live camera, whose poses come while it is watched; errors are the same."""
    known = read_camera_poses(poses, camera_pose, pose_error, pose_axes, map_frame, live=True)
    return _named_options(doors, known, history, history_days, ask_doors)


def _named_options(
    doors: Path | None, poses: CameraPoses | None, history: Path | None, history_days: float, asks: bool
) -> NamedOptions:
    if doors is None and (poses is not None or history is not None or asks):
        raise ConfigError("--poses, --camera-pose, --history and --ask-doors need --doors")
    if doors is not None and poses is None:
        raise ConfigError("--doors needs --poses or --camera-pose")
    return NamedOptions(doors, poses, history, history_days, asks)


with_named_options = with_shared_options(read_named_options, "named")
with_live_named_options = with_shared_options(read_live_named_options, "named")
