# SPDX-License-Identifier: Apache-2.0
"""Fuzz one target guided by coverage, with atheris (libFuzzer): `python -m tests.fuzz pcd --runs 100000`.

Inputs that reach new code are kept in a folder, from which the next run continues. A failing input is written as
`crash-...`; give that file to run it again.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

import atheris

with atheris.instrument_imports(
    include=["doorstate.io", "doorstate.serving.body", "pypcd4", "PIL", "rosbags", "ruamel", "yaml"]
):
    from tests.fuzz.targets import TARGETS


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("target", choices=TARGETS)
    parser.add_argument("inputs", nargs="*", type=Path, help="run these inputs once instead of fuzzing")
    parser.add_argument("--runs", type=int, default=-1, help="number of inputs (default: until interrupted)")
    parser.add_argument("--seconds", type=int, default=0, help="time limit (default: none)")
    parser.add_argument("--corpus", type=Path, default=Path("build/fuzz"), help="folder of kept inputs")
    arguments = parser.parse_args()
    corpus = arguments.corpus / arguments.target
    corpus.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("error")
    options = [
        f"-runs={arguments.runs}",
        f"-max_total_time={arguments.seconds}",
        f"-artifact_prefix={corpus}/",
        "-timeout=20",
        "-rss_limit_mb=4096",
    ]
    inputs = [str(path) for path in arguments.inputs] or [str(corpus)]
    atheris.Setup([sys.argv[0], *options, *inputs], TARGETS[arguments.target].hypothesis.fuzz_one_input)  # type: ignore[attr-defined]
    atheris.Fuzz()


if __name__ == "__main__":
    main()
