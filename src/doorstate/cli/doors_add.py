# SPDX-License-Identifier: Apache-2.0
"""`doorstate doors add`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.flags import format_flag
from doorstate.cli.named_options import (
    CameraPose,
    CameraPoses,
    MapFrame,
    PoseAxes,
    PoseError,
    PosesOption,
    read_camera_poses,
)
from doorstate.cli.options import (
    Bag,
    CameraInfoTopic,
    Every,
    NetworkNames,
    Threads,
    Topic,
    WeightsFiles,
    check_source,
)
from doorstate.cli.reading_options import with_reading_options
from doorstate.errors import CloudReadError, ConfigError, DoorstateError

if TYPE_CHECKING:
    from doorstate.doors.camera_place import CameraPlace, MissingPlace
    from doorstate.io.options import ReadOptions
    from doorstate.io.sensor_pose import PosedCloud

Placed = tuple[str, "PosedCloud | DoorstateError", "CameraPlace | MissingPlace"]
"""Name of a cloud, the cloud, and the pose of its camera."""


@with_reading_options
def add(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Clouds, depth images, or folders of them.")
    ] = None,
    doors: Annotated[
        Path,
        typer.Option(metavar="FILE", help="List to make, or to add doors to; its lines stay as they are."),
    ] = Path("doors.yaml"),
    poses: PosesOption = None,
    camera_pose: CameraPose = None,
    pose_error: PoseError = None,
    pose_axes: PoseAxes = "ros",
    map_frame: MapFrame = "map",
    name: Annotated[
        str, typer.Option(help="Beginning of the names of new doors, which are numbered.")
    ] = "door",
    min_views: Annotated[
        int | None,
        typer.Option(
            help="Clouds that must show a new door. [default: 3, or as many as there are]",
            min=1,
            show_default=False,
        ),
    ] = None,
    network: NetworkNames = None,
    weights: WeightsFiles = None,
    threads: Threads = None,
    bag: Bag = None,
    topic: Topic = None,
    camera_info_topic: CameraInfoTopic = None,
    every: Every = 1,
    *,
    options: ReadOptions,
) -> None:
    """Add the doors in clouds to a list.

    Doors that the list has are left out. Names, hinges, swings and kinds are for you to correct in the file.

    \b
    Examples:
      doorstate doors add cloud.pcd --camera-pose '0 0 0'
      doorstate doors add --bag run.bag --poses poses.csv --doors doors.yaml --every 5
    """
    from doorstate.cli.console import stderr, stdout
    from doorstate.cli.prediction_summary import count, print_errors
    from doorstate.cli.predictors import Methods, load_predictor
    from doorstate.doors.camera_place import MissingPlace
    from doorstate.doors.door_file import add_doors, read_doors
    from doorstate.doors.survey import map_doors, survey_doors
    from doorstate.inference.posed import predict_posed

    check_source(files, bag)
    known = read_camera_poses(poses, camera_pose, pose_error, pose_axes, map_frame)
    if known is None:
        raise ConfigError("doors need a place in the map: give --poses or --camera-pose")
    before = read_doors(doors).doors if doors.exists() else ()
    errors: list[tuple[str, str]] = []
    seen = []
    clouds = 0
    with ExitStack() as stack:
        placed: Iterable[Placed]
        if bag is None:
            placed = _of_files(files or [], every, options, known)
        else:
            placed = _of_bag(stack, bag, topic, camera_info_topic, every, options, known)
        predictor = load_predictor(Methods(network, weights), threads=threads)
        for frame, cloud, place in placed:
            clouds += 1
            try:
                if isinstance(cloud, DoorstateError):
                    raise cloud
                if isinstance(place, MissingPlace):
                    errors.append((frame, place.reason))
                    continue
                seen += map_doors(predict_posed(predictor, *cloud).doors, place)
            except DoorstateError as error:
                errors.append((frame, error.describe(format_flag, with_path=False)))
    print_errors(errors, "cloud")
    used = clouds - len(errors)
    new = survey_doors(seen, before, min_views or min(3, max(1, used)), name)
    add_doors(doors, new)
    for door in new:
        x_m, y_m, yaw_deg = door.place
        stdout.print(f"{door.id}: {x_m:.2f} {y_m:.2f} m, {yaw_deg:.0f} degrees, {door.width_m:.2f} m wide")
    stdout.print(f"{count(len(new), 'door')} added to {doors}, which has {len(before) + len(new)}")
    if used == 0:
        stderr.print("no cloud could be used")
        raise typer.Exit(1)


def _of_files(paths: list[Path], every: int, options: ReadOptions, poses: CameraPoses) -> Iterable[Placed]:
    from doorstate.dataset.frame_index import IndexedOptions
    from doorstate.io.find import find_clouds
    from doorstate.io.readers import read_posed_cloud

    found = find_clouds(paths)[::every]
    indexed = IndexedOptions(options)

    def read(path: Path) -> Placed:
        _, place = poses.of_file(path)
        try:
            return str(path), read_posed_cloud(path, indexed.of(path)), place
        except DoorstateError as error:
            return str(path), error, place

    return map(read, found)


def _of_bag(
    stack: ExitStack,
    path: Path,
    topic: str | None,
    camera_info_topic: str | None,
    every: int,
    options: ReadOptions,
    poses: CameraPoses,
) -> Iterator[Placed]:
    from doorstate.io.bags import open_bag
    from doorstate.io.sensor_pose import PosedCloud

    bag = stack.enter_context(open_bag(path))
    chosen = bag.choose(topic)

    def read() -> Iterator[Placed]:
        try:
            for stamp_s, _, cloud, pose in bag.clouds(chosen, options, camera_info_topic, every):
                frame, place = f"{stamp_s:.6f}", poses.at(stamp_s)
                if isinstance(cloud, DoorstateError):
                    yield frame, cloud, place
                elif pose is not None:
                    yield frame, PosedCloud(cloud, pose), place
        except CloudReadError as error:
            yield "end", error, poses.at(0.0)

    return read()
