# SPDX-License-Identifier: Apache-2.0
"""`doorstate label`."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.options import CameraInfoTopic, Every, OpenBrowser, Topic
from doorstate.cli.reading_options import with_reading_options
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.io.options import ReadOptions
    from doorstate.viewer.frame_sources import FrameSource
    from doorstate.viewer.label_session import LabelSession


@with_reading_options
def label(
    recording: Annotated[
        Path,
        typer.Argument(
            help="Folder of clouds or depth images, or a bag: .bag, .db3, .mcap or a ROS 2 bag folder."
        ),
    ],
    topic: Topic = None,
    camera_info_topic: CameraInfoTopic = None,
    every: Every = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            help="With a bag: folder for index.csv and the labelled frames. [default: NAME-labels beside the bag]"
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="Port of the page; 0 chooses a free one.", min=0, max=65535)] = 0,
    open_browser: OpenBrowser = True,
    *,
    options: ReadOptions,
) -> None:
    """Label the doors of a recording in the browser.

    The page shows each frame with the doorways that were found, and takes one key for each: closed, semi-open, open, no
    door, or cannot tell. Doorways can be dragged, drawn and named. While nothing moves, the labels of the frame before
    are proposed. Each key writes index.csv, which evaluate reads; the next call goes on after the last label. The page
    is served to this machine only, until Ctrl-C.

    \b
    Examples:
      doorstate label recordings/
      doorstate label depth/ --intrinsics camera.yaml --every 5
      doorstate label run.bag --topic /camera/depth/image_raw --every 15
      doorstate label recordings/ --port 8000 --no-open
    """
    from doorstate._files import check_writable
    from doorstate._locks import owned_folder
    from doorstate.io.find import INDEX_FILE

    is_folder = recording.is_dir() and not (recording / "metadata.yaml").is_file()
    if is_folder and (topic, camera_info_topic, out) != (None, None, None):
        raise ConfigError("--topic, --camera-info-topic and --out need a bag")
    folder = recording if is_folder else out or recording.with_name(f"{recording.stem}-labels")
    check_writable(folder / INDEX_FILE)

    def open_session() -> tuple[LabelSession, FrameSource]:
        from doorstate.cli.flags import format_flag
        from doorstate.dataset.frame_labels import LabelIndex
        from doorstate.viewer.frame_sources import BagFrames, FolderFrames
        from doorstate.viewer.label_session import LabelSession

        source: FrameSource
        if is_folder:
            source = FolderFrames(folder, options, every)
        else:
            source = BagFrames(recording, folder, options, topic, camera_info_topic, every)
        names = source.names if is_folder else ()
        return LabelSession(source, LabelIndex(folder, names), format_flag), source

    with owned_folder(folder), ThreadPoolExecutor(1, "label") as worker:
        # One thread reads: SQLite, in which ROS 2 keeps bags, gives a file to the thread that opened it.
        session, source = worker.submit(open_session).result()
        try:
            _serve(session, worker, source, port, open_browser, recording.resolve().name)
        finally:
            worker.submit(source.close)
    _print_summary(session, folder)


def _serve(
    session: LabelSession,
    worker: ThreadPoolExecutor,
    source: FrameSource,
    port: int,
    open_browser: bool,
    title: str,
) -> None:
    """Serve the page until Ctrl-C."""
    from doorstate.cli.console import stderr
    from doorstate.cli.flags import format_flag
    from doorstate.cli.progress import working
    from doorstate.cli.signals import accept_signal
    from doorstate.cli.view_output import open_in_browser
    from doorstate.viewer.label_page import LabelPage

    start = worker.submit(session.start).result()
    if start > 0:
        with working(f"Going to frame {start + 1} of {len(source.names)}"):
            worker.submit(session.show, start).result()
    page = LabelPage(session, worker, len(source.names), start, title, port, format_flag)
    with page:
        print(page.address, flush=True)  # noqa: T201
        stderr.print("press Ctrl-C to end; every label is saved at once")
        if open_browser:
            open_in_browser(page.address)
        try:
            # Short sleeps: if another thread gets the signal of Ctrl-C, this one notices it only when it wakes up.
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            accept_signal()


def _print_summary(session: LabelSession, folder: Path) -> None:
    from doorstate.cli.console import stderr

    counts = session.counts()
    if not counts:
        stderr.print("no frame is labelled")
        return
    states = ", ".join(f"{count} {state.replace('_', '-')}" for state, count in counts.items())
    stderr.print(f"{session.labelled} frames are labelled: {states}")
    stderr.print(f"next: doorstate evaluate {folder}")
