# SPDX-License-Identifier: Apache-2.0
"""Output of `doorstate view`: a page in a file, or a live page on this machine."""

from __future__ import annotations

import tempfile
import time
import webbrowser
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from doorstate.cli.console import stderr
from doorstate.cli.flags import format_flag
from doorstate.cli.prediction_summary import print_errors
from doorstate.cli.progress import progress_bar
from doorstate.cli.signals import accept_signal

if TYPE_CHECKING:
    from doorstate.inference.prediction import Prediction
    from doorstate.inference.predictor import Predictor
    from doorstate.mqtt.publisher import MqttPublisher
    from doorstate.viewer.cloud_page import Shown
    from doorstate.viewer.named_clouds import NamedCloud

_LARGE_PAGE_BYTES = 50_000_000  # browsers take seconds to open it


def show_page(
    predictor: Predictor,
    clouds: Iterable[NamedCloud],
    total: int,
    out: Path | None,
    open_browser: bool,
    shown: Shown,
) -> None:
    """Write a page with all clouds; exit with code 1 if a cloud could not be shown.

    Args:
        predictor: predicts each cloud.
        clouds: clouds to show.
        total: their number, for the progress bar.
        out: file to write; None writes a temporary file and opens it in the browser.
        open_browser: False only prints the path.
        shown: known door, and candidates to draw.
    """
    from doorstate._files import write_text
    from doorstate.viewer.cloud_page import make_entry, render_cloud_page

    entries = []
    errors: list[tuple[str, str]] = []
    with progress_bar("Predicting") as progress:
        for cloud in clouds:
            entry = make_entry(predictor, cloud, format_flag, shown)
            if "error" in entry:
                errors.append((entry["name"], entry["error"]))
            entries.append(entry)
            progress(len(entries), total)
    print_errors(errors, "cloud")
    if len(errors) < len(entries):
        page = render_cloud_page(predictor, entries)
        path = out or Path(tempfile.mkdtemp(prefix="doorstate-")) / "view.html"
        write_text(path, page)
        print(path)  # noqa: T201
        if len(page) > _LARGE_PAGE_BYTES:
            stderr.print(
                f"the page has {len(page) / 1e6:.0f} MB and opens slowly: use --every or fewer --points",
            )
        if out is None and open_browser:
            open_in_browser(path.absolute().as_uri())
    if errors:
        stderr.print(f"{len(errors)} of {len(entries)} clouds could not be shown")
        raise typer.Exit(1)


def show_live(
    predictor: Predictor,
    clouds: Iterable[NamedCloud],
    port: int,
    open_browser: bool,
    shown: Shown,
    publisher: MqttPublisher | None = None,
) -> None:
    """Serve a page that shows clouds as they arrive, until Ctrl-C.

    Args:
        predictor: predicts each cloud.
        clouds: clouds to show; may wait for the next one.
        port: port on this machine; 0 chooses a free one.
        open_browser: False only prints the address.
        shown: known door, and candidates to draw.
        publisher: publishes the state of the door most in front.
    """
    from doorstate.inference.state_filter import StateFilter
    from doorstate.mqtt.status import status_of_front_door
    from doorstate.viewer.cloud_page import make_entry, render_cloud_page
    from doorstate.viewer.live_page import LivePage

    state_filter = StateFilter()

    def publish(prediction: Prediction) -> None:
        if publisher is not None:
            filtered = state_filter.update(prediction, time.monotonic())
            publisher.update([status_of_front_door(prediction, filtered)])

    with LivePage(render_cloud_page(predictor, [], live=True), port) as page:
        print(page.address, flush=True)  # noqa: T201
        stderr.print("press Ctrl-C to stop")
        if open_browser:
            open_in_browser(page.address)
        try:
            for cloud in clouds:
                page.publish("cloud", make_entry(predictor, cloud, format_flag, shown, publish))
            page.publish("end", None)
            # Short sleeps: if another thread gets the signal of Ctrl-C, this one notices it only when it wakes up.
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            accept_signal()
            stderr.print("stopped")


def open_in_browser(address: str) -> None:
    """Open an address in the browser, or say that there is none."""
    if not webbrowser.open(address):
        stderr.print(f"no browser found; open {address}")
