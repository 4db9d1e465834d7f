# SPDX-License-Identifier: Apache-2.0
"""Optional speed-ups of the machine."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")


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
