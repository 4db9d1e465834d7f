# SPDX-License-Identifier: Apache-2.0
"""Machine and libraries of a result, and optional speed-ups of the machine."""

from __future__ import annotations

import logging
import platform
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np

from doorstate import __version__

_P = ParamSpec("_P")
_R = TypeVar("_R")


def describe_environment() -> dict[str, str | int | bool]:
    """Return versions, processor and number of threads."""
    import torch

    return {
        "doorstate": __version__,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "platform": platform.platform(),
        "processor": processor_name(),
        "threads": torch.get_num_threads(),
        "bf16": has_fast_bf16(),
        "cuda": torch.version.cuda or "" if torch.cuda.is_available() else "",
    }


def processor_name() -> str:
    """Return the name of the processor, or its architecture where the system has no name."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def has_fast_bf16() -> bool:
    """Return True if this machine multiplies bf16 matrices in hardware."""
    import torch

    if torch.cuda.is_available():
        return bool(torch.cuda.is_bf16_supported())
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())


def compile_if_possible(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function compiled by torch.compile; after a failure it runs uncompiled, with one warning in the log."""
    import torch
    from torch._dynamo.exc import TorchDynamoException  # takes a second to import

    fast: Callable[_P, _R] | None = torch.compile(function)

    @wraps(function)
    def call(*arguments: _P.args, **options: _P.kwargs) -> _R:
        nonlocal fast
        if fast is not None:
            try:
                return fast(*arguments, **options)
            except TorchDynamoException as error:
                fast = None
                reason = str(error).strip().partition("\n")[0]
                logging.getLogger(__name__).warning("torch.compile failed (%s): running uncompiled", reason)
        return function(*arguments, **options)

    return call
