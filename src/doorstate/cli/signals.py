# SPDX-License-Identifier: Apache-2.0
"""SIGINT and SIGTERM end the program by the signal itself, once files and workers of a command are cleaned up.

A shell stops a loop of commands at Ctrl-C only if the signal itself ended the command; it reports 128 + the signal.
This module is imported before all others, and imports next to nothing.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys

TYPE_CHECKING = False  # importing the module typing takes longer than all that is imported here
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType
    from typing import NoReturn, TypeVar

    Result = TypeVar("Result")

_WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
_DEFAULTS = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
_CAN_WAIT = hasattr(signal, "setitimer")  # not on Windows
_PAUSE_S = 0.01
_STARTS = {("multiprocessing.process", "start"), ("concurrent.futures.process", "submit")}
_SHOW_CURSOR = b"\x1b[?25h"


class _Raised(BaseException):
    """Exception of a signal. C code may drop it, as of a comparison that was interrupted: then it is raised again."""

    def __del__(self) -> None:
        if _State.raises and _State.received is not None:
            _raise_later(_State.received)


class Terminated(_Raised):
    """SIGTERM, raised in the main thread as KeyboardInterrupt is."""


class _Interrupted(_Raised, KeyboardInterrupt):
    """SIGINT."""


class _State:
    """State of the program: what a signal does, and the signals that came."""

    raises = False
    received: int | None = None
    ended_by: int | None = None


def handle_signals() -> None:
    """Let SIGINT and SIGTERM end the program at once, but for the work of `raise_in`."""
    for number, default in _DEFAULTS.items():
        if signal.getsignal(number) == default:  # background jobs of a shell ignore SIGINT
            signal.signal(number, _handle)
    # Called last, because modules imported later register their functions later.
    atexit.unregister(_end_interpreter)
    atexit.register(_end_interpreter)


def leave_signals() -> None:
    """Let the system handle SIGINT and SIGTERM: an exiting interpreter prints a traceback of what they interrupt."""
    for number in _DEFAULTS:
        if signal.getsignal(number) == _handle:
            signal.signal(number, signal.SIG_DFL)


def raise_in(work: Callable[[], Result], advice: str = "") -> Result:
    """Return `work()`, in which the first SIGINT raises KeyboardInterrupt and the first SIGTERM raises Terminated.

    Args:
        work: function without arguments.
        advice: text to print after "interrupted" or "terminated".

    Raises:
        SystemExit: a signal ended the work; the same signal ends the interpreter when it has cleaned up.
    """
    _State.received = None
    try:
        try:
            _State.raises = True
            return work()
        finally:
            _State.raises = False
            if _CAN_WAIT:
                signal.setitimer(signal.ITIMER_REAL, 0)
    except BaseException as error:
        # Of any kind: libraries raise their own errors when a function that they call is interrupted, and so do those
        # who wait for a worker that the signal has ended.
        number = _State.ended_by = _State.received
        if number is None and not isinstance(error, KeyboardInterrupt):
            raise
        number = number or signal.SIGINT
    _print_end(number, advice)
    raise SystemExit(128 + number)


def accept_signal() -> None:
    """Go on after the exception of a signal that was caught, which would be raised again otherwise."""
    _State.received = None


def _handle(number: int, frame: FrameType | None) -> None:
    leave_signals()  # a second one need not wait for the interpreter
    if not _State.raises:
        _end_at_once(number)
    _State.received = number
    others = sys.unraisablehook

    def raise_again(unraisable: sys.UnraisableHookArgs) -> None:
        if isinstance(unraisable.exc_value, (KeyboardInterrupt, Terminated)):
            _raise_later(number)
        else:
            others(unraisable)

    sys.unraisablehook = raise_again  # nothing is raised out of an interrupted finalizer
    _raise(number, frame)


def _raise(number: int, frame: FrameType | None) -> None:
    if _is_fragile(frame):
        _raise_later(number)
    elif _State.raises:  # else the work ended meanwhile
        raise _Interrupted if number == signal.SIGINT else Terminated


def _raise_later(number: int) -> None:
    if not _CAN_WAIT:
        _end_at_once(number)
    signal.signal(signal.SIGALRM, lambda _, frame: _raise(number, frame))
    signal.setitimer(signal.ITIMER_REAL, _PAUSE_S)


def _is_fragile(frame: FrameType | None) -> bool:
    """Return True within an import, which may swallow the exception or raise another, and the start of workers.

    A worker whose start is not completed prints a traceback, and one that its pool does not know yet is not waited for.
    """
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        if (frame.f_globals.get("__name__"), frame.f_code.co_name) in _STARTS:
            return True
        frame = frame.f_back
    return False


def _print_end(number: int, advice: str) -> None:
    print(f"doorstate: {_WORDS[signal.Signals(number)]}{advice}", file=sys.stderr)  # noqa: T201


def _end_at_once(number: int) -> NoReturn:
    if sys.stderr is not None and sys.stderr.isatty():
        os.write(2, _SHOW_CURSOR)
    signal.raise_signal(number)
    os._exit(128 + number)  # the first process of a container survives signals of its own


def _end_interpreter() -> None:
    if _State.ended_by is not None:
        signal.raise_signal(_State.ended_by)
