# SPDX-License-Identifier: Apache-2.0
"""SIGINT and SIGTERM: the program ends by the signal, whatever it interrupts, and cleans up before."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

_HEAD = """
import os, signal, sys, time
from pathlib import Path
from doorstate.cli.signals import Terminated, handle_signals, leave_signals, raise_in

signal.signal(signal.SIGINT, signal.default_int_handler)  # the child of a background job ignores it
number = signal.Signals[sys.argv[1]]
handle_signals()

def interrupt():
    signal.raise_signal(number)

def main(work):
    try:
        raise_in(work, "; advice")
    finally:
        leave_signals()
"""
_CASES = {
    "work": """
def work():
    try:
        interrupt()
    finally:
        print("cleaned up")
main(work)
""",
    "an import": """
sys.path.insert(0, os.getcwd())
Path("swallows.py").write_text('''
import __main__
try:
    __main__.interrupt()
except BaseException:
    raise ImportError("initialization failed") from None
''')
def work():
    try:
        import swallows
        time.sleep(60)
    finally:
        print("cleaned up")
main(work)
""",
    "a finalizer": """
class Resource:
    def __del__(self):
        interrupt()
def work():
    try:
        Resource()
        time.sleep(60)
    finally:
        print("cleaned up")
main(work)
""",
    "a library that raises its own error": """
def work():
    print("cleaned up")
    try:
        interrupt()
    except BaseException as error:
        raise ValueError("callback failed") from error
main(work)
""",
    "a library that drops the error": """
def work():
    try:
        try:
            interrupt()
        except BaseException:
            pass
        time.sleep(60)
    finally:
        print("cleaned up")
main(work)
""",
    "the start of workers": """
from multiprocessing.process import BaseProcess
from doorstate._jobs import run_pieces
start = BaseProcess.start
def start_and_interrupt(process):
    BaseProcess.start = start
    start(process)
    interrupt()
BaseProcess.start = start_and_interrupt
def work():
    try:
        run_pieces(os.path.join, ["a", "b"], [Path("a"), Path("b")], workers=2)
    finally:
        print("cleaned up")
main(work)
""",
    "a callback at exit": """
import atexit
atexit.register(interrupt)
print("cleaned up", flush=True)
main(lambda: None)
""",
}


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("interrupted", _CASES)
def test_the_signal_ends_the_program(interrupted: str, name: str, tmp_path: Path) -> None:
    call = [sys.executable, "-c", _HEAD + _CASES[interrupted], name]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, timeout=50)
    assert (done.returncode, done.stdout) == (-signal.Signals[name], "cleaned up\n")
    assert "Traceback" not in done.stderr
    assert done.stderr.count("; advice") == (interrupted != "a callback at exit")


def test_no_signal_is_no_end(tmp_path: Path) -> None:
    script = _HEAD + "print(raise_in(lambda: 'done'))"
    done = subprocess.run([sys.executable, "-c", script, "SIGINT"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")


def test_signals_are_handled_before_long_imports() -> None:
    script = "import sys; before = {*sys.modules}; import doorstate.cli; print(*{*sys.modules} - before)"
    names = subprocess.check_output([sys.executable, "-c", script], text=True).split()
    assert not {"typing", "typer", "numpy", "doorstate.cli.application"} & {*names}
