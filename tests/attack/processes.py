# SPDX-License-Identifier: Apache-2.0
"""Commands in processes of their own, forked: as real as a new one, and a hundred of them are quick."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, NoReturn

from doorstate.cli import main
from tests.attack.tries import Try, Violation

_CLONE_NEWPID = 0x20000000
_TIMEOUT_S = 300.0


class Done(NamedTuple):
    """End of a command."""

    code: int  # negative: the signal that killed it
    out: str
    err: str

    def as_try(self, kind: str, allowed: Sequence[int] = (0, 1, 2)) -> Try:
        """Return the outcome: done, refused, or a violation for a traceback, a crash or another exit code."""
        if "Traceback" in self.err or self.code not in allowed:
            return Try(kind, f"exit code {self.code}", Violation.UNCAUGHT)
        return Try(kind, {0: "done", 1: "one line", 2: "one line"}.get(self.code, f"exit code {self.code}"))


class Process:
    """Running process, forked.

    Args:
        folder: current directory of the process; its output is kept there too.
        program: function to call; what it raises ends the process.
        first: run as process number 1 of a namespace, as in a container, where that is permitted.
        file_bytes: largest size of a file that it can write.
    """

    def __init__(
        self, folder: Path, program: Callable[[], None], *, first: bool = False, file_bytes: int | None = None
    ) -> None:
        self._logs = [folder / f".{name}{time.monotonic_ns()}" for name in ("out", "err")]
        self._code: int | None = None
        self.pid = os.fork()
        if self.pid == 0:
            self._become(folder, program, first, file_bytes)

    def _become(
        self, folder: Path, program: Callable[[], None], first: bool, file_bytes: int | None
    ) -> NoReturn:
        os.chdir(folder)
        signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it
        for number, log in enumerate(self._logs, start=1):
            os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT), number)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
        if first and ctypes.CDLL(None).unshare(_CLONE_NEWPID) == 0 and (inner := os.fork()):
            os._exit(os.waitstatus_to_exitcode(os.waitpid(inner, 0)[1]))
        if file_bytes is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))
        os._exit(_exit_code_of(program))

    def is_running(self) -> bool:
        """Return True until the process has ended."""
        if self._code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self._code = os.waitstatus_to_exitcode(status) if pid else None
        return self._code is None

    def wait(self, timeout_s: float = _TIMEOUT_S) -> Done:
        """Wait for the end; a process that takes too long is killed."""
        deadline = time.monotonic() + timeout_s
        while self.is_running():
            if time.monotonic() > deadline:
                os.kill(self.pid, signal.SIGKILL)
            time.sleep(0.01)
        out, err = (log.read_text(errors="replace") for log in self._logs)
        for log in self._logs:
            log.unlink()
        assert self._code is not None
        return Done(self._code, out, err)


class Command(Process):
    """Running command; `arguments` are those of `doorstate`, the others are those of `Process`."""

    def __init__(
        self, folder: Path, arguments: Sequence[object], *, first: bool = False, file_bytes: int | None = None
    ) -> None:
        def program() -> None:
            sys.argv = ["doorstate", *map(str, arguments)]
            main()

        super().__init__(folder, program, first=first, file_bytes=file_bytes)


def run(folder: Path, *arguments: object, file_bytes: int | None = None) -> Done:
    """Run a command to its end."""
    return Command(folder, arguments, file_bytes=file_bytes).wait()


def wait_for_handlers(pid: int) -> None:
    """Wait until a process handles SIGTERM, as a program does from its first line on, or has ended."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        status = dict(line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
        if int(status.get("SigCgt", "0"), 16) & 1 << signal.SIGTERM - 1 or status["State"].startswith("Z"):
            return
        time.sleep(0.001)


def _exit_code_of(program: Callable[[], None]) -> int:
    code: object = 0
    try:
        program()
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        code = 120
    return code if isinstance(code, int) else 1
