# SPDX-License-Identifier: Apache-2.0
"""An object in a process of its own, called over a pipe; what goes wrong there is one line here."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from doorstate.errors import RunError


class _Failure(NamedTuple):
    reason: str


class Worker:
    """A process that builds one object and calls its methods, one at a time, until it is closed."""

    def __init__(self, factory: Callable[..., object], *arguments: Any) -> None:
        # spawn: nothing of this process's memory, threads or allocator state is inherited.
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, factory, arguments), daemon=True)
        self._process.start()
        theirs.close()

    def call(self, method: str, *arguments: Any) -> Any:
        """Answer of a method.

        Raises:
            RunError: the object could not be built, the method failed, or the process died.
        """
        try:
            self._connection.send((method, arguments))
            answer = self._connection.recv()
        except (EOFError, OSError):
            self._process.join()
            raise RunError(_cause_of_death(self._process.exitcode)) from None
        if isinstance(answer, _Failure):
            raise RunError(answer.reason)
        return answer

    def close(self) -> None:
        """End the process."""
        self._connection.close()
        self._process.join()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _serve(connection: Connection, factory: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides, and workers print no tracebacks
    score = Path("/proc/self/oom_score_adj")
    if score.exists():
        with suppress(OSError):
            score.write_text("1000")  # when memory runs out, a worker is to die, not the benchmark
    served: object = None
    while True:
        try:
            method, given = connection.recv()
        except EOFError:
            return
        try:
            served = factory(*arguments) if served is None else served
            answer = getattr(served, method)(*given)
        except Exception as error:  # a port may raise anything
            answer = _Failure(_one_line(error))
        connection.send(answer)


def _one_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if isinstance(error, RunError) else f"{type(error).__name__}: {lines[0] if lines else ''}"


def _cause_of_death(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        return f"killed by {name}" + (": out of memory?" if name == "SIGKILL" else "")
    return f"ended with exit code {exit_code}"
