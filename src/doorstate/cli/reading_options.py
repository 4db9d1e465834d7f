# SPDX-License-Identifier: Apache-2.0
"""Options of how clouds are read, which `predict`, `view`, `evaluate` and `prepare` share."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.shared_options import with_shared_options
from doorstate.errors import CameraError, ConfigError

if TYPE_CHECKING:
    from doorstate.io.options import ReadOptions

Roll = Annotated[
    float | None, typer.Option(help="Clockwise rotation of the camera, seen from behind, in degrees.")
]
Pitch = Annotated[
    float | None,
    typer.Option(
        help="Angle by which the camera looks down, in degrees. [default: 0; weights for doorways find the tilt"
        " themselves if neither is given]",
        show_default=False,
    ),
]
CameraHeight = Annotated[
    float | None, typer.Option(help="Height of the camera above the floor in metres, if it is known.")
]


def read_options(
    axes: Annotated[
        str,
        typer.Option(
            help="Directions of x, y and z in clouds: ros (flu), optical (rdf), opengl (rub), or three of the letters"
            " f b l r u d. [default: optical if the frame of a message is named so, else ros]",
            show_default=False,
        ),
    ] = "auto",
    roll: Roll = None,
    pitch: Pitch = None,
    quaternion: Annotated[
        str | None,
        typer.Option(
            help="In place of --roll and --pitch: 'x y z w' of the rotation from the frame of the points to a level"
            " frame, as tf2_echo prints."
        ),
    ] = None,
    camera_height: CameraHeight = None,
    ignore_viewpoint: Annotated[
        bool, typer.Option("--ignore-viewpoint", help="Ignore VIEWPOINT of PCD files.")
    ] = False,
    units: Annotated[str, typer.Option(help="Length unit of cloud files: m, dm, cm, mm or km.")] = "m",
    depth_scale: Annotated[float, typer.Option(help="Metres per unit of depth images.")] = 0.001,
    intrinsics: Annotated[
        Path | None,
        typer.Option(
            help="Camera of depth images: a file of ROS (camera_info), OpenCV, Kalibr, RealSense or Open3D."
        ),
    ] = None,
    rectified: Annotated[
        bool | None,
        typer.Option(
            "--rectified/--unrectified",
            help="Depth images are rectified, or show the distortion of the lens."
            " [default: by the name of the topic, else rectified if the camera has a projection matrix]",
            show_default=False,
        ),
    ] = None,
    fx: Annotated[
        float | None, typer.Option(help="Horizontal focal length in pixels, instead of --intrinsics.")
    ] = None,
    fy: Annotated[float | None, typer.Option(help="Vertical focal length in pixels.")] = None,
    cx: Annotated[float | None, typer.Option(help="Horizontal image centre in pixels.")] = None,
    cy: Annotated[float | None, typer.Option(help="Vertical image centre in pixels.")] = None,
) -> ReadOptions:
    """Return the reading options that a user typed.

    Raises:
        ConfigError: an option has no such value, or options exclude each other.
    """
    from doorstate.io.camera import pinhole_from_numbers
    from doorstate.io.camera_files import read_intrinsics
    from doorstate.io.options import ReadOptions, metres_per_unit
    from doorstate.io.rotations import parse_quaternion

    camera = None if intrinsics is None else read_intrinsics(intrinsics, rectified)
    try:
        pinhole = pinhole_from_numbers(fx, fy, cx, cy)
        if camera is not None and pinhole is not None:
            raise ConfigError("give either --intrinsics or --fx --fy --cx --cy")
        return ReadOptions(
            axes=axes,
            roll_deg=roll,
            pitch_deg=pitch,
            quaternion=None if quaternion is None else parse_quaternion(quaternion),
            camera_height_m=camera_height,
            ignore_viewpoint=ignore_viewpoint,
            intrinsics=camera or pinhole,
            rectified=rectified,
            depth_scale_m=depth_scale,
            units_m=metres_per_unit(units),
        )
    except CameraError as error:  # typed values are usage errors, unlike those of a camera file
        raise ConfigError(error.message, field=error.field, expected=error.expected) from error


with_reading_options = with_shared_options(read_options, "options")


def check_layout(layout: str | None, options: ReadOptions) -> None:
    """Check that axes, tilt, units and depth scale are left to the layout of a published data set.

    Raises:
        ConfigError: one of them was given too.
    """
    from doorstate.io.options import DEFAULT_OPTIONS

    if (
        layout is not None
        and replace(options, intrinsics=None, rectified=None, camera_height_m=None) != DEFAULT_OPTIONS
    ):
        raise ConfigError("--layout has its own axes, units and depth scale: give only the camera")
