# SPDX-License-Identifier: Apache-2.0
"""Choice of the device that computes: the processor, or a CUDA device."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from doorstate.errors import ConfigError

if TYPE_CHECKING:
    import torch

DEVICES = "auto, cpu, cuda or cuda:N"
"""Names of devices, for help and errors."""


def check_device_name(name: str) -> str:
    """Return a name of `DEVICES`; imports nothing.

    Raises:
        ConfigError: another name.
    """
    if not re.fullmatch(r"auto|cpu|cuda(:[0-9]{1,3})?", name):
        raise ConfigError(f"no device {name!r}", field="device", expected=DEVICES)
    return name


def resolve_device(name: str) -> torch.device:
    """Return the device of a name in `DEVICES`: "auto" is the first CUDA device if there is one, else the processor.

    Raises:
        ConfigError: another name, or there is no such device.
    """
    import torch

    check_device_name(name)
    found = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if name == "cpu" or (name == "auto" and not found):
        return torch.device("cpu")
    number = int(name.partition(":")[2] or 0)
    if number < found:
        return torch.device("cuda", number)
    if found:
        raise ConfigError(f"no device {name!r}", field="device", expected=f"cuda:0 to cuda:{found - 1}")
    hint = "install a torch that is built for CUDA" if torch.version.cuda is None else "check its driver"
    raise ConfigError("there is no CUDA device", field="device", expected="cpu", hint=hint)


def describe_device(device: torch.device) -> str:
    """Return the device and the name of its hardware, such as `cuda:0 NVIDIA H200`."""
    import torch

    return str(device) if device.type != "cuda" else f"{device} {torch.cuda.get_device_name(device)}"


def has_fast_bf16(device: torch.device | None = None) -> bool:
    """Return True if a device, by default the processor, multiplies bf16 matrices in hardware."""
    import torch

    if device is not None and device.type == "cuda":
        with torch.cuda.device(device):
            return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())
