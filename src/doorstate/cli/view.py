# SPDX-License-Identifier: Apache-2.0
"""`doorstate view`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.mqtt_options import MqttOptions, with_mqtt_options
from doorstate.cli.options import (
    Bag,
    BudgetMs,
    CameraInfoTopic,
    DoorBox,
    DoorKnownFlag,
    DoorPose,
    Every,
    NetworkNames,
    OpenBrowser,
    PointCount,
    RuleNames,
    Threads,
    Topic,
    WeightsFiles,
    check_source,
)
from doorstate.cli.reading_options import with_reading_options
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.io.options import ReadOptions
    from doorstate.viewer.named_clouds import NamedCloud

_FOLDER_RATE_HZ = 5.0

Clouds = tuple[Iterable["NamedCloud"], int]
"""Clouds and their number."""


@with_mqtt_options
@with_reading_options
def view(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Clouds, depth images, folders of them, simulated folders or prepared data sets."
        ),
    ] = None,
    network: NetworkNames = None,
    weights: WeightsFiles = None,
    rule: RuleNames = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    threads: Threads = None,
    out: Annotated[
        Path | None, typer.Option(help="Write the page to this .html file, without opening a browser.")
    ] = None,
    open_browser: OpenBrowser = True,
    every: Every = 1,
    live: Annotated[
        bool, typer.Option("--live", help="Show a bag or a folder as clouds arrive, until Ctrl-C.")
    ] = False,
    rate: Annotated[
        float | None,
        typer.Option(
            help="With --live: most clouds a second. [default: 5 for a folder, as recorded for a bag]",
            min=0.01,
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(help="With --live: port of the page; 0 chooses a free one.", min=0, max=65535)
    ] = 0,
    bag: Bag = None,
    topic: Topic = None,
    camera_info_topic: CameraInfoTopic = None,
    door_known: DoorKnownFlag = False,
    door_pose: DoorPose = None,
    door_box: DoorBox = None,
    refused: Annotated[
        bool, typer.Option("--refused", help="Draw candidate doorways that are no doors, too.")
    ] = False,
    *,
    options: ReadOptions,
    mqtt: MqttOptions,
) -> None:
    """Show clouds and predictions in the browser.

    Clouds are shown in 3D, with the points that the network used.

    \b
    Examples:
      doorstate view cloud.pcd
      doorstate view --rule plane_state recordings/ --out recordings.html
      doorstate view data/ogurob-4096 --every 50
      doorstate view --bag run.bag --topic /camera/depth/points --every 15
      doorstate view --live --bag run.bag --topic /camera/depth/points
      doorstate view --live incoming/ --port 8080 --no-open
      doorstate view --live incoming/ --no-open --mqtt mqtt://robot@broker.local --mqtt-camera hall
    """
    from doorstate._files import check_writable
    from doorstate.cli.predictors import Methods, load_predictor
    from doorstate.cli.view_output import show_live, show_page
    from doorstate.inference.known import door_known as known_door
    from doorstate.viewer.cloud_page import Shown

    check_source(files, bag)
    if bag is None and (topic, camera_info_topic) != (None, None):
        raise ConfigError("--topic and --camera-info-topic need --bag")
    shown = Shown(known_door(door_known, door_pose, door_box), refused)
    if not live and (rate, port) != (None, 0):
        raise ConfigError("--rate and --port need --live")
    if not live and mqtt.settings is not None:
        raise ConfigError("--mqtt needs --live")
    if live and (out is not None or (files and (len(files) > 1 or not files[0].is_dir()))):
        raise ConfigError("--live needs one folder or --bag, and cannot be combined with --out")
    if out is not None:
        if out.suffix not in (".html", ".htm"):
            raise ConfigError(f"--out {out}: expected a .html file")
        check_writable(out)
    source: AbstractContextManager[Clouds]
    if bag is not None:
        source = _open_bag(bag, topic, camera_info_topic, options, every, live, rate)
    elif live:
        source = nullcontext(_watch_folder((files or [])[0], options, every, rate or _FOLDER_RATE_HZ))
    else:
        source = nullcontext(_find_files(files or [], options, every))
    with source as (clouds, total):
        predictor = load_predictor(
            Methods(network, weights, rule), points, budget_ms=budget_ms, threads=threads, for_view=True
        )
        if live:
            with mqtt.open() as publisher:
                show_live(predictor, clouds, port, open_browser, shown, publisher)
        else:
            show_page(predictor, clouds, total, out, open_browser, shown)


def _find_files(paths: list[Path], options: ReadOptions, every: int) -> Clouds:
    from doorstate.viewer.named_clouds import find_named_clouds

    readers = find_named_clouds(paths, options)[::every]
    return (read() for read in readers), len(readers)


def _watch_folder(folder: Path, options: ReadOptions, every: int, rate_hz: float) -> Clouds:
    from doorstate.viewer.streams import limit_rate, watch_folder

    return limit_rate(islice(watch_folder(folder, options), 0, None, every), rate_hz), 0


@contextmanager
def _open_bag(
    path: Path,
    topic: str | None,
    camera_info_topic: str | None,
    options: ReadOptions,
    every: int,
    live: bool,
    rate_hz: float | None,
) -> Iterator[Clouds]:
    from doorstate.io.bags import open_bag
    from doorstate.viewer.streams import limit_rate, name_messages, replay_stamps

    with open_bag(path) as bag:
        chosen = bag.choose(topic)
        messages = bag.clouds(chosen, options, camera_info_topic, every)
        stamped = name_messages(messages)
        clouds: Iterator[NamedCloud] = (cloud for _, cloud in stamped)
        if live:
            clouds = limit_rate(clouds, rate_hz) if rate_hz else replay_stamps(stamped)
        yield clouds, -(-chosen.messages // every)
