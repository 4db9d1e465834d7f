# SPDX-License-Identifier: Apache-2.0
"""`doorstate doors list` and `doorstate doors check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.named_options import (
    CameraPose,
    MapFrame,
    PoseAxes,
    PoseError,
    PosesOption,
    parse_pose_error,
    read_camera_poses,
)
from doorstate.cli.options import AsJson

ListFile = Annotated[Path, typer.Argument(help="List of doors, such as doors.yaml.", show_default=False)]


def show(file: ListFile, as_json: AsJson = False) -> None:
    """List the doors of a file.

    \b
    Examples:
      doorstate doors list doors.yaml
      doorstate doors list doors.yaml --json
    """
    from doorstate.cli.console import print_json, print_table
    from doorstate.doors.door_file import read_doors

    doors = read_doors(file).doors
    if as_json:
        for door in doors:
            print_json(door.model_dump(mode="json", exclude_none=True))
        return
    rows = [
        [
            door.id,
            door.frame,
            *(f"{value:.2f}" for value in (door.pose.x_m, door.pose.y_m)),
            f"{door.pose.yaw_deg:.0f}",
            f"{door.width_m:.2f}",
            *(value or "-" for value in (door.hinge, door.swing, door.kind)),
        ]
        for door in doors
    ]
    columns = ["id", "frame", "x, m", "y, m", "yaw, deg", "width, m", "hinge", "swing", "kind"]
    print_table("", columns, rows)


def check(
    file: ListFile,
    poses: PosesOption = None,
    camera_pose: CameraPose = None,
    pose_error: PoseError = None,
    pose_axes: PoseAxes = "ros",
    map_frame: MapFrame = "map",
) -> None:
    """Check a list of doors, and poses of a camera if they are given.

    Every problem is a line with its place in the file. Doors that one camera with such errors may take for each other
    are named; they are told apart only where both are in view, and else have no state.

    \b
    Examples:
      doorstate doors check doors.yaml
      doorstate doors check doors.yaml --poses poses.csv --pose-error '0.3 5'
    """
    from doorstate._input import MAX_SETTINGS_BYTES, read_input_text
    from doorstate.cli.console import stderr, stdout
    from doorstate.cli.prediction_summary import count
    from doorstate.doors.door_file import check_doors
    from doorstate.doors.neighbours import alike_doors
    from doorstate.errors import DoorFileError

    doors, problems = check_doors(read_input_text(file, MAX_SETTINGS_BYTES, DoorFileError))
    for problem in problems:
        stderr.print(f"{file}: {problem}", style="red")
    if problems or doors is None:
        raise typer.Exit(1)
    error_m, error_deg = parse_pose_error(pose_error)
    known = read_camera_poses(poses, camera_pose, pose_error, pose_axes, map_frame)
    frames = sorted({door.frame for door in doors.doors})
    stdout.print(f"{count(len(doors.doors), 'door')} in {', '.join(frames) or 'no map'}")
    if known is not None and known.file is not None:
        places = [
            *known.file.places,
            *(place for stamp_s, place in known.file.by_file.values() if stamp_s is None),
        ]
        stdout.print(
            f"{count(len(places), 'pose')} in {', '.join(sorted({place.frame for place in places}))}"
        )
        error_m = max((place.position_error_m for place in places), default=error_m)
        error_deg = max((place.yaw_error_deg for place in places), default=error_deg)
    for first, second in alike_doors(doors.doors, error_m, error_deg):
        stdout.print(
            f"{first.id} and {second.id} may not be told apart with errors of {error_m:g} m and {error_deg:g} degrees",
            style="yellow",
        )
