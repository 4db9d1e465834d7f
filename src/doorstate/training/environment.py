# SPDX-License-Identifier: Apache-2.0
"""Description of the machine and the libraries that a result was made with."""

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
    """Versions, processor and threads."""
    import torch

    return {
        "doorstate": __version__,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "platform": platform.platform(),
        "processor": processor_name(),
        "threads": torch.get_num_threads(),
        "bf16": bf16_is_quick(),
        "cuda": torch.version.cuda or "" if torch.cuda.is_available() else "",
    }


def processor_name() -> str:
    """The processor's name where the system tells it."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def bf16_is_quick() -> bool:
    """Whether this machine multiplies bf16 matrices in hardware."""
    import torch

    if torch.cuda.is_available():
        return bool(torch.cuda.is_bf16_supported())
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A function through torch.compile, or as it is from the first time that fails, with one warning in the log."""
    import torch
    from torch._dynamo.exc import TorchDynamoException  # takes a second to import

    quick: Callable[_P, _R] | None = torch.compile(function)

    @wraps(function)
    def call(*arguments: _P.args, **options: _P.kwargs) -> _R:
        nonlocal quick
        if quick is not None:
            try:
                return quick(*arguments, **options)
            except TorchDynamoException as error:
                quick = None
                reason = str(error).strip().partition("\n")[0]
                logging.getLogger(__name__).warning("torch.compile failed (%s): running uncompiled", reason)
        return function(*arguments, **options)

    return call
