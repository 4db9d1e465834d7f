# SPDX-License-Identifier: Apache-2.0
"""Bad input that follows the code it reaches: atheris (libFuzzer) tries, `fuzzer` judges.

    pip install atheris
    python -m benchmarks.guided all reports/guided -max_total_time=600
    python -m benchmarks.guided .pcd reports/guided reports/guided/pcd-crash-0123

Arguments are one of the fuzzer's targets or `all`, one after the other; a folder; options of libFuzzer. Inputs that
reached something new are kept in the folder, and the next run goes on from them. What fails ends a target's run, makes
the exit code 1, and is kept as `TARGET-crash-...`; files after the folder are tried once.
"""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
from pathlib import Path

import atheris
import numpy as np

with atheris.instrument_imports(include=["doorstate", "pypcd4", "PIL", "rosbags", "ruamel", "yaml"]):
    from benchmarks import bags
    from benchmarks.broken_bags import draw_valid_message
    from benchmarks.fuzzer import FAILURES, TARGETS, Fuzzer, Outcome, draw_suffix
    from benchmarks.mutations import MESSAGES, sealed

_SEEDS = 100
_LONGEST_SEED = 1 << 16  # bytes: what unpacks to gigabytes is long, and mutants are as long as the longest
_EVERY = 32  # pixels of 640 x 480: small inputs are quicker, and more of their bytes matter
_OPTION_BYTES = 2  # at the end of an input: they choose how it is read


class Failure(Exception):
    """What libFuzzer stops for."""


def run(target: str, folder: Path, options: list[str], scratch: Path) -> None:
    """Try inputs until the options say stop, or one fails; the process ends then."""
    fuzzer = Fuzzer(scratch, _EVERY)
    name = target.strip(".").replace(" ", "-")
    corpus = folder / name
    corpus.mkdir(parents=True, exist_ok=True)
    if not any(corpus.iterdir()):
        for number in range(_SEEDS):
            seed = _seed(fuzzer, target, np.random.default_rng(number))
            (corpus / f"seed-{number}").write_bytes(seed + bytes(_OPTION_BYTES))

    def attempt(data: bytes) -> None:
        outcome, detail = judge(fuzzer, target, data)
        if outcome in FAILURES:
            raise Failure(f"{outcome}: {detail}")

    tried = [] if any(not option.startswith("-") for option in options) else [str(corpus)]
    prefix = f"-artifact_prefix={folder / name}-"
    atheris.Setup([sys.argv[0], "-rss_limit_mb=4096", prefix, *options, *tried], attempt)
    atheris.Fuzz()


def judge(fuzzer: Fuzzer, target: str, data: bytes) -> Outcome:
    """What becomes of bytes: the content of a file, or a serialized message."""
    content, choice = data[:-_OPTION_BYTES], data[-_OPTION_BYTES:]
    rng = np.random.default_rng(list(choice))
    if target == ".png":
        content = sealed(content)  # no chance finds a checksum
    if target not in MESSAGES:
        return fuzzer.judge(target, (draw_suffix(target, rng), content), rng)
    try:
        message = bags.deserialized(content, target)
    except Exception:  # no message at all; those in bags are tried as bags
        return "refused", ""
    return fuzzer.judge(target, message, rng)


def _seed(fuzzer: Fuzzer, target: str, rng: np.random.Generator) -> bytes:
    if target in MESSAGES:
        return bags.serialized(draw_valid_message(rng, target, fuzzer.scene))
    content: bytes = fuzzer.draw_for(target, rng)[1]
    return content[:_LONGEST_SEED]


def main(target: str, folder: Path, options: list[str]) -> bool:
    """Whether nothing failed; every target has a process of its own, which libFuzzer ends."""
    codes = []
    with tempfile.TemporaryDirectory() as scratch:
        for each in TARGETS if target == "all" else (target,):
            child = os.fork()
            if not child:
                try:
                    run(each, folder, options, Path(scratch))
                except BaseException:
                    traceback.print_exc()
                os._exit(2)
            codes.append(os.waitpid(child, 0)[1])
    return not any(codes)


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("all", *TARGETS):
        sys.exit(f"{__doc__}\nTargets: {', '.join(TARGETS)}")
    sys.exit(0 if main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:]) else 1)
