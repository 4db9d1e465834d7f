# SPDX-License-Identifier: Apache-2.0
"""`view`: clouds and answers in the browser, from files or as they come in."""

from __future__ import annotations

import tempfile
import time
import webbrowser
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.bags import hint_at_frame
from doorstate.cli.options import (
    Bag,
    CameraInfoTopic,
    DepthScale,
    Focal,
    Frame,
    IntrinsicsFile,
    Network,
    PointCount,
    Roll,
    RuleName,
    Topic,
    Units,
    Weights,
    files_or_bag,
    read_options,
)
from doorstate.errors import CloudReadError, ConfigError

if TYPE_CHECKING:
    from doorstate.io.bags import BagTopic, StampedCloud
    from doorstate.io.readers import ReadOptions
    from doorstate.viewer.named_clouds import NamedCloud

_LARGE_PAGE_BYTES = 50_000_000  # browsers take seconds to open it
_RATE_HZ = 5.0  # of folders

Clouds = tuple[Iterable["NamedCloud"], int]
"""Clouds, and how many they are."""


def view(
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="Clouds, depth images, folders of them, simulated or prepared data sets."),
    ] = None,
    network: Network = None,
    weights: Weights = None,
    rule: RuleName = None,
    points: PointCount = None,
    out: Annotated[
        Path | None, typer.Option(help="Write the page to this .html file, and open no browser.")
    ] = None,
    open_browser: Annotated[
        bool, typer.Option("--open/--no-open", help="Whether to open the page in the browser.")
    ] = True,
    every: Annotated[int, typer.Option(help="Show every Nth cloud.", min=1)] = 1,
    live: Annotated[
        bool, typer.Option("--live", help="Show a bag or a folder as it comes in, until Ctrl-C.")
    ] = False,
    rate: Annotated[
        float | None,
        typer.Option(help="Live: most clouds a second; 5 of a folder, as recorded of a bag.", min=0.01),
    ] = None,
    port: Annotated[int, typer.Option(help="Live: 0 takes any that is free.", min=0, max=65535)] = 0,
    bag: Bag = None,
    topic: Topic = None,
    camera_info_topic: CameraInfoTopic = None,
    frame: Frame = "body",
    roll: Roll = 0,
    units: Units = "m",
    depth_scale: DepthScale = 0.001,
    intrinsics: IntrinsicsFile = None,
    fx: Focal = None,
    fy: Focal = None,
    cx: Focal = None,
    cy: Focal = None,
) -> None:
    """Show clouds in 3D with state, probabilities and what the network looked at, in one page of the browser.

    \b
    Examples:
      doorstate view cloud.pcd
      doorstate view --rule plane_state recordings/ --out recordings.html
      doorstate view data/ogurob-4096 --every 50
      doorstate view --bag run.bag --topic /camera/depth/points --frame optical --every 15
      doorstate view --live --bag run.bag --topic /camera/depth/points --frame optical
      doorstate view --live incoming/ --port 8080 --no-open
    """
    from doorstate._files import check_writable
    from doorstate.inference.loading import load_predictor

    files_or_bag(files, bag)
    if bag is None and (topic, camera_info_topic) != (None, None):
        raise ConfigError("--topic and --camera-info-topic are for --bag")
    if not live and (rate, port) != (None, 0):
        raise ConfigError("--rate and --port are for --live")
    if live and (out is not None or (files and (len(files) > 1 or not files[0].is_dir()))):
        raise ConfigError("--live takes one folder or a --bag, and writes no page: leave --out out")
    if out is not None and out.suffix not in (".html", ".htm"):
        raise ConfigError(f"--out {out}: name a .html file")
    if out is not None:
        check_writable(out)
    options = read_options(frame, roll, units, depth_scale, intrinsics, (fx, fy, cx, cy))
    source: AbstractContextManager[Clouds]
    if bag is not None:
        source = _bag_clouds(bag, topic, camera_info_topic, options, every, live, rate)
    elif live:
        source = nullcontext((_folder_clouds((files or [])[0], options, every, rate or _RATE_HZ), 0))
    else:
        source = nullcontext(_file_clouds(files or [], options, every))
    with source as (sightings, total):
        predictor = load_predictor(network, weights, rule, points)
        if live:
            _show_live(predictor, sightings, port, open_browser)
        else:
            _show_page(predictor, sightings, total, out, open_browser)


def _file_clouds(paths: list[Path], options: ReadOptions, every: int) -> Clouds:
    from doorstate.viewer.named_clouds import find_named_clouds

    found = find_named_clouds(paths, options)[::every]
    return (sighting() for sighting in found), len(found)


def _folder_clouds(folder: Path, options: ReadOptions, every: int, rate_hz: float) -> Iterator[NamedCloud]:
    from doorstate.viewer.named_clouds import at_rate, watch_folder

    return at_rate(islice(watch_folder(folder, options), 0, None, every), rate_hz)


@contextmanager
def _bag_clouds(
    path: Path,
    topic: str | None,
    camera_info_topic: str | None,
    options: ReadOptions,
    every: int,
    live: bool,
    rate_hz: float | None,
) -> Iterator[Clouds]:
    from doorstate.io.bags import open_bag
    from doorstate.viewer.named_clouds import as_stamped, at_rate

    with open_bag(path) as bag:
        chosen = bag.choose(topic)
        stamped = _messages(bag.clouds(chosen, options, camera_info_topic, every), chosen, options)
        unpaced = (sighting for _, sighting in stamped)
        paced = at_rate(unpaced, rate_hz) if rate_hz else as_stamped(stamped)
        yield paced if live else unpaced, -(-chosen.messages // every)


def _messages(
    clouds: Iterable[StampedCloud], topic: BagTopic, options: ReadOptions
) -> Iterator[tuple[float, NamedCloud]]:
    """Stamps and clouds; a bag that breaks off ends with the error."""
    from doorstate.viewer.named_clouds import NamedCloud

    stamp_s = 0.0
    try:
        for number, (stamp_s, frame_id, cloud) in enumerate(clouds):
            if number == 0:
                hint_at_frame(topic, options, frame_id)
            yield stamp_s, NamedCloud(f"{stamp_s:.3f} s", cloud)
    except CloudReadError as error:
        yield stamp_s, NamedCloud("end", error)


def _show_page(
    predictor: Any, sightings: Iterable[NamedCloud], total: int, out: Path | None, open_browser: bool
) -> None:
    from doorstate._files import write_text
    from doorstate.cli.console import err, progress_bar
    from doorstate.viewer.cloud_page import look, render_view

    entries = []
    with progress_bar("Looking") as progress:
        for sighting in sightings:
            entries.append(look(predictor, sighting))
            progress(len(entries), total)
    failed = [entry for entry in entries if "error" in entry]
    for entry in failed:
        message = entry["error"].removeprefix(f"{Path(entry['name']).name}: ")
        err.print(f"{entry['name']}: {message}", style="red", soft_wrap=True)
    if len(failed) < len(entries):
        page = render_view(predictor, entries)
        path = out or Path(tempfile.mkdtemp(prefix="doorstate-")) / "view.html"
        write_text(path, page)
        print(path)  # noqa: T201
        if len(page) > _LARGE_PAGE_BYTES:
            size = f"the page has {len(page) / 1e6:.0f} MB, which browsers open slowly"
            err.print(f"{size}: show fewer clouds by --every or --points", soft_wrap=True)
        if out is None and open_browser:
            _open(path.absolute().as_uri())
    if failed:
        err.print(f"{len(failed)} of {len(entries)} clouds could not be shown")
        raise typer.Exit(1)


def _show_live(predictor: Any, sightings: Iterable[NamedCloud], port: int, open_browser: bool) -> None:
    from doorstate.cli.console import err
    from doorstate.viewer.cloud_page import look, render_view
    from doorstate.viewer.live_page import LivePage

    with LivePage(render_view(predictor, [], live=True), port) as page:
        print(page.address, flush=True)  # noqa: T201
        err.print("Ctrl-C stops it")
        if open_browser:
            _open(page.address)
        try:
            for sighting in sightings:
                page.publish("cloud", look(predictor, sighting))
            page.publish("end", None)
            # Not for ever at once: where another thread is given Ctrl-C, this one learns of it when it wakes.
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            err.print("stopped")


def _open(address: str) -> None:
    from doorstate.cli.console import err

    if not webbrowser.open(address):
        err.print(f"no browser was found here: open {address} in one", soft_wrap=True)
