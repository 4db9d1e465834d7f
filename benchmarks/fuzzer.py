# SPDX-License-Identifier: Apache-2.0
"""One input after the other through every door of the package, and what became of it."""

from __future__ import annotations

import asyncio
import faulthandler
import math
import os
import resource
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from benchmarks.broken_bags import BAG_SUFFIXES, Recordings
from benchmarks.clouds import raw_cloud
from benchmarks.mutations import (
    CAMERA_SUFFIXES,
    MESSAGES,
    bomb,
    draw_camera_file,
    draw_cloud_message,
    draw_compressed_message,
    draw_file,
    draw_image_message,
    draw_number,
)
from doorstate.clouds.preparation import MIN_POINTS, is_measured
from doorstate.errors import MAX_MESSAGE_LENGTH, CameraError, CloudError, DoorstateError
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.io.bags import Bag, BagTopic, StampedCloud, open_bag
from doorstate.io.camera import Intrinsics, Pinhole, read_intrinsics
from doorstate.io.messages import CLOUD, COMPRESSED_IMAGE, IMAGE, points_from_message
from doorstate.io.readers import (
    CLOUD_SUFFIXES,
    ReadOptions,
    parse_cloud,
    points_from_depth,
    read_cloud,
)
from doorstate.io.size_limits import MAX_POINTS
from doorstate.serving.app import create_app
from doorstate.serving.work_queue import Limits
from doorstate.types import Points

LIMIT_S = 1.0  # of processor time for one input
LIMIT_MIB = 1536  # that one input may take beyond what the process had
_DEADLOCK_S = 20.0  # by the clock, however busy the machine
_BOMB_POINTS = (2**20, MAX_POINTS + 4096, 40 * 10**6)
_BOMBS = 0.002  # share of files that unpack to far more than they hold
OUTCOMES = ("answered", "no state", "refused", "crash", "hang", "memory", "answer without data")
FAILURES = OUTCOMES[3:]
BAG_FOLDER, CAMERA, NAME, SERVICE = "metadata.yaml", "camera file", "file name", "service"
TARGETS = (*CLOUD_SUFFIXES, NAME, CAMERA, *MESSAGES, *BAG_SUFFIXES, BAG_FOLDER, SERVICE)
# Of images with every so-many-th pixel of 640 x 480, 60 degrees: the scene's camera and that of recordings.
_EVERY_EIGHTH = Pinhole(69.28, 69.28, 39.94, 29.94)
_EVERY_32ND = Pinhole(17.32, 17.32, 9.98, 7.48)
_STATUSES = {200, 400, 404, 405, 413, 415, 422}  # that one client at a time may get
_COUNTED = 100_000  # points that are looked through for equal ones

Outcome = tuple[str, str]  # one of OUTCOMES, and what was wrong


class Fuzzer:
    """Everything that reads, in one process; an input is made from its number alone.

    Args:
        scratch: folder for files.
        every: which pixels of a 640 x 480 cloud inputs are made of, one in so many across and down.
    """

    def __init__(self, scratch: Path, every: int = 8) -> None:
        warnings.simplefilter("error")  # of what is no error a user sees nothing
        whole = raw_cloud()
        self.scene = np.ascontiguousarray(whole[::every, ::every])
        # These weights always give a state: one that is withheld would look like input that was not usable.
        self._predict = NetworkPredictor.from_weights("ogurob-pointnet2", num_points=MIN_POINTS, gate=None)
        self._gated = NetworkPredictor(self._predict.backend, MIN_POINTS)
        self._app = create_app(self._gated, Limits(max_bytes=2**20, queue=1, workers=1))
        self._runner = asyncio.Runner()
        self._folder = scratch / str(os.getpid())
        self._recordings = Recordings(self._folder, whole[::32, ::32])
        self._gated.warm_up()
        self._most_mib = _peak_mib() + LIMIT_MIB

    def attempt(self, number: int) -> tuple[str, str, str]:
        """Target, outcome, and what was wrong of the input with this number."""
        target, given = self.draw(number)
        return target, *self.judge(target, given, np.random.default_rng((number, 1)))

    def draw(self, number: int) -> tuple[str, Any]:
        """Target and input of a number: a message, or a suffix and what a file holds."""
        rng = np.random.default_rng(number)
        target = str(rng.choice(TARGETS))
        return target, self.draw_for(target, rng)

    def draw_for(self, target: str, rng: np.random.Generator) -> Any:
        """Input for one of TARGETS."""
        match target:
            case "PointCloud2":
                return draw_cloud_message(rng, self.scene)
            case "Image":
                return draw_image_message(rng, self.scene)
            case "CompressedImage":
                return draw_compressed_message(rng, self.scene)
        suffix = draw_suffix(target, rng)
        if target == BAG_FOLDER:
            return suffix, self._recordings.draw_metadata(rng)
        if target in BAG_SUFFIXES:
            return suffix, self._recordings.draw(rng, suffix)
        if target == CAMERA:
            return suffix, draw_camera_file(rng, suffix, self.scene)
        if rng.random() < _BOMBS:
            return suffix, bomb(suffix, int(rng.choice(_BOMB_POINTS)))
        return suffix, draw_file(rng, suffix, self.scene)

    def judge(self, target: str, given: Any, rng: np.random.Generator) -> Outcome:
        """What becomes of an input as of `draw`, with options from the generator."""
        faulthandler.dump_traceback_later(_DEADLOCK_S, exit=True)
        started = time.process_time()
        try:
            outcome, detail = self._judge(rng, target, given)
        except DoorstateError as error:
            outcome, detail = _of_error(error)
        except Exception as error:
            outcome, detail = "crash", f"{type(error).__name__}: {error}"
        finally:
            faulthandler.cancel_dump_traceback_later()
        spent_s = time.process_time() - started
        if outcome not in FAILURES and spent_s > LIMIT_S:
            outcome, detail = "hang", f"{spent_s:.1f} s of processor time"
        if outcome not in FAILURES and _peak_mib() > self._most_mib:
            outcome, detail = "memory", f"{_peak_mib() - self._most_mib + LIMIT_MIB:.0f} MiB more"
        return outcome, " ".join(detail.split())[:300]

    def _judge(self, rng: np.random.Generator, target: str, given: Any) -> Outcome:
        if target == SERVICE:
            return self._runner.run(self._post(rng, *given))
        recorded = target in BAG_SUFFIXES or target == BAG_FOLDER
        options = _draw_options(rng, _EVERY_32ND if recorded else _EVERY_EIGHTH)
        if target in MESSAGES:
            return self._of_points(points_from_message(given, f"sensor_msgs/msg/{target}", options))
        suffix, content = given
        if target == BAG_FOLDER:
            return self._of_bag(rng, self._recordings.folder_with(content), options)
        if target in BAG_SUFFIXES:
            return self._of_bag(rng, self._recordings.file_with(suffix, content), options)
        if target == CAMERA:
            return self._of_camera(suffix, content)
        if target == NAME:
            return self._of_points(self._read(rng, suffix, content, options))
        return self._of_points(parse_cloud(content, suffix, options))

    def _of_points(self, points: Points) -> Outcome:
        """With the gate and without it."""
        freely, gated = self._predict(points), self._gated(points)
        if freely.state is None:
            return ("no state", "") if gated.state is None else ("crash", "an answer with the gate alone")
        measured = points[is_measured(points)]
        if len(measured) < _COUNTED and len(np.unique(measured, axis=0)) < MIN_POINTS:
            return "answer without data", f"{freely.state!r} of {len(measured)} points"
        if not np.isfinite(list(freely.probabilities.values())).all():
            return "crash", f"probabilities {freely.probabilities}"
        return ("no state" if gated.state is None else "answered"), ""

    def _of_bag(self, rng: np.random.Generator, path: Path, options: ReadOptions) -> Outcome:
        """The worst, or else the most, that becomes of its messages."""
        found: list[Outcome] = []
        try:
            with open_bag(path) as bag:
                for stamped in bag.clouds(_draw_topic(rng, bag), options):
                    found.append(self._of_stamped(stamped))
        except DoorstateError as error:  # what came before it counts
            found.append(_of_error(error))
        order = (*FAILURES, *OUTCOMES)
        return min(found, key=lambda outcome: order.index(outcome[0]), default=("no state", ""))

    def _of_stamped(self, stamped: StampedCloud) -> Outcome:
        if not (math.isfinite(stamped.stamp_s) and isinstance(stamped.frame_id, str)):
            return "crash", f"stamp {stamped.stamp_s!r}, frame {stamped.frame_id!r}"
        try:
            if isinstance(stamped.cloud, DoorstateError):
                return _of_error(stamped.cloud)
            return self._of_points(stamped.cloud)
        except DoorstateError as error:
            return _of_error(error)

    def _of_camera(self, suffix: str, content: bytes) -> Outcome:
        """Whatever is taken for a camera must do for images of its size."""
        path = self._folder / f"camera{suffix}"
        path.write_bytes(content)
        camera = read_intrinsics(path)
        depth_m = self.scene[..., 0]
        seen = Intrinsics(depth_m.shape[1], depth_m.shape[0], camera.fx, camera.fy, camera.cx, camera.cy)
        return self._of_points(points_from_depth(depth_m, ReadOptions(intrinsics=seen)))

    def _read(self, rng: np.random.Generator, suffix: str, data: bytes, options: ReadOptions) -> Points:
        """From a file whose name may be no text."""
        stem = [b"cloud", b"\xff\xfe", "é".encode(), b"a b\tc", b"-", b"%s{}"][rng.integers(6)]
        path = self._folder / (stem.decode(errors="surrogateescape") + suffix)
        path.write_bytes(data)
        try:
            return read_cloud(path, options)
        finally:
            path.unlink()

    async def _post(self, rng: np.random.Generator, suffix: str, data: bytes) -> Outcome:
        query = {"format": suffix, "frame": "optical"} if rng.random() < 0.5 else {"filename": f"a{suffix}"}
        if rng.random() < 0.7:
            query |= {name: str(value) for name, value in _EVERY_EIGHTH._asdict().items()}
        if rng.random() < 0.3:
            values = ["", "nan", "-1", "mm", "1e999", "\x00", "\ufffd", str(draw_number(rng))]
            query[str(rng.choice(["format", "frame", "roll", "units", "depth_scale", "fx", "x"]))] = str(
                rng.choice(values)
            )
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(self._app), base_url="http://here"
        ) as client:
            response = await client.post("/predict", params=query, content=data)
        content = response.json()
        if response.status_code not in _STATUSES:
            return "crash", f"status {response.status_code}: {content}"
        if response.status_code != 200:
            return _of_line(content["error"])
        return ("no state" if content["state"] is None else "answered"), ""


def draw_suffix(target: str, rng: np.random.Generator) -> str:
    """Of the files that a target takes."""
    several = {NAME: CLOUD_SUFFIXES, SERVICE: CLOUD_SUFFIXES, CAMERA: CAMERA_SUFFIXES, BAG_FOLDER: (".yaml",)}
    return str(rng.choice(several[target])) if target in several else target


def _draw_options(rng: np.random.Generator, camera: Pinhole) -> ReadOptions:
    return ReadOptions(
        frame="optical" if rng.random() < 0.2 else "body",
        roll_deg=int(rng.choice([0, 90, 180, 270])) if rng.random() < 0.2 else 0,
        intrinsics=camera if rng.random() < 0.8 else None,
        units_m=0.001 if rng.random() < 0.1 else 1.0,
    )


def _draw_topic(rng: np.random.Generator, bag: Bag) -> BagTopic:
    """The one topic, or by its name one that could hold clouds, or any."""
    topics = [topic for topic in bag.topics if topic.type in (CLOUD, IMAGE, COMPRESSED_IMAGE)]
    if not topics or rng.random() < 0.1:
        topics = [BagTopic("/none", "", 0), *bag.topics]
    return bag.choose(None if rng.random() < 0.2 else topics[rng.integers(len(topics))].name)


def _of_error(error: DoorstateError) -> Outcome:
    if not isinstance(error, CloudError | CameraError):
        return "crash", f"{type(error).__name__}: {error}"
    return _of_line(str(error))


def _of_line(line: str) -> Outcome:
    """A refusal is one line that can be printed."""
    if len(line.splitlines()) != 1 or len(line) > MAX_MESSAGE_LENGTH:
        return "crash", f"no line: {line!r}"
    return "refused", ""


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 1024)
