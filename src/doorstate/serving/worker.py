# SPDX-License-Identifier: Apache-2.0
"""Process that reads files and predicts; it is killed when it takes too long."""

from __future__ import annotations

import logging
import logging.config
import math
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, NamedTuple

from fastapi import HTTPException

from doorstate._jobs import interrupts_blocked
from doorstate.errors import CloudContentError, DoorstateError, WeightsError
from doorstate.inference.known import DoorKnown
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.posed import predict_posed
from doorstate.inference.predictor import Predictor
from doorstate.inference.serialization import prediction_to_dict, require_points
from doorstate.io.options import ReadOptions
from doorstate.io.readers import parse_posed_cloud
from doorstate.serving.body import read_body
from doorstate.serving.limits import Limits
from doorstate.serving.logs import log_config
from doorstate.serving.request import format_parameter

START_TIMEOUT_S = 60.0
LOW_PRIORITY = 19
_CPUCLOCK_SCHED = 2
_LEAST_WAIT_S = 0.02
_LOG = logging.getLogger("doorstate.serving")

LoadPredictor = Callable[[], Predictor]
"""Function that loads the predictor of a worker; it is sent to the process, so it must be picklable."""


class Job(NamedTuple):
    """File to predict."""

    content: bytes  # body of the request
    headers: Mapping[str, str]  # those of `BODY_HEADERS`
    suffix: str | None  # format; None finds it out
    options: ReadOptions
    door_known: DoorKnown = False


class Reply(NamedTuple):
    """HTTP status, and the prediction or the reason of an error."""

    status: int
    body: dict[str, Any]
    fault: str = ""  # of the worker or its network, whatever the file


class Done(NamedTuple):
    """Reply of a worker, and the processor time that the file took."""

    reply: Reply
    seconds: float


class Method(NamedTuple):
    """Network or rule of a worker, to be named by the service."""

    description: str
    network: str | None = None
    points: int | None = None
    rule: str | None = None


def error_reply(status: int, message: str) -> Reply:
    """Return the reply of a job that failed."""
    return Reply(status, {"error": message})


class Worker:
    """One process at a time, started when it is first needed, and again after it was killed.

    Only one thread may use a worker at a time.

    Args:
        load: loads the predictor.
        limits: sizes and memory of files.
        niceness: priority of the process, 0 as the service, 19 the lowest.
    """

    def __init__(self, load: LoadPredictor, limits: Limits, niceness: int = 0) -> None:
        self._arguments = (load, limits, niceness)
        self._lock = threading.Lock()  # between a start and `close`
        self._closed = False
        self._process: SpawnProcess | None = None
        self._ready: Method | None = None

    def start(self) -> None:
        """Start the process, unless it runs; `run` starts it as well."""
        with self._lock:
            if self._process is None and not self._closed:
                self._start()

    def wait_until_ready(self) -> Method:
        """Return the network or rule, once the process has loaded it.

        Raises:
            DoorstateError: the predictor cannot be loaded, or the process ended.
        """
        self.start()
        if self._ready is None:
            if not self._connection.poll(START_TIMEOUT_S):
                raise DoorstateError("a worker did not start in time")
            try:
                message: Method | DoorstateError = self._connection.recv()
            except (EOFError, OSError) as error:
                raise DoorstateError("a worker process ended while it started") from error
            if isinstance(message, DoorstateError):
                raise message
            self._ready = message
        return self._ready

    def run(self, job: Job, timeout_s: float, cpu_s: float = math.inf) -> Done:
        """Predict a file; a process that fails or takes too long is replaced by a new one.

        Args:
            job: file to predict.
            timeout_s: longest time, without the start of a new process.
            cpu_s: longest processor time, so that a busy machine makes no file a slow one.
        """
        seconds = 0.0
        try:
            self.wait_until_ready()
            started_s, deadline = self._cpu_s(), time.monotonic() + timeout_s
            self._connection.send(job[1:])
            self._connection.send_bytes(job.content)
            has_reply = self._wait_for_reply(deadline, started_s + cpu_s)
            seconds = self._cpu_s() - started_s
            if has_reply:
                reply: Reply = self._connection.recv()
                return Done(reply, seconds)
            problem = error_reply(504, f"the file took more than {min(timeout_s, cpu_s):g} s to process")
        except (EOFError, OSError):
            problem = error_reply(500, "the worker process ended while it processed the file")
        except DoorstateError as error:
            problem = error_reply(503, str(error))._replace(fault=str(error))
        self._restart()
        return Done(problem, seconds)

    def _wait_for_reply(self, deadline: float, cpu_deadline_s: float) -> bool:
        """Return True when there is a reply, False after a deadline in time or in processor time of the process."""
        while (left_s := min(deadline - time.monotonic(), cpu_deadline_s - self._cpu_s())) > 0:
            if self._connection.poll(max(left_s, _LEAST_WAIT_S)):
                return True
        return self._connection.poll(0)

    def _cpu_s(self) -> float:
        """Return the processor time of the process (clock_getcpuclockid(3)); other systems than Linux give the time."""
        if sys.platform == "linux" and self._process is not None and self._process.pid is not None:
            return time.clock_gettime(~self._process.pid << 3 | _CPUCLOCK_SCHED)
        return time.monotonic()

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._closed = True
            self._kill()

    def _restart(self) -> None:
        with self._lock:
            self._kill()
            if not self._closed:
                self._start()

    def _kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._connection.close()
            self._process = None

    def _start(self) -> None:
        # spawn: a forked child of a process with threads can hang.
        context = multiprocessing.get_context("spawn")
        self._connection, child = context.Pipe()
        self._process = context.Process(
            target=_serve_jobs, args=(child, *self._arguments), name="doorstate-worker", daemon=True
        )
        with interrupts_blocked():
            self._process.start()
        child.close()
        self._ready = None


def _serve_jobs(connection: Connection, load: LoadPredictor, limits: Limits, niceness: int) -> None:
    """Reply to jobs until the connection is closed; runs in the process of a worker."""
    for number in (signal.SIGINT, signal.SIGTERM):  # the service handles them, and then ends its workers
        signal.signal(number, signal.SIG_IGN)
    if niceness:
        os.nice(niceness)
    logging.config.dictConfig(log_config(verbose=False))
    try:
        predictor = load()
        predictor.warm_up()
    except DoorstateError as error:
        connection.send(error)
        return
    if limits.memory_bytes is not None:
        _limit_memory(limits.memory_bytes)
    connection.send(_method(predictor))
    while True:
        try:
            description = connection.recv()
            content = connection.recv_bytes()
        except (EOFError, OSError):
            return
        connection.send(predict_file(predictor, Job(content, *description), limits.max_bytes))


def _method(predictor: Predictor) -> Method:
    if isinstance(predictor, NetworkPredictor):
        return Method(str(predictor), network=predictor.name, points=predictor.num_points)
    return Method(str(predictor), rule=predictor.name)


def predict_file(predictor: Predictor, job: Job, max_bytes: int) -> Reply:
    """Read a file of at most `max_bytes` unpacked and predict it; every error is a reply."""
    try:
        file = read_body(job.content, job.headers, max_bytes)
        cloud, pose = parse_posed_cloud(file.content, job.suffix or file.suffix, job.options)
        prediction = require_points(predict_posed(predictor, cloud, pose, job.door_known))
        record = prediction_to_dict(prediction, format_parameter, pose)
        is_faulty = prediction.abstention is not None and prediction.abstention.code == "invalid_outputs"
        return Reply(200, record, prediction.reason if is_faulty else "")
    except HTTPException as error:
        return error_reply(error.status_code, error.detail)
    except WeightsError as error:  # of the service, whatever the file
        _LOG.error("fault of the weights: %s", error)
        reason = error.describe(with_path=False)
        return error_reply(500, reason)._replace(fault=reason)
    except CloudContentError as error:
        return error_reply(422, error.describe(format_parameter, with_path=False))
    except DoorstateError as error:
        return error_reply(400, error.describe(format_parameter, with_path=False))
    except MemoryError:
        return error_reply(413, "the file needs too much memory")
    except Exception as error:  # a worker outlives a fault in one file
        _LOG.exception("fault in a file of %d bytes, format %s", len(job.content), job.suffix)
        return error_reply(500, f"internal error ({type(error).__name__}): see the log of the service")


def _limit_memory(memory_bytes: int) -> None:
    """Let this process map so much more memory than it has mapped now."""
    try:
        import resource  # not on Windows
        from pathlib import Path

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (ImportError, OSError):
        return
    limit = pages * resource.getpagesize() + memory_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))
