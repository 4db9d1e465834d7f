# SPDX-License-Identifier: Apache-2.0
"""Fuzz one target guided by coverage, with atheris (libFuzzer): `python -m tests.fuzz pcd --runs 100000`.

Inputs that reach new code are kept in a folder, from which the next run continues. A failing input is written as
`crash-...`; give that file to run it again. Targets of settings take their inputs as the content of the file;
`--damage` drives their hypothesis tests instead, which damage the bytes of compressed files and of weights too.

`python -m tests.fuzz all --runs 10000` fuzzes one target after another, each in its own process, and prints a table.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import re
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import atheris

_INSTRUMENTED = [
    "doorstate._documents",
    "doorstate._files",
    "doorstate.dataset",
    "doorstate.evaluation",
    "doorstate.io",
    "doorstate.networks.card",
    "doorstate.serving.body",
    "doorstate.simulation",
    "doorstate.training",
    "pypcd4",
    "PIL",
    "rosbags",
    "ruamel",
    "tomllib",
    "yaml",
]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("target", help="name of a target, or all")
    parser.add_argument("inputs", nargs="*", type=Path, help="run these inputs once instead of fuzzing")
    parser.add_argument("--runs", type=int, default=-1, help="number of inputs (default: until interrupted)")
    parser.add_argument("--seconds", type=int, default=0, help="time limit (default: none)")
    parser.add_argument("--corpus", type=Path, default=Path("build/fuzz"), help="folder of kept inputs")
    parser.add_argument("--damage", action="store_true", help="damage valid files instead of their content")
    arguments = parser.parse_args()
    if arguments.target == "all":
        fuzz_all(arguments)
        return
    fuzz(arguments)


def import_instrumented() -> dict[str, Callable[[], None]]:
    """Return all targets by name; what they import counts for coverage."""
    with atheris.instrument_imports(include=_INSTRUMENTED):
        from tests.fuzz.targets import TARGETS
    return TARGETS


def fuzz(arguments: argparse.Namespace) -> None:
    """Fuzz one target in this process, which libFuzzer ends."""
    targets, name = import_instrumented(), arguments.target
    from tests.fuzz import settings_files

    if name not in targets:
        sys.exit(f"no target {name!r}; targets are {', '.join(targets)}, all")
    corpus = arguments.corpus / name
    corpus.mkdir(parents=True, exist_ok=True)
    run: Callable[[bytes], None] = targets[name].hypothesis.fuzz_one_input  # type: ignore[attr-defined]
    if name in settings_files.targets() and not arguments.damage:
        run = partial(settings_files.read_content, name=name)
        corpus = corpus / "content"
        corpus.mkdir(exist_ok=True)
        for number, content in enumerate(settings_files.seeds(name)):
            (corpus / f"good-{number}").write_bytes(content)
    warnings.simplefilter("error")
    options = [
        f"-runs={arguments.runs}",
        f"-max_total_time={arguments.seconds}",
        f"-artifact_prefix={corpus}/",
        "-timeout=20",
        "-rss_limit_mb=4096",
        "-max_len=8192",
    ]
    inputs = [str(path) for path in arguments.inputs] or [str(corpus)]
    atheris.Setup([sys.argv[0], *options, *inputs], run)
    atheris.Fuzz()


def fuzz_all(arguments: argparse.Namespace) -> None:
    """Fuzz all targets one after another, and print a line of a table for each."""
    # Imported once: to instrument all modules takes longer than a short round of a target.
    targets = import_instrumented()
    print("| target | inputs | s | failed |\n|---|--:|--:|---|", flush=True)
    for name in targets:
        started = time.monotonic()
        with tempfile.TemporaryFile() as output:
            process = multiprocessing.get_context("fork").Process(
                target=_fuzz_into, args=(arguments, name, output.fileno())
            )
            process.start()
            process.join()
            output.seek(0)
            text = output.read().decode(errors="replace")
        inputs = [int(number) for number in re.findall(r"^(?:#|Done )([0-9]+)", text, re.MULTILINE)]
        failed = text.strip().rpartition("\n")[2] if process.exitcode else "none"
        seconds = time.monotonic() - started
        print(f"| {name} | {max(inputs, default=0)} | {seconds:.0f} | {failed} |", flush=True)


def _fuzz_into(arguments: argparse.Namespace, name: str, output: int) -> None:
    """Fuzz one target in a forked process, which writes to a file."""
    for stream in (1, 2):
        os.dup2(output, stream)
    arguments.target = name
    fuzz(arguments)


if __name__ == "__main__":
    main()
