# SPDX-License-Identifier: Apache-2.0
"""Forms for devices other than the CPU, on the CPU: it stands for a device that is not there."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from unittest.mock import patch

from torch import Tensor

from doorstate.networks import kernels


def _never(tensor: Tensor) -> bool:
    return False


@contextmanager
def device_forms() -> Iterator[None]:
    """Use the forms for devices on every device within the block."""
    with ExitStack() as stack:
        for found in pkgutil.iter_modules(kernels.__path__):
            module = import_module(f"{kernels.__name__}.{found.name}")
            if hasattr(module, "on_cpu"):
                stack.enter_context(patch.object(module, "on_cpu", _never))
        yield
