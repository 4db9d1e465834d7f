# SPDX-License-Identifier: Apache-2.0
"""An object in a process of its own, called over a pipe; its exceptions arrive as one line."""

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
    """Process that builds one object and calls its methods one at a time, until it is closed.

    Args:
        factory: makes the object.
        arguments: its arguments.
        is_parent: the process starts others.
    """

    def __init__(self, factory: Callable[..., object], *arguments: Any, is_parent: bool = False) -> None:
        # spawn: the process inherits no memory, threads or allocator state.
        context = multiprocessing.get_context("spawn")
        self._connection, child_connection = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(child_connection, factory, arguments), daemon=not is_parent
        )
        self._process.start()
        child_connection.close()

    def call(self, method: str, *arguments: Any) -> Any:
        """Return the result of a method.

        Raises:
            RunError: the object could not be built, the method failed, or the process died.
        """
        try:
            self._connection.send((method, arguments))
            result = self._connection.recv()
        except (EOFError, OSError):
            self._process.join()
            raise RunError(_describe_exit(self._process.exitcode)) from None
        if isinstance(result, _Failure):
            raise RunError(result.reason)
        return result

    def close(self) -> None:
        """End the process."""
        self._connection.close()
        self._process.join()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _serve(connection: Connection, factory: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles it, and workers print no tracebacks
    score = Path("/proc/self/oom_score_adj")
    if score.exists():
        with suppress(OSError):
            score.write_text("1000")  # without memory the kernel should kill a worker, not the benchmark
    instance: object = None
    while True:
        try:
            method, method_arguments = connection.recv()
        except EOFError:
            return
        try:
            instance = factory(*arguments) if instance is None else instance
            result = getattr(instance, method)(*method_arguments)
        except Exception as error:  # a port may raise anything
            result = _Failure(_one_line(error))
        connection.send(result)


def _one_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    first = lines[0] if lines else ""
    return first if isinstance(error, RunError) else f"{type(error).__name__}: {first}"


def _describe_exit(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        return f"killed by {name}" + (": out of memory?" if name == "SIGKILL" else "")
    return f"ended with exit code {exit_code}"
