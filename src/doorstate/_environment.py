# SPDX-License-Identifier: Apache-2.0
"""Machine and libraries of a result."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import numpy as np

from doorstate import __version__
from doorstate._devices import has_fast_bf16


def describe_environment() -> dict[str, str | int | bool]:
    """Return versions, processor and number of threads, of torch where it is installed."""
    import onnxruntime  # takes a tenth of a second

    return {
        "doorstate": __version__,
        "python": platform.python_version(),
        **_torch_version(),
        "numpy": np.__version__,
        "onnxruntime": onnxruntime.__version__,
        "platform": platform.platform(),
        "processor": processor_name(),
        **_torch_settings(),
    }


def _torch_version() -> dict[str, str]:
    try:
        import torch
    except ModuleNotFoundError:
        return {}
    return {"torch": torch.__version__}


def _torch_settings() -> dict[str, str | int | bool]:
    try:
        import torch
    except ModuleNotFoundError:
        return {"threads": os.cpu_count() or 1}
    return {
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
